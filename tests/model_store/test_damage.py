"""Damage on disk: each kind has a clear error, and never spreads to what is good."""

from __future__ import annotations

import json
import math

import pytest

from model_store import (
    AlreadyExistsError,
    ArtefactTooLargeError,
    CorruptArtefactError,
    DatasetDraft,
    DatasetNotFoundError,
    ModelStore,
    StoreUnavailableError,
    UnsupportedFormatError,
    VersionNotFoundError,
)

BY = {"actor": "tests", "reason": "because"}
V1 = "models/viper/versions/1"
WEIGHTS = f"{V1}/weights.safetensors"
MANIFEST = f"{V1}/manifest.json"
NEWEST_MOVE = "models/viper/aliases/champion/00000002.json"


@pytest.fixture
def published(store, files, draft):
    for _ in range(2):
        store.publish("viper", files, draft)
    store.move_alias("viper", "champion", 2, **BY)
    store.move_alias("viper", "champion", 1, **BY)
    return store


def edit(path, **fields):
    path.write_text(json.dumps({**json.loads(path.read_text()), **fields}))


def cut(path):
    path.write_bytes(path.read_bytes()[:-5])


def flip(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(bytes(data))


def grow(path):
    path.write_bytes(path.read_bytes() + b"x")


def empty(path):
    path.write_bytes(b"")


def wrong_digest(path):
    files = json.loads(path.read_text())["files"]
    edit(path, files={file: {**entry, "sha256": "0" * 64} for file, entry in files.items()})


def wrong_size(path):
    files = json.loads(path.read_text())["files"]
    edit(path, files={file: {**entry, "size_bytes": 3} for file, entry in files.items()})


def replace(old, new):
    def damage(path):
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))

    return damage


@pytest.mark.parametrize(
    ("where", "damage", "said"),
    [
        pytest.param(WEIGHTS, cut, f"{WEIGHTS} has 6995 bytes, published were 7000", id="truncated weights"),
        pytest.param(WEIGHTS, empty, "has 0 bytes", id="empty weights"),
        pytest.param(WEIGHTS, grow, "larger than the 7000 bytes published", id="grown weights"),
        pytest.param(WEIGHTS, flip, f"{WEIGHTS} has sha256 .* was altered", id="one bit of the weights"),
        pytest.param(WEIGHTS, lambda path: path.unlink(), f"{WEIGHTS} .* is gone", id="missing weights"),
        pytest.param(f"{V1}/report/loss.svg", flip, "loss.svg has sha256", id="one bit of a report"),
        pytest.param(MANIFEST, wrong_digest, "published was 000000000000", id="wrong digest in the manifest"),
        pytest.param(MANIFEST, wrong_size, "larger than the 3 bytes published", id="wrong size in the manifest"),
        pytest.param(MANIFEST, cut, f"{MANIFEST} is not JSON", id="truncated manifest"),
        pytest.param(MANIFEST, empty, f"{MANIFEST} is not JSON", id="empty manifest"),
        pytest.param(MANIFEST, lambda path: path.write_bytes(b"\xff\xfe\x00"), "not JSON", id="binary manifest"),
        pytest.param(MANIFEST, lambda path: path.write_text("[1]"), "holds a list", id="not an object"),
        pytest.param(MANIFEST, lambda path: path.write_text("[" * 100_000), "not JSON", id="nested without end"),
        pytest.param(MANIFEST, lambda path: edit(path, deep=json.loads("[" * 90 + "]" * 90)), "deeper", id="deep"),
        pytest.param(MANIFEST, replace("0.05", "NaN"), r"'metrics\.final_position_error_m' is nan", id="NaN"),
        pytest.param(MANIFEST, replace("0.05", "1e999"), "is inf, not a finite", id="number beyond floats"),
        pytest.param(
            MANIFEST,
            lambda path: edit(path, later=[1, {"x": [math.nan]}]),
            r"'later\[1\]\.x\[0\]' is nan",
            id="NaN where this release does not look",
        ),
        pytest.param(MANIFEST, replace("tests", "\\ud800"), "broken Unicode", id="half a surrogate"),
        pytest.param(
            MANIFEST, lambda path: edit(path, domain={"\ud800": 1}), "'domain' has a key of broken", id="half a key"
        ),
        pytest.param(
            MANIFEST, lambda path: edit(path, domain=[1, 2]), "field 'domain': .* dictionary", id="a list for an object"
        ),
        pytest.param(MANIFEST, lambda path: edit(path, version="one"), "field 'version'", id="version in words"),
        pytest.param(MANIFEST, lambda path: edit(path, format="zip"), "'zip', expected 'rover", id="other format"),
        pytest.param(MANIFEST, lambda path: edit(path, version=2), "says it is viper@2", id="another's number"),
        pytest.param(MANIFEST, lambda path: edit(path, name="other"), "says it is other@1", id="another's name"),
        pytest.param(MANIFEST, lambda path: edit(path, files={}), "field 'files'", id="no files"),
        pytest.param(MANIFEST, lambda path: edit(path, created_at="2026-01-01T00:00:00"), "timezone", id="no zone"),
        pytest.param(
            MANIFEST,
            lambda path: edit(path, files={"../2/weights.safetensors": {"sha256": "0" * 64, "size_bytes": 1}}),
            "field 'files",
            id="path out of its folder",
        ),
    ],
)
def test_damage_is_named_with_its_place(published, directory, where, damage, said):
    damage(directory / where)
    with pytest.raises(CorruptArtefactError, match=said) as refused:
        published.verify("viper", 1)
    assert str(directory) not in str(refused.value)
    assert published.verify("viper", 2).version == 2
    assert published.versions("viper") == [1, 2]


