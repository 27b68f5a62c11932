# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Text: filters, metadata, names, JSON, base64, jobs."""
import json


def encoded(texts):
    return {name: text if isinstance(text, bytes) else text.encode() for name, text in texts.items()}


def filters():
    metadata = '{"shop": "east", "year": 2021, "tags": ["a", "b", 1.5], "big": 9007199254740993, "none": null}'
    tests = {
        "equal": '{"shop": "east", "none": null}',
        "bounds": '{"year": {"gte": 2020, "lt": 2024.5}}',
        "list": '{"tags": {"in": ["c", "b", true, 1.5]}}',
        "text": '{"shop": {"gt": "a", "lte": "eb"}}',
        "large": '{"big": {"gt": 9007199254740992.0, "lte": 18446744073709551615}}',
        "negative": '{"year": {"gte": -9223372036854775808, "lte": 1e400}}',
        "none": "{}",
        "two_bounds": '{"year": {"gt": 1, "gte": 2}}',
        "unknown": '{"year": {"near": 1}}',
        "deep": '{"a": {"in": [[[[1]]]]}}',
        "array": "[1]",
        "escapes": r'{"\u0073hop": "\ud83d\ude00", "a\u0000b": "\\"}',
    }
    made = {name: f"{text}\n{metadata}" for name, text in tests.items()}
    made["twice"] = '{"a": 1, "a": 2}\n{"a": 1, "a": 2}'
    made["broken_metadata"] = '{"a": 1}\n{"a": 1'
    made["zero"] = '{"a": {"lte": -0.0, "gte": 0}}\n{"a": [0, -0, 0.0, -0.0, 1e-400]}'
    combined = {
        "and": ('{"and": [{"n": {"gt": 2}}, {"n": {"lt": 8}}]}', '{"n": [1, 9]}'),
        "exists": ('{"a": {"exists": false}, "b": {"exists": true}}', '{"b": null}'),
        "ne": ('{"a": {"ne": 1, "gt": 0}}', '{"a": [2, 3]}'),
        "no_parts": ('{"or": []}', '{}'),
        "not": ('{"not": {"or": [{"a": 1}, {"not": {"b": 2}}]}}', '{"a": 2, "b": 2}'),
        "nots": ('{"not":{"not":{"not":{"not":{"not":{"not":{"not":{"n":1}}}}}}}}', '{"n": 1}'),
        "or": ('{"or": [{"a": 1}, {"b": {"ne": null}}], "c": 2}', '{"b": 7, "c": 2}'),
        "reserved": (r'{"\\and": 1, "\\\\x": {"in": [true]}}', r'{"and": 1, "\\x": true}'),
    }
    made.update({name: f"{text}\n{of}" for name, (text, of) in combined.items()})
    return encoded(made)


def metadata():
    return encoded({
        "object": '{"b": [1, 2.50, -0.0, 1e300, 18446744073709551616], "a": {"c": "\\u00e9\\ud83d\\ude00"}}',
        "empty": " { } ",
        "deep": '{"a":' * 31 + "{}" + "}" * 31,
        "too_deep": '{"a":' * 33 + "{}" + "}" * 33,
        "brackets": "[" * 200,
        "array": "[{}]",
        "twice": '{"a": 1, "a": 2}',
        "numbers": '{"n": [1E+2, 1e-7, 123456789012345678901234567890, 0.1, -9223372036854775809, 5e-324, 1e400]}',
        "bad_utf8": b'{"a": "\xc3\x28"}',
        "surrogate": '{"a": "\\ud800"}',
        "comment": '{"a": 1} // no',
        "mark": b'\xef\xbb\xbf{"a": 1}',
        "control": '{"a\\u0000": "\\u007f"}',
    })


def names():
    return encoded({
        "plain": "blue-mug_7.jpg", "accents": "Tasse à café", "emoji": "👩‍👧", "persian": "می‌خواهم",
        "direction": "a\u202eb", "invisible": "a\u200bb", "tag": "a\U000e0041", "control": "a\tb\n\x7f",
        "dots": "..", "path": "../../etc/passwd", "colon": "a:b@c~d", "overlong": b"\xc0\xaf", "surrogate": b"\xed\xa0\x80",
        "too_large": b"\xf4\x90\x80\x80", "largest": b"\xf4\x8f\xbf\xbf", "cut": b"\xe2\x82", "zero": b"a\0b",
        "long": "x" * 513, "all": bytes(range(256)),
    })


def bodies():
    return encoded({
        "object": '{"limit": 3, "filter": {"a": [1, 2.5, null, true]}, "object": "mug \\u00fc"}',
        "array": '[{"object": "mug"}, {"object": "cup", "id": "cup-1"}, 1e5, "\\n"]',
        "deep": "[" * 32 + "]" * 32, "too_deep": "[" * 33 + "]" * 33, "mixed": '{"a":[' * 15 + "1" + "]}" * 15,
        "twice": '{"a": 1, "a": {"a": 2}}', "cut": '{"a": "', "number": "1", "text": '"a"', "nothing": "",
        "numbers": "[0, -0, -0.0, 1e308, 1e309, 0.1, 9223372036854775808, -9223372036854775809]",
        "bad_utf8": b'["\xff"]', "late": "[[],[[[[[1],2],3],4],5],{}]",
    })


def base64s():
    return encoded({
        "cursor": "WyJpbWFnZXMiLCJhIl0", "one": "QQ", "two": "QUI", "stray": "QR", "left_over": "QUJDR", "padded": "QQ==",
        "plus": "+/+/", "marks": "-_-_", "nothing": "", "bytes": bytes(range(256)),
    })


def jobs():
    report = {"problem": {"status": 422, "code": "image_truncated", "parameter": "", "detail": "cut short"},
              "skipped": [["a.jpg", "image_empty", "0 bytes"]]}
    folder = '{"folder": "a", "object_from": "name"}'
    made = {name: f"{folder}\n{state}\n{json.dumps(text)}" for name, state, text in (
        ("done", "done", {}), ("failed", "failed", report), ("queued", "queued", {"skipped": []}),
        ("problem_is_text", "failed", {"problem": "busy"}), ("status_is_text", "failed", {"problem": {"status": "x"}}),
        ("skipped_is_text", "done", {"skipped": "all"}), ("skipped_are_numbers", "done", {"skipped": [1, [1, 2, 3], []]}),
        ("no_report", "done", None))}
    made["other_state"] = "[]\nasleep\n{"
    return encoded(made)


SEEDS = {"filter": filters, "metadata": metadata, "names": names, "json_body": bodies, "base64": base64s,
         "job_record": jobs}
