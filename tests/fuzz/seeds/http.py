# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Requests: heads, chunks, whole conversations, and what is made of them."""
HOST = "Host: 127.0.0.1\r\n"
FORM = "Content-Type: multipart/form-data; boundary=b\r\n"


def encoded(texts):
    return {name: text if isinstance(text, bytes) else text.encode() for name, text in texts.items()}


def with_length(line, body, fields=""):
    return f"{line} HTTP/1.1\r\n{HOST}{fields}Content-Length: {len(body.encode())}\r\n\r\n{body}"


def chunked(line, body, fields=""):
    return f"{line} HTTP/1.1\r\n{HOST}{fields}Transfer-Encoding: chunked\r\n\r\n{body}"


def part(name, value, more=""):
    return f'--b\r\nContent-Disposition: form-data; name="{name}"{more}\r\n\r\n{value}\r\n'


def heads():
    get = f"GET /x/1?object=a HTTP/1.1\r\n{HOST}"
    return encoded({
        "get": get + "\r\n",
        "length": with_length("POST /x", "{}"),
        "chunks": chunked("POST /x", "0\r\n\r\n"),
        "both": get + "Content-Length: 4\r\nTransfer-Encoding: chunked\r\n\r\n",
        "twice": get + "Content-Length: 4\r\nContent-Length: 4\r\n\r\n",
        "folded": get + "X: a\r\n b\r\n\r\n",
        "space": get + "Content-Length : 4\r\n\r\n",
        "sign": get + "Content-Length: +4\r\n\r\n",
        "large": get + "Content-Length: 99999999999999999999\r\n\r\n",
        "zero": get + "Content-Length: 000\r\n\r\n",
        "line_feeds": "GET / HTTP/1.1\nHost: a\n\n",
        "old": "GET / HTTP/1.0\r\nTransfer-Encoding: chunked\r\n\r\n",
        "no_name": get + ": a\r\n\r\n",
        "odd_line": "GET  / HTTP/1.1\r\n\r\n",
        "gzip": get + "Transfer-Encoding: gzip, chunked\r\n\r\n",
        "nul": get + "X: a\0b\r\n\r\n",
    })


def chunks():
    """The first byte is the logarithm of the limit, the second where the input is split."""
    bodies = {
        "one": "3\r\nabc\r\n0\r\n\r\n", "two": "3\r\nabc\r\nA;x=y\r\n0123456789\r\n0\r\n\r\nmore",
        "none": "0\r\n\r\n", "zeros": "0003\r\nabc\r\n000\r\n\r\n", "trailer": "0\r\nX: a\r\n\r\n",
        "sign": "+3\r\nabc\r\n0\r\n\r\n", "prefix": "0x3\r\nabc\r\n0\r\n\r\n", "space": "3 \r\nabc\r\n0\r\n\r\n",
        "line_feed": "3\nabc\n0\n\n", "large": "FFFFFFFFFFFFFFFF\r\n", "too_large": "200\r\n", "cut": "5\r\nab",
        "wrong_end": "3\r\nabcd\r\n0\r\n\r\n", "extension": "1;" + "x" * 1100 + "\r\na\r\n0\r\n\r\n",
    }
    return {name: bytes([8, 3]) + body.encode() for name, body in bodies.items()}


