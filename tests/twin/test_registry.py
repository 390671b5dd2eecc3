from __future__ import annotations

import gc
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from model_store import (
    WEIGHTS,
    AliasNotFoundError,
    CorruptArtefactError,
    InvalidReferenceError,
    ModelNotFoundError,
    ModelStore,
    VersionNotFoundError,
)
from service.errors import CheckpointError
from service.learning.checkpoint import weights_bytes
from service.twin import Scenario, TwinRegistry, sample_times
from tests.fair_clock import fair_clock
from tests.twin.published import draft, network_model, publish, publish_champion, zero_model

REFRESH_S = 0.05


@contextmanager
def running(store: ModelStore, default: str = "unit", **options: int) -> Iterator[TwinRegistry]:
    registry = TwinRegistry(store, default, refresh_s=REFRESH_S, **options)
    registry.start()
    try:
        yield registry
    finally:
        registry.close()


def eventually(check: Callable[[], bool], within_s: float = 2.0) -> None:
    """The bar: a moved alias is served within two seconds."""
    with fair_clock() as clock:
        clock.wait_until(check, within_s)


def damage(store: ModelStore, version: int) -> None:
    weights = Path(store.location.removeprefix("file://")) / f"models/unit/versions/{version}/weights.safetensors"
    weights.write_bytes(weights.read_bytes()[:-1])


def test_a_bare_name_an_alias_and_a_number_give_the_same_twin(store):
    publish_champion(store)
    with running(store) as registry:
        assert registry.get().twin is registry.get("unit@champion").twin is registry.get("unit@1").twin
        assert (registry.get("unit").alias, registry.get("unit@1").alias) == ("champion", None)


def test_an_alias_move_is_followed_and_the_old_twin_stays_usable(store):
    publish_champion(store)
    with running(store) as registry:
        old = registry.get().twin
        publish_champion(store, model=zero_model(0.5))
        eventually(lambda: registry.get().twin.version == 2)
        scenario, times = Scenario(5, 430, 60, 4), sample_times(4, 1)
        before, after = old.predict(scenario, times), registry.get().twin.predict(scenario, times)
        assert before.summary.final_x_m > after.summary.final_x_m


@pytest.mark.slow
def test_while_a_version_loads_the_old_one_is_served_without_waiting(store):
    publish_champion(store)
    with running(store) as registry, fair_clock() as clock:
        slowest, stop = [0.0], threading.Event()

        def ask() -> None:
            while not stop.is_set():
                start = clock()
                registry.get()
                slowest[0] = max(slowest[0], clock() - start)

        asking = threading.Thread(target=ask)
        asking.start()
        for seed in range(3):
            version = publish_champion(store, model=network_model(seed)).version
            eventually(lambda version=version: registry.get().twin.version == version)
        stop.set()
        asking.join()
        assert slowest[0] < 0.5


def test_a_broken_new_version_leaves_the_old_one_serving_and_says_so(store):
    publish_champion(store)
    with running(store) as registry:
        broken = publish(store, model=network_model()).version
        damage(store, broken)
        store.move_alias("unit", "champion", broken, actor="a test", reason="does not know better")
        eventually(lambda: bool(registry.status().failures))
        ((reference, reason),) = registry.status().failures
        assert reference == "unit@champion"
        assert "truncated" in reason
        assert registry.get().twin.version == 1
        store.rollback("unit", "champion", actor="a test", reason="broken")
        eventually(lambda: not registry.status().failures)


def test_starts_on_an_empty_store_and_heals(store):
    with running(store) as registry:
        with pytest.raises(ModelNotFoundError):
            registry.get()
        assert registry.status().failures[0][0] == "unit@champion"
        publish_champion(store)
        eventually(lambda: registry.status().resident == ("unit@1",))
        assert registry.get().twin.version == 1


@pytest.mark.slow
def test_resident_twins_are_bounded_and_the_default_stays(store):
    publish_champion(store)
    for seed in range(6):
        publish(store, model=network_model(seed))
    with running(store, capacity=3) as registry:
        default = registry.get().twin
        for version in (2, 3, 4, 5, 6, 7, 2):
            assert registry.get(f"unit@{version}").twin.version == version
            assert len(registry.status().resident) <= 3
        assert registry.get().twin is default


@pytest.mark.slow
def test_what_is_dropped_is_freed(store):
    publish_champion(store)
    for seed in range(3):
        publish(store, model=network_model(seed))
    with running(store, capacity=2) as registry:
        dropped = weakref.ref(registry.get("unit@2").twin.model.correction)
        registry.get("unit@3")
        registry.get("unit@4")
        gc.collect()
        assert dropped() is None


