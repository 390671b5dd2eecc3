"""Random histories: whatever is done in whatever order, the store agrees with a plain Python model of it."""

from __future__ import annotations

import tempfile

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from model_store import ConflictError, DatasetDraft, Lineage, ManifestDraft, ModelStore, NotFoundError

# few of each: a history gets interesting when it comes back to the same alias
NAMES = st.sampled_from(["viper", "viper-lunar"])
ALIASES = st.sampled_from(["champion", "candidate"])
NUMBERS = st.integers(1, 4)
SAID = {"actor": "hypothesis", "reason": ""}


class Histories(RuleBasedStateMachine):
    url = "memory://"

    def __init__(self):
        super().__init__()
        self.store = ModelStore.open(self.url)
        self.versions: dict[str, list[bytes]] = {}
        self.trails: dict[tuple[str, str], list[int]] = {}  # the undo stack of each alias
        self.moves: dict[tuple[str, str], list[int]] = {}  # every version it ever had, in order
        self.datasets: dict[str, bytes] = {}

    @initialize()
    def begin_with_three_versions(self):
        for weights in (b"1", b"2", b"3"):
            self.publish("viper", weights)

    @rule(name=NAMES, weights=st.binary(max_size=20))
    def publish(self, name, weights):
        draft = ManifestDraft(created_by="x", checkpoint={}, domain={}, metrics={}, lineage=Lineage())
        manifest = self.store.publish(name, {"weights.safetensors": weights}, draft)
        self.versions.setdefault(name, []).append(weights)
        assert manifest.version == len(self.versions[name])

    @rule(name=NAMES, alias=ALIASES, version=NUMBERS)
    def move(self, name, alias, version):
        if version > len(self.versions.get(name, [])):
            with pytest.raises(NotFoundError):
                self.store.move_alias(name, alias, version, **SAID)
            return
        self.store.move_alias(name, alias, version, **SAID)
        trail = self.trails.setdefault((name, alias), [])
        if trail[-1:] != [version]:
            trail.append(version)
        self.moves.setdefault((name, alias), []).append(version)

    @rule(name=NAMES, alias=ALIASES)
    def rollback(self, name, alias):
        trail = self.trails.get((name, alias), [])
        if len(trail) < 2:
            with pytest.raises((ConflictError, NotFoundError)):
                self.store.rollback(name, alias, **SAID)
            return
        trail.pop()
        assert self.store.rollback(name, alias, **SAID).version == trail[-1]
        self.moves[name, alias].append(trail[-1])

    @rule(key=st.sampled_from("ab"))
    def put_dataset(self, key):
        self.store.put_dataset(key * 64, {"x": key.encode()}, DatasetDraft(name=key, created_by="x"))
        self.datasets[key * 64] = key.encode()

    @precondition(lambda self: self.versions)
    @rule(name=NAMES, version=NUMBERS)
    def read(self, name, version):
        known = self.versions.get(name, [])
        if version <= len(known):
            assert self.store.read_file(self.store.manifest(name, version), "weights.safetensors") == known[version - 1]
            assert self.store.resolve(f"{name}@{version}").version == version
        else:
            with pytest.raises(NotFoundError):
                self.store.resolve(f"{name}@{version}")

    @invariant()
    def lists_agree(self):
        assert self.store.model_names() == sorted(self.versions)
        assert self.store.dataset_ids() == sorted(self.datasets)
        for name, published in self.versions.items():
            assert self.store.versions(name) == list(range(1, len(published) + 1))
            expected = {alias: moves[-1] for (model, alias), moves in self.moves.items() if model == name}
            assert {alias: record.version for alias, record in self.store.aliases(name).items()} == expected

    @invariant()
    def histories_agree(self):
        for (name, alias), moves in self.moves.items():
            assert [record.version for record in self.store.alias_history(name, alias)] == moves
            assert self.store.resolve(f"{name}@{alias}").version == self.trails[name, alias][-1]


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["memory", "directory"])
def test_any_history_agrees_with_the_model(backend):
    class OnADirectory(Histories):
        def __init__(self):
            self.folder = tempfile.TemporaryDirectory()
            self.url = self.folder.name
            super().__init__()

        def teardown(self):
            self.folder.cleanup()

    run_state_machine_as_test(
        Histories if backend == "memory" else OnADirectory,
        settings=settings(
            max_examples=60 if backend == "memory" else 10,
            stateful_step_count=40,
            deadline=None,
            derandomize=True,
            database=None,
            suppress_health_check=[HealthCheck.too_slow],
        ),
    )