def test_a_manifest_of_a_newer_major_is_refused_and_a_newer_minor_is_read(published, directory):
    edit(directory / MANIFEST, format_version="1.9")
    assert published.verify("viper", 1).format_version == "1.9"
    edit(directory / MANIFEST, format_version="2.0")
    with pytest.raises(UnsupportedFormatError, match=r"'2\.0', this release reads 1\.x"):
        published.manifest("viper", 1)
    assert published.verify("viper", 2)


def test_unknown_fields_are_kept(published, directory):
    edit(directory / MANIFEST, reviewed_by={"name": "ann"})
    manifest = published.verify("viper", 1)
    assert manifest.model_dump(mode="json")["reviewed_by"] == {"name": "ann"}


def test_an_oversized_manifest_is_not_read(published, directory):
    (directory / MANIFEST).write_bytes(b" " * ((8 << 20) + 1))
    with pytest.raises(ArtefactTooLargeError, match="8388608"):
        published.manifest("viper", 1)


def test_an_alias_to_nothing_is_told_from_a_missing_alias(published, directory):
    (directory / MANIFEST).unlink()
    with pytest.raises(VersionNotFoundError, match="viper@champion points to version 1, which is not in the store"):
        published.resolve("viper")
    assert published.versions("viper") == [2]
    published.move_alias("viper", "champion", 2, **BY)
    assert published.resolve("viper").version == 2


@pytest.mark.parametrize(
    "damage", [cut, empty, replace('"version": 1', '"version": 0'), replace('"seq": 2', '"seq": 7')]
)
def test_a_broken_alias_record_is_not_papered_over_and_a_move_repairs_it(published, directory, damage):
    damage(directory / NEWEST_MOVE)
    for look in (lambda: published.resolve("viper"), lambda: published.aliases("viper")):
        with pytest.raises(CorruptArtefactError, match=r"00000002\.json"):
            look()
    assert published.move_alias("viper", "champion", 1, **BY).seq == 3
    assert published.resolve("viper").version == 1
    assert published.rollback("viper", "champion", **BY).version == 2


def test_an_alias_record_of_a_newer_major_is_neither_followed_nor_buried(published, directory):
    edit(directory / NEWEST_MOVE, format_version="2.0")
    with pytest.raises(UnsupportedFormatError):
        published.resolve("viper")
    with pytest.raises(UnsupportedFormatError):
        published.move_alias("viper", "champion", 2, **BY)


def test_a_rollback_to_a_version_that_is_gone_says_so(published, directory):
    (directory / "models/viper/versions/2/manifest.json").unlink()
    with pytest.raises(VersionNotFoundError, match="no version 2"):
        published.rollback("viper", "champion", **BY)
    assert published.resolve("viper").version == 1