def test_an_alias_whose_twin_was_dropped_loads_it_again(store):
    publish_champion(store)
    for seed in range(2):
        publish(store, model=network_model(seed))
    store.move_alias("unit", "candidate", 2, actor="a test", reason="try")
    with running(store, capacity=2) as registry:
        assert registry.get("unit@candidate").twin.version == 2
        assert registry.get("unit@3").twin.version == 3
        assert registry.get("unit@candidate").twin.version == 2


def test_many_threads_load_a_version_once(store):
    publish_champion(store, model=network_model())
    with running(store) as registry:
        twins: list[object] = []
        threads = [threading.Thread(target=lambda: twins.append(registry.get("unit@1").twin)) for _ in range(16)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert len({id(twin) for twin in twins}) == 1


@pytest.mark.parametrize(
    ("reference", "error"),
    [
        ("nobody", ModelNotFoundError),
        ("unit@9", VersionNotFoundError),
        ("unit@nobody", AliasNotFoundError),
    ],
)
def test_what_is_not_there_is_named(store, reference, error):
    publish_champion(store)
    with running(store) as registry, pytest.raises(error):
        registry.get(reference)


def test_a_whole_version_that_is_no_twin_is_refused_with_its_name(store):
    model = network_model()
    publish_champion(store)
    unfit = draft(model, wheel_motion_resistance="much")
    store.publish("unit", {WEIGHTS: weights_bytes(model)}, unfit)
    with running(store) as registry, pytest.raises(CheckpointError, match=r"unit@2.*wheel_motion_resistance is 'much'"):
        registry.get("unit@2")


def test_damaged_weights_are_refused(store):
    publish_champion(store)
    damage(store, publish(store, model=network_model()).version)
    with running(store) as registry, pytest.raises(CorruptArtefactError, match="truncated"):
        registry.get("unit@2")


class Closed:
    """A store that must not be asked."""

    def __getattr__(self, name: str):
        raise AssertionError(f"the store was asked for {name}")


@pytest.mark.parametrize("reference", [None, "unit", "unit@champion", "unit@1"])
def test_what_is_resident_is_found_without_the_store(store, reference):
    publish_champion(store)
    registry = TwinRegistry(store, "unit")
    assert registry.resident(reference) is None
    loaded = registry.get(reference)
    registry._store = Closed()
    assert registry.resident(reference) == registry.get(reference) == loaded


def test_what_is_not_resident_is_not_looked_for(store):
    publish_champion(store)
    registry = TwinRegistry(store, "unit", capacity=1)
    registry.get()
    assert (registry.resident("unit@2"), registry.resident("nobody"), registry.resident("unit@nobody")) == (None,) * 3
    with pytest.raises(InvalidReferenceError, match="a model"):
        registry.resident("a model")


def test_to_find_a_resident_twin_is_to_use_it(store):
    publish_champion(store)
    second, third = publish(store).version, publish(store).version
    registry = TwinRegistry(store, "unit", capacity=2)
    for version in (second, third):
        registry.get(f"unit@{version}")
    assert registry.resident(f"unit@{second}")
    registry.get(f"unit@{publish(store).version}")
    assert registry.resident(f"unit@{second}") is not None
    assert registry.resident(f"unit@{third}") is None


def test_who_wants_to_know_of_loads_is_told_before_anybody_gets_the_twin(store):
    publish_champion(store)
    told = []
    registry = TwinRegistry(store, "unit", loaded=lambda twin: told.append((twin, registry.resident())))
    twin = registry.get().twin
    registry.get()
    assert told == [(twin, None)]


@pytest.mark.slow
def test_an_unloaded_model_leaves_the_memory_and_comes_back_when_asked(store):
    publish_champion(store)
    publish_champion(store, "other")
    with running(store) as registry:
        gone = weakref.ref(registry.get("other").twin.model.correction)
        registry.get("other@1")
        registry.unload("other")
        time.sleep(3 * REFRESH_S)  # the follower does not bring it back
        gc.collect()
        assert registry.status().resident == ("unit@1",)
        assert gone() is None
        assert registry.get("other@champion").alias == "champion"
        assert registry.status().resident == ("other@1", "unit@1")


def test_the_default_version_is_not_unloaded(store):
    publish_champion(store)
    publish(store)
    with running(store) as registry:
        registry.get("unit@2")
        registry.unload("unit")
        assert registry.status().resident == ("unit@1",)


def test_dropped_versions_are_told_of_and_loads_that_drop_none_are_not(store):
    versions = [publish(store).version for _ in range(3)]
    told = []
    registry = TwinRegistry(store, f"unit@{versions[0]}", capacity=2, released=lambda: told.append(True))

    registry.get(f"unit@{versions[0]}")
    registry.get(f"unit@{versions[1]}")
    assert told == []
    registry.get(f"unit@{versions[2]}")
    assert told == [True]
    registry.unload("unit")
    assert told == [True, True]
