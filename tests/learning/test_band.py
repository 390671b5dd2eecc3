"""The laws of the band, on errors whose law is known."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import safetensors.numpy
from hypothesis import given
from hypothesis import strategies as st

from service.errors import CheckpointError, InvalidValueError
from service.learning.band import LEVELS, Band
from service.learning.domain import Domain
from service.learning.observed import ObservedRun
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.scenario import Positions, Scenarios
from tests.learning.left_out import domain_of, left_out, random_runs, synthetic_band
from tests.learning.synthetic import HORIZON_S, synthetic_runs

RUNS = synthetic_runs()
DOMAIN = domain_of(RUNS)
BAND = synthetic_band()
EVEN = synthetic_band(spread=0.0)  # every run is off by the same: only the distance makes a difference

scenarios = st.builds(Scenarios.of, st.floats(-45, 45), st.floats(1, 10_000), st.floats(0, 10_000))
ways = st.floats(-50, 50).map(lambda reach: _straight(reach))
levels = st.floats(0.5, 0.99)


def _straight(*reaches: float) -> np.ndarray:
    """What the band sees of models that send rovers there at an even speed, shape (reach, look)."""
    return np.outer(reaches, BAND.look_s / BAND.reach_time_s)


def _seen(band: Band, run: ObservedRun, predicted: Positions) -> np.ndarray:
    return np.interp(band.look_s, run.time_s, predicted.x_m[0])[None]


@given(scenarios, ways, levels, st.floats(0.1, 600))
def test_half_widths_are_never_negative_and_never_shrink_with_time(scenario, seen, level, horizon):
    times = np.linspace(0, horizon, 50)

    for half in BAND.half_widths(scenario, times, level, seen):
        assert half.shape == (1, 50)
        assert np.isfinite(half).all()
        assert half.min() >= 0
        assert (np.diff(half) >= -1e-12 * half.max()).all()


@given(scenarios, ways, levels, levels)
def test_a_higher_level_is_never_narrower(scenario, seen, one, other):
    times = np.linspace(0, 3 * HORIZON_S, 20)
    low, high = (BAND.half_widths(scenario, times, level, seen) for level in sorted((one, other)))

    for narrow, wide in zip(low, high, strict=True):
        assert (narrow <= wide * (1 + 1e-12)).all()


@given(scenarios, ways, levels, st.floats(1, 100))
def test_beyond_the_trained_horizon_it_grows_at_least_in_proportion(scenario, seen, level, times_over):
    for half in BAND.half_widths(scenario, np.array([HORIZON_S, times_over * HORIZON_S]), level, seen):
        assert half[0, 1] >= half[0, 0] * times_over * (1 - 1e-9)


def test_x_is_certain_at_the_start_and_y_is_not():
    x, y = BAND.half_widths(Scenarios.of(12, 500, 60), np.array([0.0]), 0.9, _straight(1.0))

    assert x[0, 0] < 1e-5
    assert y[0, 0] > 1e-5


@given(st.floats(0, 20), st.floats(1, 25), st.floats(1, 25))
def test_farther_from_the_runs_it_is_wider(slope, one, other):
    """Along a line of growing mass, away from the heaviest run there is."""
    near, far = (Scenarios.of(slope, 900 * (1 + share), 60 * (1 + share)) for share in sorted((one, other)))
    distances = [DOMAIN.neighbourhood.distances(each).min() for each in (near, far)]
    assert distances[0] <= distances[1]
    widths = [EVEN.half_widths(each, np.array([HORIZON_S]), 0.9, _straight(0.5)) for each in (near, far)]

    for (narrow, wide), inside in zip(zip(*widths, strict=True), _typical(EVEN), strict=True):
        assert inside < narrow <= wide * (1 + 1e-9)


def _typical(band: Band) -> list[float]:
    """Half-widths at one of the runs."""
    at = band.half_widths(Scenarios.of(12, 600, 60), np.array([HORIZON_S]), 0.9, _straight(0.5))
    return [float(each[0, 0]) for each in at]


def test_where_the_model_sends_the_rover_says_what_is_near():
    far = EVEN.half_widths(Scenarios.of(12, 600, 60), np.array([HORIZON_S]), 0.9, _straight(-30.0))

    assert all(each[0, 0] > 2 * inside for each, inside in zip(far, _typical(EVEN), strict=True))


def test_a_rover_that_is_sent_back_first_is_as_doubtful_as_those_that_slide():
    climbs, turns = _straight(0.5), _straight(0.5)
    turns[0, :10] = -3.0

    asked = Scenarios.of(12, 600, 60), np.array([HORIZON_S]), 0.9
    for narrow, wide in zip(EVEN.half_widths(*asked, climbs), EVEN.half_widths(*asked, turns), strict=True):
        assert wide[0, 0] > 1.2 * narrow[0, 0]


def test_a_band_that_was_stored_before_the_lowest_x_counted_does_without_it():
    tensors = BAND.tensors()
    older = {name: each for name, each in BAND.describe().items() if name != "lowest_spread"}
    band = Band.restore(older, tensors | {"places": tensors["places"][:, :-1].copy()}, DOMAIN)
    turns = _straight(0.5)
    turns[0, :10] = -3.0

    asked = Scenarios.of(12, 600, 60), np.array([HORIZON_S]), 0.9
    assert band.look_s.tolist() == [band.reach_time_s]
    for one, other in zip(band.half_widths(*asked, _straight(0.5)), band.half_widths(*asked, turns), strict=True):
        np.testing.assert_array_equal(one, other)
    with pytest.raises(CheckpointError, match="the band does not fit"):
        Band.restore(older, tensors, DOMAIN)


@pytest.fixture(scope="module")
def worlds() -> list[tuple[Band, list, dict[str, Positions]]]:
    """Bands of 150 runs each, and 300 new runs with predictions whose errors follow the law of the old ones."""
    made = []
    for seed in range(4):
        runs, fresh = random_runs(150, seed), random_runs(300, 100 + seed)
        made.append((Band.calibrate(runs, left_out(runs, seed), domain_of(runs)), fresh, left_out(fresh, 100 + seed)))
    return made


@pytest.mark.slow
@pytest.mark.parametrize("level", [0.5, 0.8, 0.9, 0.95])
def test_the_truth_lies_inside_as_often_as_promised(worlds, level):
    shares = []
    for band, fresh, predicted in worlds:
        batch = Scenarios.stack(run.scenario for run in fresh)
        seen = np.concatenate([_seen(band, run, predicted[run.name]) for run in fresh])
        halves = band.half_widths(batch, fresh[0].time_s, level, seen)
        for half, name in zip(halves, ("x_m", "y_m"), strict=True):
            error = np.abs([getattr(predicted[run.name], name)[0] - getattr(run, name) for run in fresh])
            shares.append(np.mean((error <= half)[:, 1:]))

    assert np.mean(shares) == pytest.approx(level, abs=0.035)


@pytest.mark.slow
def test_the_coverage_it_states_is_what_leaving_runs_out_by_hand_gives():
    runs = random_runs(20, 3)
    predicted = left_out(runs, 3)
    # one is unlike all others: a band that knew it would hold it
    predicted[runs[7].name] = Positions(predicted[runs[7].name].x_m + runs[7].time_s, predicted[runs[7].name].y_m)
    stated = Band.calibrate(runs, predicted, domain_of(runs)).coverage
    whole = domain_of(runs)  # coordinates are scaled by all runs: the scale is no result
    shares = []
    for run in runs:
        others = [each for each in runs if each is not run]
        band = Band.calibrate(others, predicted, whole)
        x, _ = band.half_widths(run.scenario, band.time_s, 0.9, _seen(band, run, predicted[run.name]))
        error = np.interp(band.time_s, run.time_s, np.abs(predicted[run.name].x_m[0] - run.x_m))
        shares.append(np.mean((error <= x[0])[1:]))

    assert stated["runs"] == 20
    # not to the last digit: by hand, reaches are scaled by the spread of the other runs
    assert stated["x"]["coverage"] == pytest.approx(np.mean(shares), abs=0.02)
    assert stated["x"]["by_run"]["p05"] == pytest.approx(np.quantile(shares, 0.05), abs=0.01)


def test_the_order_of_the_runs_does_not_matter():
    turned = Band.calibrate(RUNS[::-1], left_out(RUNS), DOMAIN)

    asked = Scenarios.of(17, 500, 70), np.linspace(0, 9, 7), 0.9, _straight(0.7)
    np.testing.assert_allclose(turned.half_widths(*asked), BAND.half_widths(*asked), rtol=1e-9)


def test_a_batch_is_its_scenarios_one_by_one():
    one, other = Scenarios.of(5, 400, 50), Scenarios.of(25, 800, 100)
    times, seen = np.linspace(0, 9, 7), _straight(0.7, -0.1)

    together = BAND.half_widths(Scenarios.stack([one, other]), times, 0.9, seen)

    for at, each in enumerate((one, other)):
        alone = BAND.half_widths(each, times, 0.9, seen[at : at + 1])
        for batch, single in zip(together, alone, strict=True):
            np.testing.assert_allclose(batch[at], single[0], rtol=1e-12)


def test_a_run_that_ended_early_counts_with_what_it_has():
    short = RUNS[0].samples(slice(0, 41))
    runs = [short, *RUNS[1:]]
    band = Band.calibrate(runs, left_out(RUNS) | left_out([short]), domain_of(runs))

    assert band.reach_time_s == short.horizon_s == HORIZON_S / 2
    assert band.time_s[-1] == HORIZON_S


def test_errors_of_zero_give_a_band_of_almost_zero():
    exact = {run.name: Positions(run.x_m[None], run.y_m[None]) for run in RUNS}

    band = Band.calibrate(RUNS, exact, DOMAIN)
    for half in band.half_widths(RUNS[0].scenario, np.array([1.0]), 0.99, _straight(0.0)):
        assert half[0, 0] == 0


@pytest.mark.parametrize("level", [0.49, 0.991, -1, 2, float("nan")])
def test_a_level_that_is_not_offered_is_refused(level):
    with pytest.raises(InvalidValueError, match=r"band_level is .*, allowed is 0.5 to 0.99"):
        BAND.half_widths(Scenarios.of(5, 400, 50), np.array([1.0]), level, _straight(0.0))


def test_what_cannot_be_calibrated_is_refused_by_name():
    predicted = left_out(RUNS)
    name = RUNS[1].name
    with pytest.raises(ValueError, match=f"run {name} has no left-out"):
        Band.calibrate(RUNS, {key: each for key, each in predicted.items() if key != name}, DOMAIN)
    with pytest.raises(ValueError, match=f"x_m of run {name} has values that are not finite"):
        Band.calibrate(RUNS, predicted | {name: Positions(predicted[name].x_m * np.nan, predicted[name].y_m)}, DOMAIN)
    with pytest.raises(ValueError, match=f"y_m of run {name} has shape"):
        Band.calibrate(RUNS, predicted | {name: Positions(predicted[name].x_m, predicted[name].y_m[:, 1:])}, DOMAIN)
    with pytest.raises(ValueError, match="at least 3 runs, got 2"):
        Band.calibrate(RUNS[:2], predicted, DOMAIN)
    with pytest.raises(ValueError, match="knows its training runs"):
        Band.calibrate(RUNS, predicted, replace(DOMAIN, neighbourhood=None))


@given(scenarios, ways, levels)
def test_survives_the_store(scenario, seen, level):
    times = np.linspace(0, 20, 9)

    np.testing.assert_array_equal(
        RESTORED.half_widths(scenario, times, level, seen), BAND.half_widths(scenario, times, level, seen)
    )


def _restored() -> Band:
    domain = Domain.restore(json.loads(json.dumps(DOMAIN.describe())), VIPER, LUNAR_REGOLITH)
    return Band.read(json.loads(json.dumps(BAND.describe())), safetensors.numpy.save(BAND.tensors()), domain)


RESTORED = _restored()


def _with(name: str, change) -> dict[str, np.ndarray]:
    return BAND.tensors() | {name: change(BAND.tensors()[name].copy())}


def _nan(values: np.ndarray) -> np.ndarray:
    values.flat[0] = np.nan
    return values


DAMAGED_TENSORS = {
    "nan": _with("x_envelope_m", _nan),
    "nan places": _with("places", _nan),
    "falling": _with("y_envelope_m", lambda values: values[:, ::-1].copy()),
    "negative": _with("y_envelope_m", lambda values: values - 1),
    "single precision": _with("places", lambda values: values.astype(np.float32)),
    "fewer runs": _with("places", lambda values: values[1:].copy()),
    "fewer coordinates": _with("places", lambda values: values[:, 1:].copy()),
    "fewer times": _with("time_s", lambda values: values[1:].copy()),
    "times fall": _with("time_s", lambda values: values[::-1].copy()),
    "flat": _with("x_envelope_m", lambda values: values.ravel()),
    "missing": {name: values for name, values in BAND.tensors().items() if name != "places"},
}


@pytest.mark.parametrize("tensors", DAMAGED_TENSORS.values(), ids=DAMAGED_TENSORS.keys())
def test_tensors_that_do_not_fit_are_refused(tensors):
    with pytest.raises(CheckpointError, match="the band does not fit"):
        Band.restore(BAND.describe(), tensors, DOMAIN)


DAMAGED_DESCRIPTIONS = {
    "other levels": {"levels": [0.9]},
    "no multipliers": {"multipliers": {}},
    "one axis": {"multipliers": {"x_m": [1.0] * len(LEVELS)}},
    "too few": {"multipliers": {"x_m": [1.0], "y_m": [1.0]}},
    "ragged": {"multipliers": {"x_m": [1.0], "y_m": [1.0, 2.0]}},
    "not finite": {"multipliers": {"x_m": [float("nan")] * len(LEVELS), "y_m": [1.0] * len(LEVELS)}},
    "falling": {"multipliers": {"x_m": list(range(len(LEVELS), 0, -1)), "y_m": [1.0] * len(LEVELS)}},
    "no spacing": {"spacing": 0},
    "text": {"reach_time_s": "soon"},
    "null": {"reach_spread": None},
    "no spread": {"lowest_spread": 0},
    "lowest not counted": {"lowest_spread": None},
}


@pytest.mark.parametrize("change", DAMAGED_DESCRIPTIONS.values(), ids=DAMAGED_DESCRIPTIONS.keys())
def test_a_description_that_does_not_fit_is_refused(change):
    with pytest.raises(CheckpointError, match="the band does not fit"):
        Band.restore(BAND.describe() | change, BAND.tensors(), DOMAIN)


@pytest.mark.parametrize("missing", ["levels", "multipliers", "reach_time_s", "reach_spread", "spacing", "coverage"])
def test_a_missing_part_is_named(missing):
    with pytest.raises(CheckpointError, match=f"'{missing}' is missing"):
        Band.restore({k: v for k, v in BAND.describe().items() if k != missing}, BAND.tensors(), DOMAIN)


@given(st.integers(0, 2000))
def test_a_truncated_file_is_refused(length):
    content = safetensors.numpy.save(BAND.tensors())
    with pytest.raises(CheckpointError, match="cannot be read"):
        Band.read(BAND.describe(), content[: min(length, len(content) - 1)], DOMAIN)


def test_a_domain_that_does_not_know_its_runs_is_refused():
    with pytest.raises(CheckpointError, match="knows its training runs"):
        Band.restore(BAND.describe(), BAND.tensors(), replace(DOMAIN, neighbourhood=None))


def test_half_widths_of_many_are_those_of_each_whatever_the_chunks(monkeypatch):
    rng = np.random.default_rng(4)
    columns = rng.uniform([0, 300, 30], [30, 900, 130], (40, 3))
    every, seen = Scenarios.stack([Scenarios.of(*each) for each in columns]), _straight(*rng.uniform(-1, 3, 40))
    times = rng.uniform(0.1, 3 * HORIZON_S, (40, 1)) * np.linspace(0, 1, 20)
    monkeypatch.setattr("service.learning.neighbourhood._CELLS_AT_ONCE", 500)
    together = BAND.half_widths(every, times, 0.9, seen)
    monkeypatch.undo()

    for row, each in enumerate(columns):
        alone = BAND.half_widths(Scenarios.of(*each), times[row], 0.9, seen[row : row + 1])
        np.testing.assert_allclose([half[row] for half in together], [half[0] for half in alone], rtol=1e-9)
