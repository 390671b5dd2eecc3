"""Archived and deleted versions: whatever is done in whatever order, aliases name usable versions, numbers are never
used again, and every version that ever was still says what it was made from.
"""

from __future__ import annotations

import tempfile

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule, run_state_machine_as_test

from model_store import (
    WEIGHTS,
    ConflictError,
    InvalidDraftError,
    Lineage,
    ManifestDraft,
    ModelStore,
    NotFoundError,
    VersionArchivedError,
    VersionDeletedError,
    VersionInUseError,
    VersionNotFoundError,
    VersionRetiredError,
)

BY = {"actor": "tests", "reason": "because"}
ALIASES = st.sampled_from(["champion", "candidate"])
NUMBERS = st.integers(1, 5)


def refused(states, version):
    """What a use of a version in this state raises, None where it is allowed."""
    errors = {None: NotFoundError, "archived": VersionArchivedError, "deleted": VersionDeletedError}
    return errors.get(states.get(version))


class Lives(RuleBasedStateMachine):
    url = "memory://"

    def __init__(self):
        super().__init__()
        self.store = ModelStore.open(self.url)
        self.states: dict[int, str] = {}
        self.trails: dict[str, list[int]] = {}

    @initialize()
    def begin_with_two(self):
        self.publish()
        self.publish()

    @rule()
    def publish(self):
        number = len(self.states) + 1
        draft = ManifestDraft(created_by="x", checkpoint={}, domain={}, metrics={}, lineage=Lineage(seed=number))
        files = {WEIGHTS: b"%d" % number, "report/band.safetensors": b"b", "report/test.json": b"{}"}
        assert self.store.publish("viper", files, draft).version == number
        self.states[number] = "published"

    @rule(alias=ALIASES, version=NUMBERS)
    def promote(self, alias, version):
        if error := refused(self.states, version):
            with pytest.raises(error):
                self.store.move_alias("viper", alias, version, **BY)
            return
        self.store.move_alias("viper", alias, version, **BY)
        trail = self.trails.setdefault(alias, [])
        if trail[-1:] != [version]:
            trail.append(version)

    @rule(alias=ALIASES)
    def rollback(self, alias):
        trail = self.trails.get(alias, [])
        error = (ConflictError, NotFoundError) if len(trail) < 2 else refused(self.states, trail[-2])
        if error:
            with pytest.raises(error):
                self.store.rollback("viper", alias, **BY)
            return
        trail.pop()
        assert self.store.rollback("viper", alias, **BY).version == trail[-1]

    @rule(version=NUMBERS, again=st.booleans())
    def archive(self, version, again):
        state, before = self.states.get(version), self.named(version)
        error = {None: NotFoundError, "deleted": VersionDeletedError}.get(state) or (VersionInUseError if before else 0)
        if error:
            with pytest.raises(error) as raised:
                self.store.archive_version("viper", version, **BY)
            assert getattr(raised.value, "aliases", before) == before
            return
        said = self.store.archive_version("viper", version, **BY)
        self.states[version] = "archived"
        assert not again or self.store.archive_version("viper", version, **BY) == said

    @rule(version=NUMBERS)
    def restore(self, version):
        state = self.states.get(version)
        if state in (None, "deleted"):
            with pytest.raises(NotFoundError if state is None else VersionDeletedError):
                self.store.restore_version("viper", version, **BY)
            return
        assert (self.store.restore_version("viper", version, **BY) is None) == (state == "published")
        self.states[version] = "published"

    @rule(version=NUMBERS)
    def delete(self, version):
        error = NotFoundError if version not in self.states else VersionInUseError if self.named(version) else None
        if error:
            with pytest.raises(error):
                self.store.delete_version("viper", version, **BY)
            return
        self.store.delete_version("viper", version, **BY)
        self.states[version] = "deleted"

    def named(self, version):
        return sorted(alias for alias, trail in self.trails.items() if trail[-1] == version)

    @invariant()
    def aliases_name_usable_versions(self):
        for alias, trail in self.trails.items():
            resolved = self.store.resolve(f"viper@{alias}")
            assert resolved.version == trail[-1]
            assert self.store.verify("viper", resolved.version).version == resolved.version
            self.store.require_usable("viper", resolved.version)

    @invariant()
    def lists_and_states_agree(self):
        if self.states:
            usable = [number for number, state in self.states.items() if state == "published"]
            assert self.store.versions("viper") == usable
            assert self.store.versions("viper", retired=True) == sorted(self.states)
        for version, state in self.states.items():
            said, record = self.store.version_state("viper", version)
            assert said == state
            assert record is None or (record.what, record.version) == (state, version)

    @invariant()
    def what_it_was_made_from_is_never_lost(self):
        for version, state in self.states.items():
            manifest = self.store.manifest("viper", version)
            assert manifest.lineage.seed == version
            assert self.store.read_file(manifest, "report/test.json") == b"{}"
            for file in (WEIGHTS, "report/band.safetensors"):
                if state == "deleted":
                    with pytest.raises(VersionDeletedError):
                        self.store.read_file(manifest, file)
                else:
                    assert self.store.read_file(manifest, file)


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["memory", "directory"])
def test_any_life_of_a_model_keeps_the_laws(backend):
    class OnADirectory(Lives):
        def __init__(self):
            self.folder = tempfile.TemporaryDirectory()
            self.url = self.folder.name
            super().__init__()

        def teardown(self):
            self.folder.cleanup()

    run_state_machine_as_test(
        Lives if backend == "memory" else OnADirectory,
        settings=settings(
            max_examples=30 if backend == "memory" else 8,
            stateful_step_count=40,
            deadline=None,
            derandomize=True,
            database=None,
            suppress_health_check=[HealthCheck.too_slow],
        ),
    )


