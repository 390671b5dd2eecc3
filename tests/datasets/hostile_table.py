"""Bad uploads and the answer that each one got from a real service, as a table.

    python -m tests.datasets.hostile_table

Every file of `hostile_files` is posted as a form, as curl does, and then what is wrong with the request itself. None
may be stored, none may leave anything in the service's temporary folder, and predictions' liveness is asked for after
each: exit code 1 otherwise.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx

from tests.api.conftest import ADMIN, TOKEN, Running, serving
from tests.datasets.hostile_files import HOSTILE_FILES, SCENARIO, HostileFile, long_csv, text

DATASETS = "/v1/admin/datasets"
MOST_BYTES = 32 << 20
_LONGEST_REASON = 150


@dataclass(frozen=True)
class BadRequest:
    """What is wrong is how it is sent. `status` is what must come back."""

    name: str
    send: Callable[[httpx.Client], httpx.Response]
    status: int


def _form(**fields: str | list[str]) -> Callable[[httpx.Client], httpx.Response]:
    return lambda client: client.post(DATASETS, files={"file": ("run.csv", text())}, data=fields)


def _raw(content: bytes, kind: str) -> Callable[[httpx.Client], httpx.Response]:
    return lambda client: client.post(DATASETS, content=content, headers={"Content-Type": kind})


def _part(name: str, data: str, *, end: str = "--cut--") -> bytes:
    return f'--cut\r\nContent-Disposition: form-data; name="{name}"\r\n\r\n{data}\r\n{end}\r\n'.encode()


def _one_of_two_bad() -> bytes:
    bad = long_csv(run=["two"] * 41, rear_y_m=["nan"] * 41)
    return long_csv() + b"\n" + bad.partition(b"\n")[2]


_TOLD = {name: str(value) for name, value in SCENARIO.items()}
_MULTIPART = "multipart/form-data; boundary=cut"
BAD_REQUESTS = (
    BadRequest("no body", _raw(b"", "application/octet-stream"), 422),
    BadRequest("larger than allowed", lambda client: client.post(DATASETS, content=bytes(MOST_BYTES + 1)), 413),
    BadRequest("form without boundary", _raw(b"x", "multipart/form-data"), 400),
    BadRequest("form without a file", _raw(_part("name", "x"), _MULTIPART), 422),
    BadRequest("form that ends early", _raw(_part("file", "x", end=""), _MULTIPART), 400),
    BadRequest("two files", _raw(_part("file", "1", end="") + _part("file", "2"), _MULTIPART), 422),
    BadRequest("field that there is not", _form(**_TOLD, colour="red"), 422),
    BadRequest("one field twice", _form(**{**_TOLD, "slope_deg": ["20", "21"]}), 422),
    BadRequest("slope that is no number", _form(**_TOLD | {"slope_deg": "steep"}), 422),
    BadRequest("slope that is NaN", _form(**_TOLD | {"slope_deg": "nan"}), 422),
    BadRequest("negative mass", _form(**_TOLD | {"mass_kg": "-430"}), 422),
    BadRequest("column map of no preset", _form(**_TOLD, column_map="nope"), 422),
    BadRequest("column map that is cut off", _form(**_TOLD, column_map='{"time_s": 0'), 422),
    BadRequest("column map of unknown columns", _form(**_TOLD, column_map='{"depth_m": 0}'), 422),
    BadRequest("passport that is no object", _form(**_TOLD, passport="[1]"), 422),
    BadRequest("name that is a path", _form(**_TOLD, name="../x"), 422),
    BadRequest("strict, one run of two is bad", lambda client: client.post(
        DATASETS, files={"file": ("long.csv", _one_of_two_bad())},
        data={"strict": "true"}), 422),
    BadRequest("without token",
               lambda client: client.post(DATASETS, content=text(), headers={"Authorization": ""}), 401),
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """One line of the table; `wrong` says what should not have been."""

    name: str
    sent: str
    status: int
    answer: str
    reason: str
    seconds: float
    wrong: str

    def markdown(self) -> str:
        cells = (self.name, self.sent, f"{self.status}", self.answer, self.reason, f"{self.seconds:.2f}", self.wrong)
        return "| " + " | ".join(each.replace("|", "\\|") for each in cells) + " |"


HEAD = "| upload | bytes | status | answer | reason given | s | wrong |\n|---|---|---|---|---|---|---|"


def rows(files: Sequence[HostileFile], requests: Sequence[BadRequest]) -> Iterator[Row]:
    """Send each to a service of its own kind, and look at what came of it."""
    settings = {"admin_token": TOKEN, "start_worker": False, "max_upload_bytes": MOST_BYTES}
    with (
        tempfile.TemporaryDirectory(prefix="hostile-") as folder,
        _temporary(Path(folder) / "temporary") as temporary,
        serving(Path(folder) / "store", **settings) as run,
    ):
        run.client.headers.update(ADMIN)
        for each in files:
            data = each.build()
            yield _row(run, temporary, each.name, f"{len(data):,}", _poster(each, data), (422, each.code))
        for request in requests:
            yield _row(run, temporary, request.name, "", request.send, (request.status, None))


def _poster(hostile: HostileFile, data: bytes) -> Callable[[httpx.Client], httpx.Response]:
    fields = {
        name: json.dumps(value) if isinstance(value, dict) else str(value) for name, value in hostile.form.items()
    }
    return lambda client: client.post(DATASETS, files={"file": (hostile.filename, data)}, data=fields, timeout=120)


def _row(
    run: Running,
    temporary: Path,
    name: str,
    sent: str,
    send: Callable[[httpx.Client], httpx.Response],
    wanted: tuple[int, str | None],
) -> Row:
    began = time.monotonic()
    answer = send(run.client)
    seconds = time.monotonic() - began
    problem = answer.json()
    found = [each for each in problem.get("report", {}).get("findings", []) if each["severity"] == "reject"]
    wrong = [f"status {wanted[0]} was due"] * (answer.status_code != wanted[0])
    wrong += [f"reason {wanted[1]} was due"] * (wanted[1] not in {None, *(each["code"] for each in found)})
    wrong += ["stored"] * bool(run.store.dataset_ids())
    wrong += ["left over"] * any(temporary.iterdir())
    wrong += ["dead"] * (run.get("/health/live").status_code != 200)
    kind = problem["type"].rpartition(":")[2]
    return Row(name, sent, answer.status_code, kind, _reason(problem, found, wanted[1]), seconds, ", ".join(wrong))


def _reason(problem: dict, found: list[dict], code: str | None) -> str:
    first = next((each for each in found if each["code"] == code), found[0] if found else None)
    if first is None:
        said = problem["detail"]
    else:
        place = "".join(f", {word} {first[word]}" for word in ("row", "column") if first[word] is not None)
        said = f"{first['code']}: {first['file']}{place}: {first['message']}"
    return said if len(said) <= _LONGEST_REASON else f"{said[:_LONGEST_REASON]}..."


@contextmanager
def _temporary(folder: Path) -> Iterator[Path]:
    """The only place for temporary files meanwhile."""
    folder.mkdir()
    before, tempfile.tempdir = tempfile.tempdir, str(folder)
    try:
        yield folder
    finally:
        tempfile.tempdir = before


def main() -> int:
    """Print the table; exit code 1 when any answer is not the one that was due."""
    print(HEAD)
    made = []
    for row in rows(HOSTILE_FILES, BAD_REQUESTS):
        print(row.markdown(), flush=True)
        made.append(row)
    wrong = sum(bool(row.wrong) for row in made)
    slowest = max(row.seconds for row in made)
    print(f"\n{len(made)} bad uploads, {wrong} with another answer than was due, {slowest:.1f} s at most")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
