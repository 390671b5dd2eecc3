"""What holds for any store, whatever the backend: one suite, inherited once per backend."""

from __future__ import annotations

import hashlib
from datetime import UTC

import pytest
from pydantic import ValidationError

from model_store import (
    AliasNotFoundError,
    AlreadyExistsError,
    ArtefactTooLargeError,
    ConflictError,
    DatasetDraft,
    DatasetNotFoundError,
    InvalidDraftError,
    InvalidReferenceError,
    ModelNotFoundError,
    ModelStore,
    NotFoundError,
    Resolved,
    VersionNotFoundError,
)

BY = {"actor": "tests", "reason": "because"}


def digest(text):
    return hashlib.sha256(text.encode()).hexdigest()


class StoreLaws:
    """Subclasses provide the fixture `store`: an empty store on one kind of backend."""

    @pytest.fixture
    def published(self, store, files, draft):
        for _ in range(3):
            store.publish("viper", files, draft)
        return store

    # -- versions

    def test_an_empty_store_lists_nothing_and_says_so(self, store):
        assert store.model_names() == []
        assert store.dataset_ids() == []
        with pytest.raises(ModelNotFoundError, match="publish a version first"):
            store.resolve("viper")
        with pytest.raises(ModelNotFoundError):
            store.versions("viper")
        with pytest.raises(ModelNotFoundError):
            store.aliases("viper")

    def test_what_is_published_is_what_is_read(self, store, files, draft):
        manifest = store.publish("viper", files, draft)
        assert store.manifest("viper", 1) == manifest
        assert store.verify("viper", 1) == manifest
        assert {file: store.read_file(manifest, file) for file in manifest.files} == files
        assert manifest.checkpoint == draft.checkpoint
        assert manifest.lineage == draft.lineage
        assert manifest.created_at.tzinfo is UTC
        weights = manifest.files["weights.safetensors"]
        assert weights.sha256 == hashlib.sha256(files["weights.safetensors"]).hexdigest()
        assert weights.size_bytes == len(files["weights.safetensors"])

    def test_publishing_counts_up_and_leaves_older_versions_alone(self, store, files, draft):
        before = store.publish("viper", files, draft)
        after = store.publish("viper", {"weights.safetensors": b"other"}, draft)
        assert (before.version, after.version) == (1, 2)
        assert store.versions("viper") == [1, 2]
        assert store.verify("viper", 1) == before

    def test_models_do_not_mix(self, store, files, draft):
        for name in ("viper", "viper-2", "viper"):
            store.publish(name, files, draft)
        assert store.model_names() == ["viper", "viper-2"]
        assert store.versions("viper-2") == [1]

    def test_missing_versions_and_files_are_named_with_what_there_is(self, published):
        with pytest.raises(VersionNotFoundError, match="no version 9; published are 1, 2, 3"):
            published.manifest("viper", 9)
        with pytest.raises(VersionNotFoundError):
            published.resolve("viper@9")
        with pytest.raises(ModelNotFoundError, match="there are viper"):
            published.manifest("other", 1)
        with pytest.raises(NotFoundError, match=r"it has report/loss\.svg, weights\.safetensors"):
            published.read_file(published.manifest("viper", 1), "report/nothing.svg")

    def test_a_reader_says_how_much_it_takes(self, published):
        manifest = published.manifest("viper", 1)
        assert published.read_file(manifest, "weights.safetensors", limit_bytes=7000)
        with pytest.raises(ArtefactTooLargeError, match="7000 bytes"):
            published.read_file(manifest, "weights.safetensors", limit_bytes=6999)

    @pytest.mark.parametrize(
        "bad",
        [
            pytest.param({"report/a.svg": b""}, id="no weights"),
            pytest.param({}, id="nothing"),
            pytest.param({"weights.safetensors": "text"}, id="text for bytes"),
            pytest.param({"weights.safetensors": b"", "manifest.json": b"{}"}, id="own manifest"),
            pytest.param({"weights.safetensors": b"", "../../x": b""}, id="climbing out"),
            pytest.param({"weights.safetensors": b"", "report/../x": b""}, id="climbing within"),
            pytest.param({"weights.safetensors": b"", "report/a/b": b""}, id="deep"),
            pytest.param({"weights.safetensors": b"", "report/.hidden": b""}, id="hidden"),
            pytest.param({"weights.safetensors": b"", "report/a#1": b""}, id="like a staged file"),
            pytest.param({"weights.safetensors": b"", "report/A": b"", "report/a": b""}, id="case twins"),
            pytest.param({"weights.safetensors": b"", **{f"report/{i}": b"" for i in range(256)}}, id="many"),
        ],
    )
    def test_a_bad_set_of_files_is_refused_before_anything_is_written(self, store, draft, bad):
        with pytest.raises((InvalidDraftError, InvalidReferenceError)):
            store.publish("viper", bad, draft)
        assert store.model_names() == []
        assert store.publish("viper", {"weights.safetensors": b"w"}, draft).version == 1

    def test_a_manifest_too_large_to_read_back_is_refused_before_anything_is_written(self, store, files, draft):
        huge = draft.model_copy(update={"metrics": {"table": ["x" * 1000] * 9000}})
        with pytest.raises(InvalidDraftError, match="report/ file"):
            store.publish("viper", files, huge)
        assert store.publish("viper", files, draft).version == 1

    def test_the_manifest_of_thousands_of_training_runs_is_kept(self, store, files, draft):
        large = draft.model_copy(update={"metrics": {"table": ["x" * 1300] * 5000}})
        assert store.publish("viper", files, large).version == 1
        assert store.manifest("viper", 1).metrics == large.metrics

    @pytest.mark.parametrize(
        ("field", "value"),
        [
            ("metrics", {"error_m": [0.1, float("nan")]}),
            ("domain", {"slope_deg": float("inf")}),
            ("checkpoint", {"name": "\ud800"}),
            ("checkpoint", {"\ud800": 1}),
            ("metrics", {"a": object()}),
            ("created_by", ""),
            ("mystery", 1),
        ],
    )
    def test_a_draft_that_json_cannot_hold_is_refused_when_made(self, store, draft, field, value):
        with pytest.raises(ValidationError):
            type(draft)(**{**dict(draft), field: value})

    # -- references

    def test_a_bare_name_means_its_champion(self, published):
        published.move_alias("viper", "champion", 2, **BY)
        assert published.resolve("viper") == published.resolve("viper@champion") == Resolved("viper", 2, "champion")
        assert published.resolve("viper@3") == Resolved("viper", 3, None)

    @pytest.mark.parametrize(
        "reference",
        ["", "@", "viper@", "viper@03", "viper@0", "viper@-1", "viper@1.0", "viper@Champion", "viper@1@2", "Viper",
         "../x", "a/b", "viper@../x", "viper\n", "viper@champion\n", "-viper", "v" * 64, "viper@٣",
         "viper@1234567890", "vi per"],
    )  # fmt: skip
    def test_malformed_references_never_reach_a_path(self, published, reference):
        with pytest.raises(InvalidReferenceError):
            published.resolve(reference)

    @pytest.mark.parametrize("version", [0, -1, True, 1.0, "1", 10**9, None])
    def test_versions_are_positive_integers(self, published, version):
        with pytest.raises(InvalidReferenceError):
            published.manifest("viper", version)

    # -- aliases

    def test_an_alias_history_only_grows(self, published):
        seen = []
        for version in (1, 3, 3, 2):
            moved = published.move_alias("viper", "champion", version, actor="ann", reason=f"to {version}")
            history = published.alias_history("viper", "champion")
            assert history[:-1] == seen
            assert history[-1] == moved == published.alias("viper", "champion")
            seen = history
        assert [record.seq for record in seen] == [1, 2, 3, 4]
        assert [(record.actor, record.reason) for record in seen][1] == ("ann", "to 3")
        assert all(record.time.tzinfo is UTC for record in seen)

    def test_aliases_are_listed_with_what_they_point_to(self, published):
        assert published.aliases("viper") == {}
        published.move_alias("viper", "champion", 1, **BY)
        published.move_alias("viper", "candidate", 3, **BY)
        published.move_alias("viper", "champion", 2, **BY)
        aliases = published.aliases("viper")
        assert {alias: record.version for alias, record in aliases.items()} == {"candidate": 3, "champion": 2}
        with pytest.raises(AliasNotFoundError, match="its aliases: candidate, champion"):
            published.alias("viper", "stable")

    def test_an_alias_cannot_point_to_nothing(self, published):
        with pytest.raises(VersionNotFoundError):
            published.move_alias("viper", "champion", 4, **BY)
        with pytest.raises(ModelNotFoundError):
            published.move_alias("other", "champion", 1, **BY)
        assert published.aliases("viper") == {}

    def test_a_move_that_expects_another_record_is_refused(self, published):
        published.move_alias("viper", "champion", 1, expected_seq=0, **BY)
        for stale in (0, 2):
            with pytest.raises(ConflictError, match=f"at record 1, expected was {stale}"):
                published.move_alias("viper", "champion", 2, expected_seq=stale, **BY)
            with pytest.raises(ConflictError):
                published.rollback("viper", "champion", expected_seq=stale, **BY)
        assert published.move_alias("viper", "champion", 2, expected_seq=1, **BY).seq == 2

    @pytest.mark.parametrize("said", [{"actor": "", "reason": ""}, {"actor": "a", "reason": "r" * 4001}])
    def test_a_move_names_who_did_it(self, published, said):
        with pytest.raises(InvalidDraftError, match=r"field '(actor|reason)'"):
            published.move_alias("viper", "champion", 1, **said)

    @pytest.mark.parametrize(
        ("moves", "versions"),
        [
            pytest.param([1, 2, "back"], [1], id="one step"),
            pytest.param([1, 2, 3, "back", "back"], [2, 1], id="goes further back, not forth again"),
            pytest.param([1, 2, 2, "back"], [1], id="confirming a version is no change"),
            pytest.param([1, 2, 3, "back", 2, "back"], [2, 1], id="confirming after a rollback neither"),
            pytest.param([1, 2, "back", 3, "back"], [1, 1], id="a move after a rollback starts from there"),
            pytest.param([1, 2, 1, "back"], [2], id="there and back by hand"),
        ],
    )
    def test_rollback_takes_the_last_version_change_back(self, published, moves, versions):
        rolled = []
        for move in moves:
            if move == "back":
                rolled.append(published.rollback("viper", "champion", **BY))
                assert published.alias("viper", "champion") == rolled[-1]
            else:
                published.move_alias("viper", "champion", move, **BY)
        assert [record.version for record in rolled] == versions
        assert len(published.alias_history("viper", "champion")) == len(moves)

    def test_there_is_nothing_before_the_first(self, published):
        with pytest.raises(AliasNotFoundError):
            published.rollback("viper", "champion", **BY)
        published.move_alias("viper", "champion", 2, **BY)
        with pytest.raises(ConflictError, match="nothing to roll back to: version 2 is the first"):
            published.rollback("viper", "champion", **BY)

    # -- datasets

    def test_a_dataset_is_read_as_it_was_put(self, store):
        content = {"passport.json": b"{}", "runs.parquet": b"PAR1" * 100}
        draft = DatasetDraft(name="paper", created_by="tests", summary={"runs": 13}, source={"tool": "chrono"})
        record = store.put_dataset(digest("paper"), content, draft)
        assert store.dataset_ids() == [digest("paper")]
        assert store.dataset(digest("paper")) == record
        assert (record.id, record.name, record.summary) == (digest("paper"), "paper", {"runs": 13})
        assert {file: store.read_dataset_file(record.id, file) for file in record.files} == content
        with pytest.raises(NotFoundError, match=r"it has passport\.json, runs\.parquet"):
            store.read_dataset_file(record.id, "other.csv")

    def test_putting_a_dataset_twice_is_putting_it_once(self, store):
        one = store.put_dataset(digest("a"), {"runs.parquet": b"a"}, DatasetDraft(name="one", created_by="ann"))
        two = store.put_dataset(digest("a"), {"runs.parquet": b"a"}, DatasetDraft(name="two", created_by="bob"))
        assert one == two
        assert store.dataset_ids() == [digest("a")]

    @pytest.mark.parametrize("other", [{"runs.parquet": b"b"}, {"runs.parquet": b"a", "more.csv": b""}, {"x": b"a"}])
    def test_other_content_under_the_same_id_is_refused(self, store, other):
        draft = DatasetDraft(name="one", created_by="tests")
        record = store.put_dataset(digest("a"), {"runs.parquet": b"a"}, draft)
        with pytest.raises(AlreadyExistsError, match="its own id"):
            store.put_dataset(digest("a"), other, draft)
        assert store.dataset(digest("a")) == record
        assert store.read_dataset_file(digest("a"), "runs.parquet") == b"a"

    def test_datasets_are_found_by_id_start_of_id_and_name(self, store):
        ids = ["abcdef" + "0" * 58, "abcdef" + "1" * 58, "f" * 64]
        for dataset_id, name in zip(ids, ["paper", "mass", "mass"], strict=True):
            store.put_dataset(dataset_id, {"runs.parquet": b""}, DatasetDraft(name=name, created_by="tests"))
        assert store.dataset_ids() == sorted(ids)
        assert store.dataset("abcdef0").id == store.dataset("paper").id == store.dataset(ids[0]).id == ids[0]
        for ambiguous, fitting in {"abcdef": ids[:2], "mass": ids[1:]}.items():
            with pytest.raises(InvalidReferenceError) as refused:
                store.dataset(ambiguous)
            assert all(dataset_id in str(refused.value) for dataset_id in fitting)
        for missing in ("fffff", "0" * 64, "space", "../x", ""):
            with pytest.raises(DatasetNotFoundError):
                store.dataset(missing)

    @pytest.mark.parametrize("file", ["dataset.json", "../x", "a/b", ".x", "", "a#1", "x" * 129])
    def test_dataset_files_have_plain_names(self, store, file):
        with pytest.raises(InvalidReferenceError):
            store.put_dataset(digest("a"), {file: b""}, DatasetDraft(name="a", created_by="tests"))
        assert store.dataset_ids() == []

    @pytest.mark.parametrize("dataset_id", ["", "abc", "A" * 64, "../" + "a" * 61, "a" * 64 + "\n"])
    def test_dataset_ids_are_digests(self, store, dataset_id):
        with pytest.raises(InvalidReferenceError):
            store.put_dataset(dataset_id, {"x": b""}, DatasetDraft(name="a", created_by="tests"))


class TestInMemory(StoreLaws):
    @pytest.fixture
    def store(self):
        return ModelStore.open("memory://")


class TestInADirectory(StoreLaws):
    @pytest.fixture
    def store(self, tmp_path):
        return ModelStore.open(str(tmp_path / "store"), create=True)


class TestAtAFileUrl(StoreLaws):
    @pytest.fixture
    def store(self, tmp_path):
        return ModelStore.open((tmp_path / "a store").as_uri(), create=True)