@pytest.fixture
def two(store, files, draft):
    for _ in range(2):
        store.publish("viper", files, draft)
    return store


def test_a_retired_version_says_when_by_whom_and_why(two):
    two.archive_version("viper", 1, actor="ada", reason="slides")
    state, record = two.version_state("viper", 1)
    assert (state, record.actor, record.reason) == ("archived", "ada", "slides")
    assert two.version_state("viper", 2) == ("published", None)
    with pytest.raises(VersionNotFoundError):
        two.version_state("viper", 3)


def test_a_model_may_have_no_usable_version(two):
    for version in (1, 2):
        two.archive_version("viper", version, **BY)
    assert two.versions("viper") == []
    assert two.model_names() == ["viper"]


def test_a_deletion_that_was_killed_is_finished_by_deleting_again(two, directory, files):
    two.delete_version("viper", 1, **BY)
    weights = directory / "models/viper/versions/1/weights.safetensors"
    weights.write_bytes(files[WEIGHTS])  # as if it had been killed before it came to that
    with pytest.raises(VersionRetiredError):
        two.require_usable("viper", 1)
    two.delete_version("viper", 1, **BY)
    assert not weights.exists()


def test_a_version_of_a_key_stays_that_of_the_key_when_it_is_deleted(store, files, draft):
    made = store.publish("viper", files, draft, once_key="job")
    store.publish("viper", files, draft)
    store.delete_version("viper", made.version, **BY)
    assert store.publish("viper", files, draft, once_key="job") == made
    assert store.published_once("viper", "job") == made
    assert store.publish("viper", files, draft).version == 3


@pytest.mark.parametrize("said", [{"actor": "", "reason": ""}, {"actor": "x", "reason": "y" * 4001}])
def test_who_and_why_are_bounded(two, said):
    with pytest.raises(InvalidDraftError):
        two.archive_version("viper", 1, **said)
    assert two.versions("viper") == [1, 2]


def test_datasets_of_retired_versions_stay_in_use(two):
    two.delete_version("viper", 1, **BY)
    two.archive_version("viper", 2, **BY)
    assert two.datasets_in_use() == {"ab" * 32: ["viper@1", "viper@2"]}