def conversations():
    form = part("object", "mug") + part("image", "P5", '; filename="a.jpg"\r\nContent-Type: image/jpeg') + "--b--\r\n"
    small = 'Content-Type: application/json\r\n'
    get = f"GET /x/1?object=caf%C3%A9&limit=3 HTTP/1.1\r\n{HOST}\r\n"
    return encoded({
        "get": get,
        "three": get + get + f"HEAD /x/2 HTTP/1.1\r\n{HOST}Connection: close\r\n\r\n",
        "json": with_length("POST /x", '{"limit": 3, "metadata": {"a": 1}}', small),
        "json_chunks": chunked("POST /x", '8\r\n{"limit"\r\n4\r\n: 3}\r\n0\r\n\r\n', small) + get,
        "form": with_length("POST /form", form, FORM),
        "form_chunks": chunked("POST /form", f"{len(form):x}\r\n{form}\r\n0\r\n\r\n", FORM),
        "pair": with_length("PUT /form", part("image", "a") * 3 + form, FORM) + get,
        "cut_form": with_length("POST /form", form[:-9], FORM),
        "quoted": with_length("POST /form", form, FORM.replace("=b", '="b"')),
        "no_boundary": with_length("POST /form", form, "Content-Type: multipart/form-data\r\n"),
        "long_boundary": with_length("POST /form", form, FORM.replace("=b", "=" + "b" * 300)),
        "plain": with_length("POST /form", "image", "Content-Type: image/png\r\n"),
        "expect": with_length("POST /form", "image", "Content-Type: image/png\r\nExpect: 100-continue\r\n"),
        "late_body": with_length("POST /form", "image", "Content-Type: image/png\r\n")[:-3],
        "two_requests": with_length("POST /x", get, small) + get,
        "smuggled": f"POST /x HTTP/1.1\r\n{HOST}Content-Length: 4\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n" + get,
        "no_host": "GET /x/1 HTTP/1.1\r\n\r\n",
        "other_host": "GET /x/1 HTTP/1.1\r\nHost: evil.example\r\n\r\n",
        "old": "GET /x/1 HTTP/1.0\r\n\r\n",
        "range": f"GET /x/1 HTTP/1.1\r\n{HOST}Range: bytes=0-1,3-,-5\r\nAccept-Encoding: gzip\r\n\r\n",
        "preflight": f"OPTIONS /x HTTP/1.1\r\n{HOST}Origin: https://shop.example\r\n"
                     "Access-Control-Request-Method: POST\r\n\r\n",
        "cross_site": f"DELETE /x/1 HTTP/1.1\r\n{HOST}Origin: https://evil.example\r\nSec-Fetch-Site: cross-site\r\n\r\n",
        "delete": with_length("DELETE /x/1", "body"),
        "many_fields": f"GET /x/1 HTTP/1.1\r\n{HOST}" + "A: b\r\n" * 120 + "\r\n",
        "long_head": f"GET /x/1 HTTP/1.1\r\n{HOST}A: {'b' * 2100}\r\n\r\n",
        "long_path": f"GET /x/{'%41' * 690} HTTP/1.1\r\n{HOST}\r\n",
        "large_body": f"POST /form HTTP/1.1\r\n{HOST}Content-Type: image/png\r\nContent-Length: 9000\r\n\r\n",
        "large_chunks": chunked("POST /form", "1fff\r\n", "Content-Type: image/png\r\n"),
        "tls": b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(50),
        "pri": "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
        "connect": f"CONNECT a:1 HTTP/1.1\r\n{HOST}\r\n",
        "absolute": f"GET http://127.0.0.1/x/1 HTTP/1.1\r\n{HOST}\r\n",
        "empty_lines": "\r\n\r\n" + get,
        "base": f"GET /base HTTP/1.1\r\n{HOST}\r\nGET /base/x/1 HTTP/1.1\r\n{HOST}\r\n",
        "forwarded": f"GET /x/1 HTTP/1.1\r\n{HOST}X-Forwarded-For: 1.2.3.4, [::1]:80\r\nX-Forwarded-Proto: https\r\n"
                     "X-Forwarded-Host: 127.0.0.1\r\nX-Forwarded-Prefix: /p/\r\n\r\n",
        "forwarded_rfc": f"GET /x/1 HTTP/1.1\r\n{HOST}Forwarded: for=\"[2001:db8::1]\";proto=https;host=evil.example, for=_x\r\n\r\n",
        "no_type": with_length("POST /form", "P5"), "json_no_type": with_length("POST /form", '{"limit": 3}'),
        "percent": f"GET /x/%zz?object=%&limit=%4 HTTP/1.1\r\n{HOST}\r\n",
    })


