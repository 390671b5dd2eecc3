"""Tokens by name: the file says who they are, strictly; a change is seen, and a broken file changes nothing."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.access import tokens as tokens_module
from service.access.token_file import MOST_TOKENS, StoredToken, TokenFileError, add, parse, remove, stored
from service.access.tokens import Identity, Scope, Tokens, digest_of, new_token

AS_NOBODY = """
import os, pathlib, sys
from service.access.token_file import StoredToken, TokenFileError, add, remove
os.setgroups([]); os.setgid(65534); os.setuid(65534)
path = pathlib.Path(sys.argv[1])
try:
    add(path, StoredToken("eve", "read", b"x" * 32)) if sys.argv[2] == "add" else remove(path, "ada")
except TokenFileError as error:
    print(error)
"""
HASH = "0123456789abcdef" * 4
NAMES = st.from_regex(r"\A[A-Za-z0-9][A-Za-z0-9._@+-]{0,62}\Z").filter(lambda name: name != "admin")


def holder(known, token):
    """After a look."""
    known.look()
    return known.holder(token)


@pytest.fixture
def file(tmp_path):
    return tmp_path / "tokens"


def made(file, name, scope="read"):
    token = new_token()
    add(file, StoredToken(name, scope, digest_of(token.encode())))
    return token.encode()


@given(st.lists(st.tuples(NAMES, st.sampled_from(["read", "admin"]), st.binary(min_size=32, max_size=32)), max_size=5))
def test_what_is_written_is_read(rows):
    unique = {name: StoredToken(name, scope, digest) for name, scope, digest in rows}
    if len({each.digest for each in unique.values()}) < len(unique):
        return
    text = "".join(f"{each.name} {each.scope} sha256:{each.digest.hex()}\n" for each in unique.values())

    assert parse(f"# a comment\n\n{text}".encode()) == list(unique.values())
    assert parse(text.replace("\n", "\r\n").encode()) == list(unique.values())


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (f"ada read md5:{HASH}", "sha256"),
        (f"ada read sha256:{HASH[:-1]}", "sha256"),
        (f"ada read sha256:{HASH.upper()}", "sha256"),
        ("ada read rt_a_token_in_plain_text_that_must_not_be_printed", "sha256"),
        (f"ada write sha256:{HASH}", "scope"),
        (f"ada  read sha256:{HASH}", "fields"),
        (f" ada read sha256:{HASH}", "fields"),
        (f"ada read sha256:{HASH} ", "fields"),
        (f"ada\tread\tsha256:{HASH}", "fields"),
        (f"admin admin sha256:{HASH}", "name"),
        (f"-ada read sha256:{HASH}", "name"),
        (f"a/da read sha256:{HASH}", "name"),
        (f"{'a' * 64} read sha256:{HASH}", "name"),
        ("ada", "fields"),
        (f"j\u00e4ne read sha256:{HASH}", "ASCII"),
        (f"ada read sha256:{HASH}\0", "sha256"),
    ],
)
def test_a_line_that_is_not_understood_is_named_and_not_shown(line, reason):
    good = f"joe read sha256:{'f' * 64}\n"

    with pytest.raises(TokenFileError, match="line 3 ") as caught:
        parse(f"# mine\n{good}{line}\n".encode())
    assert reason in str(caught.value)
    assert HASH[:16] not in str(caught.value)
    assert "plain_text" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (f"ada read sha256:{HASH}\nada admin sha256:{'f' * 64}\n", "second time"),
        (f"ada read sha256:{HASH}\njoe admin sha256:{HASH}\n", "another name"),
        ("#" * (300 << 10), "bytes"),
        ("".join(f"n{i} read sha256:{i:064x}\n" for i in range(MOST_TOKENS + 1)), "tokens"),
    ],
)
def test_a_file_as_a_whole_has_rules_too(content, reason):
    with pytest.raises(TokenFileError, match=reason):
        parse(content.encode())


def test_a_token_is_random_and_only_its_hash_is_kept(file):
    token = made(file, "ada", "admin")

    assert len(token) >= 43
    assert token != made(file, "joe")
    assert token not in file.read_bytes()
    assert file.stat().st_mode & 0o777 == 0o600
    assert Tokens(path=file).holder(token) == Identity("ada", Scope.ADMIN)


def test_other_tokens_hold_nothing(file):
    token = made(file, "ada")
    known = Tokens("the token of the environment", file)

    assert known.holder(b"the token of the environment") == Identity("admin", Scope.ADMIN)
    for wrong in (b"", token[:-1], token + b"x", token.upper(), digest_of(token), digest_of(token).hex().encode()):
        assert known.holder(wrong) is None


def test_a_scope_covers_itself_and_less():
    assert [a.covers(b) for a in Scope for b in Scope] == [True, False, True, True]


def test_a_change_is_seen_and_a_revoked_token_holds_nothing(file):
    ada = made(file, "ada")
    known = Tokens(path=file)

    joe = made(file, "joe", "admin")
    assert holder(known, joe) == Identity("joe", Scope.ADMIN)
    assert remove(file, "ada")
    assert holder(known, ada) is None
    assert holder(known, joe) is not None
    file.write_text("")
    assert holder(known, joe) is None
    assert not remove(file, "ada")


@pytest.mark.parametrize("damage", ["a line", "gone", "a folder", "not text"])
def test_a_broken_file_keeps_what_was_and_heals(file, damage):
    ada = made(file, "ada")
    known = Tokens(path=file)
    good = file.read_bytes()

    if damage == "a line":
        file.write_bytes(good + b"joe\n")
    elif damage == "not text":
        file.write_bytes(b"\xff\xfe")
    else:
        file.unlink()
    if damage == "a folder":
        file.mkdir()
    assert holder(known, ada) is not None
    assert known.problem is not None
    assert not re.search("[0-9a-f]{8}", known.problem)

    if damage == "a folder":
        file.rmdir()
    file.write_bytes(good.replace(b"ada", b"eve"))
    assert holder(known, ada) == Identity("eve", Scope.READ)
    assert known.problem is None


def test_a_broken_file_stops_the_start(file):
    with pytest.raises(TokenFileError, match="cannot be read"):
        Tokens(path=file)
    file.write_text("ada read\n")
    with pytest.raises(TokenFileError, match="line 1"):
        Tokens(path=file)


def test_a_secret_of_kubernetes_is_followed_when_its_link_is_swapped(tmp_path):
    for number in (1, 2):
        (tmp_path / f"..{number}").mkdir()
    ada, joe = made(tmp_path / "..1" / "tokens", "ada"), made(tmp_path / "..2" / "tokens", "joe")
    (tmp_path / "..data").symlink_to("..1")
    (tmp_path / "tokens").symlink_to("..data/tokens")
    known = Tokens(path=tmp_path / "tokens")
    assert holder(known, ada)

    (tmp_path / "next").symlink_to("..2")
    (tmp_path / "next").replace(tmp_path / "..data")

    assert (holder(known, ada), holder(known, joe)) == (None, Identity("joe", Scope.READ))


def test_a_change_that_keeps_size_and_inode_is_seen(file):
    ada = made(file, "ada")
    known = Tokens(path=file)
    other = new_token().encode()
    inode = file.stat().st_ino

    with file.open("r+b") as opened:  # at once, in the same tick of the file system's clock
        opened.write(file.read_bytes().replace(digest_of(ada).hex().encode(), digest_of(other).hex().encode()))

    assert file.stat().st_ino == inode
    assert (holder(known, ada), holder(known, other)) == (None, Identity("ada", Scope.READ))


def test_many_who_add_at_once_all_get_in(file):
    with ThreadPoolExecutor(8) as pool:
        made_ones = list(pool.map(lambda number: (f"n{number}", made(file, f"n{number}")), range(40)))

    known = Tokens(path=file)
    assert [known.holder(token).name for _, token in made_ones] == [name for name, _ in made_ones]
    assert list(file.parent.iterdir()) == [file]


def test_adding_keeps_comments_mode_and_the_link(tmp_path):
    real = tmp_path / "real"
    real.write_text("# who is who\n")
    real.chmod(0o640)
    (tmp_path / "link").symlink_to("real")

    made(tmp_path / "link", "ada")
    made(tmp_path / "link", "adam")
    remove(tmp_path / "link", "ada")

    assert (tmp_path / "link").is_symlink()
    assert real.read_text().startswith("# who is who\nadam read ")
    assert real.stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize("name", ["", "admin", "a b", "../x", "a" * 64, "\u00e4"])
def test_a_name_that_no_line_can_have_is_refused(file, name):
    with pytest.raises(TokenFileError, match="name"):
        made(file, name)
    assert not file.exists()


def test_a_second_token_for_a_name_is_refused(file):
    made(file, "ada")
    with pytest.raises(TokenFileError, match="already"):
        made(file, "ada", "admin")
    assert len(stored(file)) == 1


def test_a_change_that_sets_the_time_back_is_seen(file):
    ada = made(file, "ada")
    before = time.time() - 3600
    os.utime(file, (before, before))
    known = Tokens(path=file)
    known._seen = tokens_module._signature(file.stat())  # as if it had been like this for long
    size, time_ns = file.stat().st_size, file.stat().st_mtime_ns

    other = new_token().encode()
    with file.open("r+b") as opened:
        opened.write(file.read_bytes().replace(digest_of(ada).hex().encode(), digest_of(other).hex().encode()))
    os.utime(file, ns=(time_ns, time_ns))

    assert (file.stat().st_size, file.stat().st_mtime_ns) == (size, time_ns)
    assert (holder(known, ada), holder(known, other)) == (None, Identity("ada", Scope.READ))


ROOT_ONLY = pytest.mark.skipif(os.geteuid() != 0, reason="only root can make a file of another user")


@ROOT_ONLY
def test_a_change_by_root_keeps_the_owner(file):
    """Or the service could not read its tokens any more, and revoked ones would stay in force."""
    made(file, "ada")
    os.chown(file, 65534, 65533)

    for change in (lambda: made(file, "joe"), lambda: remove(file, "ada")):
        before = file.read_bytes()
        change()
        assert file.read_bytes() != before
        assert (file.stat().st_uid, file.stat().st_gid) == (65534, 65533)
        assert file.stat().st_mode & 0o777 == 0o600


@ROOT_ONLY
@pytest.mark.processes
@pytest.mark.parametrize("change", ["add", "remove"])
def test_where_the_owner_cannot_be_kept_nothing_changes(change):
    with tempfile.TemporaryDirectory(dir="/tmp") as folder:  # whose parents anybody may enter
        file = Path(folder) / "tokens"
        made(file, "ada")
        file.chmod(0o644)
        file.parent.chmod(0o777)
        before = file.read_bytes()
        command = [sys.executable, "-c", AS_NOBODY, str(file), change]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)

        assert "was not changed: it belongs to user 0" in done.stdout, done.stderr
        assert (file.read_bytes(), file.stat().st_uid) == (before, 0)
        assert list(file.parent.iterdir()) == [file]


def test_a_pipe_is_no_file_of_tokens(file):
    os.mkfifo(file)
    for use in (lambda: Tokens(path=file), lambda: stored(file), lambda: made(file, "ada")):
        with pytest.raises(TokenFileError, match="no regular file"):
            use()


def test_a_file_that_becomes_a_pipe_stops_nothing(file):
    ada = made(file, "ada")
    known = Tokens(path=file)
    file.unlink()
    os.mkfifo(file)

    assert holder(known, ada) is not None
    assert "no regular file" in known.problem


class Hanging(type(Path())):
    """A path on a disk that does not answer until `answers` is set."""

    answers = threading.Event()
    asked = 0

    def stat(self, **how):
        Hanging.asked += 1
        assert self.answers.wait(30)
        return super().stat(**how)


def test_a_disk_that_hangs_holds_one_thread_and_nobody_who_asks(file, monkeypatch):
    monkeypatch.setattr(tokens_module, "_LOOK_S", 0.01)
    monkeypatch.setattr(tokens_module, "_STALLED_S", 0.2)
    ada = made(file, "ada")
    known = Tokens(path=Hanging(file))
    known._seen = tokens_module._signature(file.stat())
    threads = threading.active_count()
    known.start()
    try:
        time.sleep(0.5)
        began = time.monotonic()
        assert all(known.holder(ada) for _ in range(100))
        assert time.monotonic() - began < 0.5
        assert threading.active_count() == threads + 1
        assert Hanging.asked == 1
        assert "does not answer" in known.problem
        assert known.confirmed_s > 0.4

        remove(file, "ada")
        Hanging.answers.set()
        deadline = time.monotonic() + 20
        while known.holder(ada) and time.monotonic() < deadline:
            time.sleep(0.02)
        assert known.holder(ada) is None
        assert known.problem is None
    finally:
        Hanging.answers.set()
        known.close()


def test_looks_end_when_they_are_told_to(file, monkeypatch):
    monkeypatch.setattr(tokens_module, "_LOOK_S", 0.01)
    made(file, "ada")
    known = Tokens(path=file)
    known.start()
    known.close()
    time.sleep(0.2)

    joe = made(file, "joe")
    time.sleep(0.2)
    assert known.holder(joe) is None
