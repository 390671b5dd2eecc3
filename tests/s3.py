"""An S3 server on loopback, in a process of its own: what obstore asks of one, with writes on conditions.

Buckets need not be made. Objects are files of one folder, so that a killed server can be started again with all that
it acknowledged. `If-None-Match: *` and `If-Match` are decided under one lock: of many who create a key one wins.
Signatures are not checked. Requests are counted, and the server can be told to misbehave:

    with S3Server.started(folder) as s3:
        store = ModelStore.open(s3.url("bucket"))  # in processes that have s3.environment
        s3.counts()  # {"GET": 3, "LIST": 1}
        s3.behave("hang")  # takes requests and never answers; "trickle": a byte a second; "ok" again
        s3.freeze(), s3.thaw()  # SIGSTOP: the kernel takes connections, nobody reads them

`python -m tests.s3 FOLDER [PORT]` runs one by hand.
"""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from email.utils import formatdate
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import parse_qs, quote, unquote, urlsplit
from urllib.request import ProxyHandler, build_opener
from xml.etree import ElementTree  # what is parsed comes from our own tests
from xml.sax.saxutils import escape

_CONTROL = "/-/"
_PAGE = 1000
_START_S = 30.0
_open = build_opener(ProxyHandler({})).open  # loopback, whatever proxy the environment names


@dataclass(frozen=True, slots=True)
class _Object:
    file: Path
    etag: str
    size: int
    changed: float