def received():
    """Conversations for the limits of the target (512 bytes of head), split in the middle."""
    keep = ("get", "three", "json", "json_chunks", "form_chunks", "late_body", "two_requests", "smuggled", "tls",
            "empty_lines", "large_body", "large_chunks")
    made = {name: data for name, data in conversations().items() if name in keep}
    made["long_head"] = f"GET /{'a' * 600} HTTP/1.1\r\n{HOST}\r\n".encode()
    made["line_feeds"] = b"GET / HTTP/1.1\nHost: a\n\n"
    return {name: (len(data) // 2).to_bytes(2, "big") + data for name, data in made.items()}


def parameters():
    return encoded({
        "query": "?whole=5\n?number=0.25\n?region=1,2,3.5,4\n?rank=b\n?on=true\n?filter={\"a\": 1}\n?items=[1,{}]\n?object=mug",
        "form": "a.jpg image=bytes\n whole=-5\n object=caf\u00e9\n../../b.jpg image=more",
        "json": '?rank=a\n\n{"whole": 7, "number": 1e-3, "region": [1, 2, 3, 4], "filter": {"a": {}}, "items": [], "on": false}',
        "cursor": "?cursor=WyJsaXN0IiwiYSJd", "other_cursor": "?cursor=WyJvdGhlciIsImEiXQ", "bad_cursor": "?cursor=!",
        "unknown": "?color=red", "twice": "?whole=1\n whole=2", "too_large": "?whole=1001",
        "too_long": "?whole=99999999999999999999", "hex": "?number=0x1p-3", "nan": "?number=nan", "infinite": "?region=1,2,3,inf",
        "bad_utf8": b"?object=\xff\xfe", "null": '\n{"object": null, "whole": "3"}', "deep": "\n" + '{"filter":' * 40,
        "etag": ':If-None-Match=W/"1", "0123"\n?whole=1', "any": ":If-None-Match=*",
        "control": "a\rb.jpg image=x",
        "images": 'a.jpg image=x\n second={"image_url": "http://a.example/b.png"}',
        "image_json": '\n{"second": {"image": "AAAA", "image_url": null}, "image": "AAAA"}',
        "image_both": '\n{"second": {"image": "AAAA", "image_url": "x"}}', "image_none": "?second={}",
    })


def forms():
    """The Content-Type, and the body behind the first line."""
    kind = "multipart/form-data; boundary=b"
    image = part("image", "P5", '; filename="a.jpg"\r\nContent-Type: image/jpeg')
    return encoded({
        "two": f"{kind}\n{part('object', 'mug')}{image}--b--\r\n", "quoted": f'x;BOUNDARY="b";charset=utf-8\n{image}--b--',
        "dotnet": f"{kind}\n--b\r\nContent-Type: a/b\r\nContent-Disposition: form-data; name=image; filename=a; "
                  "filename*=utf-8''%C3%A9\r\n\r\nx\r\n--b--\r\n",
        "folded": f"{kind}\npreamble\r\n--b \t\r\ncontent-disposition: form-data;\r\n name=\"a\\\"b\\\\\"\r\n\r\n\r\n--b-- \r\nepilogue",
        "cut": f"{kind}\n{image}"[:-4], "no_name": f"{kind}\n--b\r\nX: y\r\n\r\nx\r\n--b--", "five": f"{kind}\n{image * 5}--b--",
        "base64": f"{kind}\n--b\r\nContent-Disposition: form-data; name=image\r\nContent-Transfer-Encoding: base64\r\n\r\nAA\r\n--b--",
        "line_feeds": f"{kind}\n{image}--b--".replace("\r", ""), "query": "a=1&b=%41%zz+x&&c&=d%4\n",
    })


def hosts():
    names = ("127.0.0.1", "127.0.0.1:8080", "[::1]:80", "[::ffff:1.2.3.4]", "localhost.", "SHOP.example:443", "x", "evil.example",
             "[::1", "1.2.3.4.5", "127.0.0.1:", "::1", "", ":80", "shop.example:80:80", "127.1")
    made = {f"{i:02}": name for i, name in enumerate(names)}
    made["zero"] = b"127.0.0.1\0.evil.example"
    return encoded(made)


def paths():
    return encoded({"x": "/x", "id": "/x/blue%20mug", "deep": "/x/1/y/%C3%BC", "slash": "/x/a%2Fb", "empty": "/x/", "double": "//x",
                    "cut": "/x/%4", "bad": "/x/%zz", "not_utf8": "/x/%ff", "no_slash": "x", "nothing": "", "zero": "/x/%00",
                    "dots": "/../x/..", "query": "/x?a=b"})


def addresses():
    """An address and where it redirects to."""
    return encoded({
        "plain": "https://images.example.org/a/b.jpg?token=secret#part\nc.jpg",
        "port": "http://a.example:8080\n//b.example:81/x", "upper": "HTTP://A.Example/\n/",
        "number": "http://2130706433/\nhttp://0x7f.1/", "v6": "http://[::ffff:7f00:1]:80/\nhttp://[2001:DB8:0:0::1]/",
        "zone": "http://[fe80::1%25eth0]/\n?x", "user": "http://u:p@a.example/\n//u@b.example/",
        "wide": "http://m\u00fctze.example/\nm\u00fctze", "escaped": "http://a%2eexample%00/%2f%zz\n%0d%0a",
        "backslash": "http://a.example\\@b.example/\n\\\\b.example\\x", "scheme": "file:///etc/passwd\ngopher://a/",
        "slashes": "http:///a.example//\n///b.example", "nothing": "\n", "dots": "http://a..example./../../x\n../../..",
        "long": "http://a.example/" + "\u00fc" * 700 + "\n" + "x" * 3000})


SEEDS = {"request_head": heads, "chunked_body": chunks, "http_server": conversations, "request_reader": received,
         "parameters": parameters, "allowed_hosts": hosts, "path": paths, "web_address": addresses,
         "form": forms}