def test_strange_things_in_the_folders_are_ignored(published, directory):
    for stray in ("latest", "03", "1#2", "0"):
        folder = directory / "models/viper/versions" / stray
        folder.mkdir()
        (folder / "manifest.json").write_text("{}")
    (directory / "models/viper/versions/1/weights.safetensors#3").write_bytes(b"staged by a killed put")
    (directory / "models/viper/aliases/champion/notes.json").write_text("{}")
    (directory / "models/viper/aliases/champion/00000000.json").write_text("{}")
    (directory / "models/README.md").write_text("hello")
    (directory / "models/empty/versions").mkdir(parents=True)
    assert published.model_names() == ["viper"]
    assert published.versions("viper") == [1, 2]
    assert published.resolve("viper").version == 1
    assert len(published.alias_history("viper", "champion")) == 2


def test_a_number_a_killed_publisher_began_is_never_used_again(published, directory, files, draft):
    begun = directory / "models/viper/versions/7"
    begun.mkdir()
    (begun / "weights.safetensors").write_bytes(b"half a ver")
    assert published.versions("viper") == [1, 2]
    assert published.publish("viper", files, draft).version == 8
    assert (begun / "weights.safetensors").read_bytes() == b"half a ver"


def test_an_unfinished_dataset_is_completed(store, directory):
    files = {"passport.json": b"{}", "runs.parquet": b"PAR1"}
    draft = DatasetDraft(name="paper", created_by="tests")
    folder = directory / "datasets" / ("a" * 64)
    folder.mkdir(parents=True)
    (folder / "passport.json").write_bytes(b"{}")
    assert store.dataset_ids() == []
    with pytest.raises(DatasetNotFoundError):
        store.dataset("paper")
    store.put_dataset("a" * 64, files, draft)
    assert store.read_dataset_file("a" * 64, "passport.json") == b"{}"


def test_an_unfinished_dataset_with_other_bytes_is_left_alone(store, directory):
    folder = directory / "datasets" / ("a" * 64)
    folder.mkdir(parents=True)
    (folder / "runs.parquet").write_bytes(b"torn")
    with pytest.raises(AlreadyExistsError, match=r"runs\.parquet is left from an unfinished put"):
        store.put_dataset("a" * 64, {"runs.parquet": b"PAR1"}, DatasetDraft(name="paper", created_by="tests"))
    assert (folder / "runs.parquet").read_bytes() == b"torn"


def test_a_broken_dataset_does_not_hide_the_others(store, directory):
    for key in "ab":
        store.put_dataset(key * 64, {"x": b"1234"}, DatasetDraft(name=f"set-{key}", created_by="tests"))
    cut(directory / "datasets" / ("a" * 64) / "dataset.json")
    assert store.dataset("set-b").id == "b" * 64
    with pytest.raises(DatasetNotFoundError, match=f"unreadable and skipped: {'a' * 64}"):
        store.dataset("set-a")
    with pytest.raises(CorruptArtefactError, match=r"dataset\.json is not JSON"):
        store.dataset("aaaaaa")
    flip(directory / "datasets" / ("b" * 64) / "x")
    with pytest.raises(CorruptArtefactError, match="was altered"):
        store.read_dataset_file("b" * 64, "x")


def test_a_failing_backend_is_unavailable_not_empty(published, directory, files, draft):
    weights = directory / "models/viper/versions/1/weights.safetensors"
    weights.unlink()
    weights.symlink_to(weights)  # an endless loop: reading it fails in a way that is neither missing nor corrupt
    with pytest.raises(StoreUnavailableError, match=r"cannot read .*weights\.safetensors"):
        published.read_file(published.manifest("viper", 1), "weights.safetensors")
    (directory / "models/kite").write_bytes(b"a file where a folder belongs")
    with pytest.raises(StoreUnavailableError, match="cannot list models/kite"):
        published.publish("kite", files, draft)
    assert published.verify("viper", 2)


@pytest.mark.parametrize("url", ["{}/missing", "file://{}/missing", "ftp://ann:secret@example.org/x", "file://host/x"])
def test_a_place_that_cannot_be_opened_is_named_without_secrets(tmp_path, url):
    with pytest.raises(StoreUnavailableError, match="cannot open the model store") as refused:
        ModelStore.open(url.format(tmp_path))
    assert "secret" not in str(refused.value)


def test_opening_again_finds_what_was_published(published, directory):
    assert ModelStore.open(directory).verify("viper", 1) == published.manifest("viper", 1)
    assert ModelStore.open(directory.as_uri()).resolve("viper").version == 1
