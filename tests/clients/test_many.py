"""Many questions at once against the real service: none fails, none is lost, nothing is left behind."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rover_twin_client import AsyncRoverTwin, Batch, FailedPrediction, InvalidInputError, Prediction, RoverTwin
from rover_twin_client.batch.calls import PIECE_SCENARIOS
from tests.clients.served import served
from tests.digits import HALF

pytestmark = pytest.mark.processes

Ask = Callable[..., Any]
MANY = PIECE_SCENARIOS + 7


@pytest.fixture(scope="module")
def service_url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with served(tmp_path_factory.mktemp("service") / "log.txt") as url:
        yield url


@pytest.fixture(scope="module")
def twin(service_url: str) -> Iterator[RoverTwin]:
    with RoverTwin(service_url) as twin:
        yield twin


def test_a_thousand_predictions_at_once_all_succeed(service_url: str) -> None:
    async def ask() -> list[Prediction]:
        async with AsyncRoverTwin(service_url) as twin:
            return await asyncio.gather(*(twin.predict(each / 40, 430, 60, dt_s=2) for each in range(1000)))

    began = time.perf_counter()
    answers = asyncio.run(ask())

    print(f"1,000 predictions by gather: {time.perf_counter() - began:.1f} s, 0 failed")
    assert [answer.scenario.slope_deg for answer in answers] == [each / 40 for each in range(1000)]


def test_threads_share_a_client_whose_timeout_is_shorter_than_their_wait(service_url: str) -> None:
    with RoverTwin(service_url, connections=2, timeout=5) as twin, ThreadPoolExecutor(64) as pool:
        answers = list(pool.map(lambda each: twin.predict(each / 40, 430, 60, dt_s=2), range(200)))

    assert [answer.scenario.slope_deg for answer in answers] == [each / 40 for each in range(200)]


@pytest.mark.parametrize("more", [{}, {"include": ["band", "prior", "speed", "wheel_speed"]}, {"frame": "world"}])
def test_a_batch_in_pieces_is_as_many_single_predictions(service_url: str, ask: Ask, more: dict[str, Any]) -> None:
    slopes = np.linspace(-5, 44, MANY)
    batch = ask(service_url, "predict_batch", slope_deg=slopes, mass_kg=430, torque_nm=60, dt_s=1, **more)

    assert len(batch) == MANY
    assert not batch.failures
    with RoverTwin(service_url) as twin:
        for at in (0, 1, PIECE_SCENARIOS - 1, PIECE_SCENARIOS, MANY - 1):
            same(batch[at], twin.predict(slopes[at], 430, 60, dt_s=1, **more))


def same(one: Prediction, other: Prediction) -> None:
    """To the digits of JSON, but for what a batch does not know of its domain."""
    found, wanted = one.to_pandas(), other.to_pandas()
    assert list(found) == list(wanted)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=HALF)
    assert (one.model, one.scenario, one.frame) == (other.model, other.scenario, other.frame)
    assert one.summary.outcome == other.summary.outcome
    numbers = [
        [each.final_x_m, each.final_y_m, each.distance_m, each.slip_ratio] for each in (one.summary, other.summary)
    ]
    np.testing.assert_allclose(*np.array(numbers, dtype=float), rtol=1e-9)
    assert [each.field for each in one.domain.reasons] == [each.field for each in other.domain.reasons]
    assert one.domain.inside == other.domain.inside
    assert one.domain.distance == pytest.approx(other.domain.distance)


def test_horizons_and_times_of_their_own(twin: RoverTwin) -> None:
    horizons = [3.0, 10.0, 5.5]
    batch = twin.predict_batch(slope_deg=20, mass_kg=430, torque_nm=60, horizon_s=horizons)
    timed = twin.predict_batch(slope_deg=[20, 21], mass_kg=430, torque_nm=60, times_s=[0, 0.5, 2.5])

    assert batch.time_s.shape == batch.x_m.shape
    for at, horizon in enumerate(horizons):
        same(batch.predictions[at], twin.predict(20, 430, 60, horizon))
    assert timed.time_s.tolist() == [0, 0.5, 2.5]
    same(timed.predictions[1], twin.predict(21, 430, 60, times_s=[0, 0.5, 2.5]))
    assert timed.horizon_s.tolist() == [2.5, 2.5]


def test_refused_scenarios_keep_their_places_and_are_named(twin: RoverTwin) -> None:
    masses = [430, -1, np.nan, 430, np.inf] + [430] * MANY
    batch = twin.predict_batch(slope_deg=20, mass_kg=masses, torque_nm=60, dt_s=1)

    assert [failure.index for failure in batch.failures] == [1, 2, 4]
    assert [isinstance(each, FailedPrediction) for each in batch[:5]] == [False, True, True, False, True]
    assert batch.failures[0].faults[0].field == "scenarios[1].mass_kg"
    assert batch.failures[0].detail == "scenarios[1].mass_kg is -1.0, allowed is 1 to 10000"
    assert batch.failures[1].detail.startswith("scenarios[2].mass_kg is nan, which is no number")
    assert np.isnan(batch.x_m[1]).all()
    assert np.isfinite(batch.x_m[3]).all()
    table = batch.to_pandas()
    assert table["error"][1] == batch.failures[0].detail
    assert (table["error"] == "").sum() == len(masses) - 3
    assert len(batch.to_pandas(per="time")) == (len(masses) - 3) * 11


def test_an_unreadable_scenario_among_many_sinks_no_other(twin: RoverTwin) -> None:
    rows: list[Any] = [{"slope_deg": 20, "mass_kg": 430, "torque_nm": 60} for _ in range(MANY)]
    rows[3], rows[-1] = 7, {**rows[0], "torque_nm": "x"}
    rows[4] = {**rows[0], "horizon_s": np.nan}
    batch = twin.predict_batch(rows, dt_s=1)

    assert [failure.index for failure in batch.failures] == [3, 4, MANY - 1]
    assert batch.failures[-1].detail == f"scenarios[{MANY - 1}].torque_nm is 'x', allowed is a number"
    assert batch.slope_deg[4] == 20
    assert np.flatnonzero(np.isnan(batch.final_x_m)).tolist() == [3, 4, MANY - 1]
    again = twin.predict_batch(batch.to_pandas(), dt_s=1)
    np.testing.assert_array_equal(again.x_m, batch.x_m)


def test_a_batch_of_which_every_scenario_is_refused_is_an_answer(twin: RoverTwin) -> None:
    batch = twin.predict_batch(slope_deg=[50, 60], mass_kg=430, torque_nm=60)

    assert len(batch) == len(batch.failures) == 2
    assert batch.predictions == []
    assert len(batch.to_pandas()) == 2
    assert "2 refused" in repr(batch)
    assert batch._repr_html_()


def test_scenarios_may_be_rows_columns_or_tables(twin: RoverTwin) -> None:
    import pandas as pd
    import polars as pl

    columns = {"slope_deg": [10.0, 20.0], "mass_kg": [430.0, 500.0], "torque_nm": [60.0, 70.0]}
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    first = twin.predict_batch(rows)
    kinds = [columns, pd.DataFrame(columns), pl.DataFrame(columns), (each.scenario for each in first.predictions)]

    for kind in kinds:
        np.testing.assert_array_equal(twin.predict_batch(kind).x_m, first.x_m)


def test_progress_counts_to_the_end(service_url: str, ask: Ask) -> None:
    told: list[tuple[int, int]] = []
    ask(
        service_url, "predict_batch", slope_deg=np.linspace(0, 20, 3 * MANY), mass_kg=430, torque_nm=60, dt_s=5,
        progress=lambda done, total: told.append((done, total)),
    )  # fmt: skip

    assert [done for done, _ in told] == sorted(done for done, _ in told)
    assert told[-1] == (3 * MANY, 3 * MANY)
    assert len(told) > 1


def test_a_cancelled_batch_leaves_no_task_and_the_client_goes_on(service_url: str) -> None:
    async def cancel() -> tuple[int, Prediction]:
        async with AsyncRoverTwin(service_url) as twin:
            before = len(asyncio.all_tasks())
            slopes = np.linspace(0, 20, 20 * MANY)
            started = asyncio.Event()
            batch = asyncio.create_task(
                twin.predict_batch(
                    slope_deg=slopes, mass_kg=430, torque_nm=60, dt_s=5, progress=lambda *_: started.set()
                )
            )
            await started.wait()
            batch.cancel()
            with pytest.raises(asyncio.CancelledError):
                await batch
            return len(asyncio.all_tasks()) - before, await twin.predict(28, 430, 60)

    left, prediction = asyncio.run(cancel())

    assert left == 0
    assert prediction.summary.outcome == "climbs"


def test_a_failure_of_all_is_raised_once_and_leaves_no_thread(twin: RoverTwin) -> None:
    before = threading.active_count()
    with pytest.raises(InvalidInputError, match="dt_s is -1"):
        twin.predict_batch(slope_deg=np.zeros(3 * MANY), mass_kg=430, torque_nm=60, dt_s=-1)

    assert threading.active_count() == before


def test_pieces_shrink_to_the_limits_that_an_operator_set(tmp_path: Path) -> None:
    limits = {"ROVER_TWIN_MAX_POINTS": "2000", "ROVER_TWIN_MAX_BODY_BYTES": "8192"}
    with served(tmp_path / "log.txt", **limits) as url, RoverTwin(url) as twin:
        slopes = np.linspace(0, 20, 300)
        batch: Batch = twin.predict_batch(slope_deg=slopes, mass_kg=430, torque_nm=60)

        assert not batch.failures
        same(batch.predictions[299], twin.predict(20, 430, 60))
        with pytest.raises(InvalidInputError, match="dt_s is"):
            twin.predict_batch(slope_deg=slopes, mass_kg=430, torque_nm=60, dt_s=0.001)