class _Objects:
    """Objects by "bucket/key"; each is one file, whose name is the quoted key."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._lock = threading.Lock()
        self._numbers = 0
        self._known: dict[str, _Object] = {}
        for file in folder.iterdir():
            if not file.name.startswith("."):
                self._known[unquote(file.name)] = _described(file)

    def get(self, key: str) -> tuple[_Object, bytes] | None:
        with self._lock:
            known = self._known.get(key)
            return (known, known.file.read_bytes()) if known else None

    def put(self, key: str, data: bytes, if_match: str | None, only_new: bool) -> _Object | None:
        """The new object; None, and nothing changed, when the condition does not hold."""
        with self._lock:
            known = self._known.get(key)
            if (only_new and known) or (if_match and (known is None or known.etag != if_match)):
                return None
            file = self._folder / quote(key, safe="")
            self._numbers += 1
            staged = self._folder / f".{self._numbers}"
            staged.write_bytes(data)
            staged.replace(file)
            self._known[key] = made = _described(file)
            return made

    def remove(self, key: str) -> None:
        with self._lock:
            if known := self._known.pop(key, None):
                known.file.unlink()

    def under(self, prefix: str) -> list[tuple[str, _Object]]:
        with self._lock:
            return sorted((key, each) for key, each in self._known.items() if key.startswith(prefix))


def _described(file: Path) -> _Object:
    data = file.read_bytes()
    return _Object(file, f'"{hashlib.md5(data).hexdigest()}"', len(data), file.stat().st_mtime)  # as S3 does


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    request_queue_size = 256

    def __init__(self, folder: Path, port: int) -> None:
        super().__init__(("127.0.0.1", port), _Requests)
        self.objects = _Objects(folder)
        self.counts: Counter[str] = Counter()
        self.behaviour = "ok"

    def handle_error(self, *_: object) -> None:
        """Nothing: clients that give up and go away are what some tests are about."""


class _Requests(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True
    wbufsize = -1  # head and body in one piece
    server: _Server

    def do_GET(self) -> None:
        if self.path.startswith(_CONTROL):
            self._control(self.path.removeprefix(_CONTROL))
            return
        bucket, key, asked = self._place()
        if not key:
            self._count("LIST")
            self._list(bucket, {name: values[0] for name, values in asked.items()})
            return
        self._count(self.command)
        found = self.server.objects.get(f"{bucket}/{key}")
        if found is None:
            self._fail(404, "NoSuchKey")
            return
        known, data = found
        if self.headers.get("If-None-Match") == known.etag:
            self._answer(304, headers={"ETag": known.etag})
            return
        headers = {"ETag": known.etag, "Last-Modified": formatdate(known.changed, usegmt=True)}
        status, asked_range = 200, self.headers.get("Range", "")
        if asked_range.startswith("bytes=") and data:
            first, _, last = asked_range.removeprefix("bytes=").partition("-")
            start = int(first) if first else max(0, len(data) - int(last))
            end = min(int(last) if first and last else len(data) - 1, len(data) - 1)
            headers["Content-Range"] = f"bytes {start}-{end}/{len(data)}"
            status, data = 206, data[start : end + 1]
        self._answer(status, data, "application/octet-stream", headers)

    do_HEAD = do_GET  # noqa: N815 # the name that http.server looks for

    def do_PUT(self) -> None:
        bucket, key, asked = self._place()
        data = self._body()
        self._count("PUT")
        if asked or "x-amz-copy-source" in self.headers:
            self._fail(501, "NotImplemented")  # parts and copies: nobody here asks for them
            return
        only_new = self.headers.get("If-None-Match") == "*"
        made = self.server.objects.put(f"{bucket}/{key}", data, self.headers.get("If-Match"), only_new)
        if made is None:
            self._fail(412, "PreconditionFailed")
        else:
            self._answer(200, headers={"ETag": made.etag})

    def do_DELETE(self) -> None:
        bucket, key, _ = self._place()
        self._count("DELETE")
        self.server.objects.remove(f"{bucket}/{key}")
        self._answer(204)

    def do_POST(self) -> None:
        bucket, _, asked = self._place()
        data = self._body()
        self._count("POST")
        if "delete" not in asked:
            self._fail(501, "NotImplemented")
            return
        deleted = [each.text or "" for each in ElementTree.fromstring(data).iter() if each.tag.endswith("Key")]
        for key in deleted:
            self.server.objects.remove(f"{bucket}/{key}")
        rows = "".join(f"<Deleted><Key>{escape(key)}</Key></Deleted>" for key in deleted)
        self._xml(f"<DeleteResult>{rows}</DeleteResult>")

    def _list(self, bucket: str, asked: dict[str, str]) -> None:
        prefix, delimiter, after = asked.get("prefix", ""), asked.get("delimiter"), asked.get("continuation-token", "")
        after = max(after, asked.get("start-after", ""))
        rows: dict[str, str] = {}
        folders: set[str] = set()
        more = ""
        for place, known in self.server.objects.under(f"{bucket}/{prefix}"):
            key = place.removeprefix(f"{bucket}/")
            if key <= after:
                continue
            if len(rows) == min(_PAGE, int(asked.get("max-keys", _PAGE))):
                more = max(rows)
                break
            rest = key.removeprefix(prefix)
            if delimiter and delimiter in rest:
                folders.add(prefix + rest.partition(delimiter)[0] + delimiter)
                continue
            changed = time.strftime("%Y-%m-%dT%H:%M:%S.000Z", time.gmtime(known.changed))
            rows[key] = (
                f"<Contents><Key>{escape(key)}</Key><LastModified>{changed}</LastModified>"
                f"<ETag>{escape(known.etag)}</ETag><Size>{known.size}</Size></Contents>"
            )
        token = f"<NextContinuationToken>{escape(more)}</NextContinuationToken>" if more else ""
        common = "".join(
            f"<CommonPrefixes><Prefix>{escape(each)}</Prefix></CommonPrefixes>" for each in sorted(folders)
        )
        self._xml(
            f"<ListBucketResult><Name>{bucket}</Name><Prefix>{escape(prefix)}</Prefix><KeyCount>{len(rows)}</KeyCount>"
            f"<IsTruncated>{'true' if more else 'false'}</IsTruncated>{token}{''.join(rows.values())}{common}"
            "</ListBucketResult>"
        )

    def _place(self) -> tuple[str, str, dict[str, list[str]]]:
        parts = urlsplit(self.path)
        bucket, _, key = unquote(parts.path).removeprefix("/").partition("/")
        return bucket, key, parse_qs(parts.query, keep_blank_values=True)

    def _body(self) -> bytes:
        return self.rfile.read(int(self.headers.get("Content-Length", 0)))

    def _count(self, kind: str) -> None:
        self.server.counts[kind] += 1
        while self.server.behaviour == "hang":
            time.sleep(0.05)

    def _control(self, what: str) -> None:
        if what != "counts":
            self.server.behaviour = what
        self._answer(200, json.dumps(self.server.counts).encode(), "application/json")

    def _xml(self, text: str) -> None:
        self._answer(200, f'<?xml version="1.0" encoding="UTF-8"?>{text}'.encode(), "application/xml")

    def _fail(self, status: int, code: str) -> None:
        self._answer(status, f"<Error><Code>{code}</Code><Message>{code}</Message></Error>".encode(), "application/xml")

    def _answer(self, status: int, data: bytes = b"", kind: str = "", headers: dict[str, str] | None = None) -> None:
        self.send_response(status)
        for name, value in (headers or {}).items():
            self.send_header(name, value)
        if kind:
            self.send_header("Content-Type", kind)
        if status not in (204, 304):
            self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        if self.command == "HEAD":
            return
        while data and self.server.behaviour == "trickle" and not self.path.startswith(_CONTROL):
            self.wfile.flush()
            time.sleep(1)
            self.wfile.write(data[:1])
            data = data[1:]
        self.wfile.write(data)

    def log_message(self, *_: object) -> None:
        """Nothing: tests count instead."""


@dataclass(slots=True)
class S3Server:
    """A started server. `environment` is what processes need beside the URL of the store."""

    folder: Path
    port: int
    process: subprocess.Popen[bytes]

    @classmethod
    @contextmanager
    def started(cls, folder: Path, port: int = 0) -> Iterator[S3Server]:
        folder.mkdir(parents=True, exist_ok=True)
        process, port = _start(folder, port)
        server = cls(folder, port, process)
        try:
            yield server
        finally:
            server.kill()

    @property
    def endpoint(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def url(self, bucket: str = "rover") -> str:
        return f"s3://{bucket}/store"

    @property
    def environment(self) -> dict[str, str]:
        return {
            "AWS_ENDPOINT_URL": self.endpoint,
            "AWS_ALLOW_HTTP": "true",
            "AWS_ACCESS_KEY_ID": "tests",
            "AWS_SECRET_ACCESS_KEY": "of-tests",
            "AWS_REGION": "us-east-1",
            "NO_PROXY": "127.0.0.1",
        }

    def counts(self) -> Counter[str]:
        """Requests since the start, by kind; those of this class are not among them."""
        return self._control("counts")

    def behave(self, how: str) -> None:
        """`hang`, `trickle` or `ok`."""
        self._control(how)

    def freeze(self) -> None:
        self.process.send_signal(signal.SIGSTOP)

    def thaw(self) -> None:
        self.process.send_signal(signal.SIGCONT)

    @contextmanager
    def misbehaving(self, how: str) -> Iterator[None]:
        """For as long as the block lasts: frozen, or what `behave` takes."""
        if how == "frozen":
            self.freeze()
        else:
            self.behave(how)
        try:
            yield
        finally:
            self.thaw()
            self.behave("ok")

    def kill(self) -> None:
        self.process.kill()
        self.process.wait(timeout=10)
        if self.process.stdout:
            self.process.stdout.close()

    def restart(self) -> None:
        """On the same port, with all that it had acknowledged."""
        self.kill()
        self.process, self.port = _start(self.folder, self.port)

    def _control(self, what: str) -> Counter[str]:
        with _open(f"{self.endpoint}{_CONTROL}{what}", timeout=10) as answer:
            return Counter(json.load(answer))


def _start(folder: Path, port: int) -> tuple[subprocess.Popen[bytes], int]:
    root = Path(__file__).parents[1]
    command = [sys.executable, "-m", "tests.s3", str(folder), str(port)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, cwd=root, env=os.environ | {"PYTHONPATH": str(root)})
    timer = threading.Timer(_START_S, process.kill)
    timer.start()
    try:
        assert process.stdout
        return process, int(process.stdout.readline())
    except ValueError:
        raise AssertionError("the S3 server does not start") from None
    finally:
        timer.cancel()


def main() -> None:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    server = _Server(folder, int(sys.argv[2]) if len(sys.argv) > 2 else 0)
    print(server.server_address[1], flush=True)
    with suppress(KeyboardInterrupt):
        server.serve_forever()


if __name__ == "__main__":
    main()
