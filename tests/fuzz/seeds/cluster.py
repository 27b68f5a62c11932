# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""What a cluster answers, and how it is named."""
import struct

TYPES = ("UInt8", "Int16", "UInt32", "UInt64", "Int64", "String", "FixedString(3)", "Array(String)", "Array(UInt32)",
         "Array(FixedString(2))", "Float64")  # in the order of native_blocks_fuzz.cc


def varint(value):
    out = b""
    while value >= 128:
        out += bytes([value % 128 + 128])
        value //= 128
    return out + bytes([value])


def text(value):
    return varint(len(value)) + value


def values(kind, rows):
    """Of a column: some of each kind."""
    if kind.startswith("Array("):
        ends = struct.pack(f"<{rows}Q", *(2 * (row + 1) for row in range(rows)))
        return ends + values(kind[len("Array("):-1], 2 * rows)
    if kind == "String":
        return b"".join(text(b"x" * (row * 70 % 200)) for row in range(rows))
    width = {"UInt8": 1, "Int16": 2, "UInt32": 4, "FixedString(2)": 2, "FixedString(3)": 3}.get(kind, 8)
    return bytes(i % 251 for i in range(rows * width))


def block(columns, rows):
    """`columns`: their numbers in TYPES."""
    parts = [varint(len(columns)), varint(rows)]
    for i in columns:
        parts += [text(b"c%d" % i), text(TYPES[i].encode()), values(TYPES[i], rows)]
    return b"".join(parts)


def native_blocks():
    every = range(len(TYPES))
    head = bytes([len(TYPES), 0, 40])
    made = {f"column_{i}": bytes([i, 0, 9]) + block([i], 3) for i in every}
    made["all"] = head + block(every, 2)
    made["two"] = head + block(every, 2) + block(every, 1)
    made["none"] = head
    made["no_rows"] = head + block(every, 0) + block(every, 1)
    made["end"] = head + block(every, 1) + b"\0\0"
    made["cut"] = head + block(every, 2)[:-3]
    made["error"] = head + block(every, 1) + b"Code: 60, e.displayText() = DB::Exception: no table"
    made["many_rows"] = b"\0\0\0" + block([0], 4000)
    made["too_many_rows"] = b"\0\0\0" + varint(1) + varint(1 << 40) + text(b"c0") + text(b"UInt8")
    made["long_varint"] = b"\0\0\0" + b"\xff" * 9 + b"\1"
    made["long_text"] = b"\5\0\0" + varint(1) + varint(1) + text(b"c5") + text(b"String") + varint((1 << 63) + 5)
    made["ends_fall"] = (b"\7\0\0" + varint(1) + varint(2) + text(b"c7") + text(b"Array(String)")
                         + struct.pack("<2Q", 5, 1))
    made["ends_huge"] = (b"\x08\0\0" + varint(1) + varint(1) + text(b"c8") + text(b"Array(UInt32)")
                         + struct.pack("<Q", 1 << 62))
    made["other_name"] = b"\0\0\0" + varint(1) + varint(1) + text(b"cc") + text(b"UInt8") + b"\1"
    made["other_type"] = b"\0\0\0" + varint(1) + varint(1) + text(b"c0") + text(b"UInt16") + b"\1\2"
    return made


def database_urls():
    return {name: url.encode() for name, url in {
        "full": "clickhouse://user@host:8123,host2:8123/pliant?keeper=zk1:2181,zk2:2181&cluster=other",
        "short": "clickhouse://host/p",
        "tls": "clickhouses://host/p?ca=/etc/ssl/ca.pem",
        "ipv6": "clickhouse://[::1]:8123,[fe80::2]/p?keeper=[::1]",
        "password": "clickhouse://user:opensesame@host/p",
        "password_question": "clickhouse://user:open?sesame-now@host/p",
        "password_port": "clickhouse://user:12345/sesame?now-open@host/p",
        "password_hash": "clickhouse://user:open#sesame@host/p",
        "password_slash": "clickhouse://user:open/sesame@host/p",
        "password_at": "clickhouse://user:open@sesame:a@host/p",
        "password_parameter": "clickhouse://host/p?password=opensesame",
        "twice": "clickhouse://a,a/p?cluster=a&cluster=b",
        "empty": "clickhouse://,/",
        "port": "clickhouse://a:0,b:65536/p",
        "name": "clickhouse://host/1';DROP",
        "other": "postgres://host/p",
    }.items()}


SEEDS = {"native_blocks": native_blocks, "database_url": database_urls}
