"""Files that answers are saved to: whole or not at all, and never in place of what is no file."""

from __future__ import annotations

import os
import stat
import threading
import time
from pathlib import Path
from typing import Any, cast

import pytest

from rover_twin_client.saving import whole_file

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes with a name")


def save(path: Path, content: bytes = b"new") -> None:
    with whole_file(path, {}) as take:
        take(content)


def test_a_link_stays_one_and_the_file_behind_it_is_replaced(tmp_path: Path) -> None:
    folder = tmp_path / "behind"
    folder.mkdir()
    for name in ("older.csv", "not-yet.csv"):
        target, link = folder / name, tmp_path / name
        link.symlink_to(target)
        save(link)
        assert link.is_symlink()
        assert target.read_bytes() == b"new"
    assert sorted(path.name for path in folder.iterdir()) == ["not-yet.csv", "older.csv"]


def test_an_older_file_keeps_its_mode_and_its_content_where_saving_fails(tmp_path: Path) -> None:
    path = tmp_path / "private.csv"
    path.write_bytes(b"old")
    path.chmod(0o600)

    with pytest.raises(TypeError), whole_file(path, {}) as take:
        take(cast("bytes", "no bytes"))
    assert path.read_bytes() == b"old"
    save(path)

    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert path.read_bytes() == b"new"
    save(tmp_path / "fresh.csv")
    assert stat.S_IMODE((tmp_path / "fresh.csv").stat().st_mode) == 0o644


@pytest.mark.timeout(30)
def test_a_pipe_is_written_into_once_the_whole_is_there(tmp_path: Path) -> None:
    pipe, link = tmp_path / "pipe.csv", tmp_path / "link.csv"
    os.mkfifo(pipe)
    link.symlink_to(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)  # there before the writer, as a shell has it
    try:
        with pytest.raises(TypeError), whole_file(link, {}) as take:
            take(cast("bytes", "no bytes"))
        save(link)
        assert os.read(reader, 100) == b"new"
    finally:
        os.close(reader)

    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert link.is_symlink()


@pytest.mark.timeout(30)
def test_a_pipe_takes_more_than_it_holds(tmp_path: Path) -> None:
    pipe, content, read = tmp_path / "pipe.csv", os.urandom(1 << 20), list[bytes]()
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()), daemon=True)
    reader.start()
    for _ in range(100):
        try:
            save(pipe, content)
        except OSError:  # the reader is not there yet
            time.sleep(0.1)
        else:
            break
    reader.join(timeout=20)

    assert read == [content]


@pytest.mark.timeout(30)
def test_a_pipe_without_a_reader_is_refused_at_once(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)

    with pytest.raises(OSError, match=r"nobody reads from this pipe: .*pipe\.csv"):
        save(pipe)
    assert list(tmp_path.iterdir()) == [pipe]


def test_a_place_that_cannot_be_written_is_named_as_the_caller_knows_it(tmp_path: Path) -> None:
    (tmp_path / "folder.csv").mkdir()
    places: dict[Any, str] = {FileNotFoundError: "nofolder/x.csv", IsADirectoryError: "folder.csv"}

    for kind, name in places.items():
        with pytest.raises(kind) as caught:
            save(tmp_path / name)
        assert caught.value.filename == str(tmp_path / name)
    save(tmp_path / ("n" * 251 + ".csv"))
