"""Laws of the doubt: bands hold what they say, open with level, follow the model; probabilities are probabilities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.errors import CheckpointError, InvalidValueError
from service.learning.doubt.doubt import Doubt, OffsetWays, ends_of
from service.learning.doubt.meeting import Meeting
from service.learning.doubt.outcomes import LATE_SPEED_M_S, Class, classes
from service.learning.doubt.stored import describe_doubt, doubt_bytes, read_doubt
from service.learning.edges import Edges
from service.learning.observed import ObservedRun
from service.physics.scenario import Array, Positions, Scenarios
from tests.learning.doubt.pushed import MODEL, made, made_drive, many, models

RUNS = many(60, seed=1)
DOUBT = Doubt.calibrate(RUNS, models(RUNS))
scenarios = st.builds(Scenarios.of, st.floats(-20, 35), st.floats(250, 950), st.floats(0, 130))
levels = st.floats(0.5, 0.99)
TIMES = np.linspace(0.0, 30.0, 61)


def edges_of(scenario: Scenarios, level: float, times: Array = TIMES, doubt: Doubt = DOUBT) -> tuple[Positions, Edges]:
    centre = MODEL.positions(scenario, times)
    seen = MODEL.positions(scenario, doubt.look_s).x_m
    return centre, doubt.edges(MODEL, scenario, times, level, centre, seen)


def chances_of(scenario: Scenarios, horizon_s: float = 10.0, doubt: Doubt = DOUBT) -> Array:
    horizons = np.full(len(scenario), horizon_s)
    seen = MODEL.positions(scenario, doubt.look_s).x_m
    return doubt.probabilities(MODEL, scenario, horizons, ends_of(MODEL, scenario, horizons), seen)


def ways_of(run: ObservedRun) -> OffsetWays:
    """The x of the model's drive with offsets, at some of the run's times."""

    def found(offsets: Sequence[float], time_s: Array) -> Array:
        rows = np.searchsorted(run.time_s, time_s)
        return np.stack([MODEL.drive_run(run, each).x_m[0, rows] for each in offsets])

    return found


@given(scenarios, levels, levels)
def test_the_band_holds_the_model_and_opens_with_the_level(scenario, one, other):
    centre, narrow = edges_of(scenario, min(one, other))
    _, wide = edges_of(scenario, max(one, other))

    for low, high, x in ((narrow.x_low_m, narrow.x_high_m, centre.x_m), (narrow.y_low_m, narrow.y_high_m, centre.y_m)):
        assert np.isfinite(low).all()
        assert (low <= x).all()
        assert (x <= high).all()
    assert (wide.x_low_m <= narrow.x_low_m + 1e-12).all()
    assert (wide.x_high_m >= narrow.x_high_m - 1e-12).all()
    assert (wide.y_high_m >= narrow.y_high_m - 1e-12).all()
    assert narrow.x_low_m[0, 0] == narrow.x_high_m[0, 0] == 0.0


@given(st.builds(Scenarios.of, st.floats(0, 35), st.floats(250, 950), st.floats(20, 130)), levels)
def test_the_band_opens_with_time(scenario, level):
    centre, edges = edges_of(scenario, level)
    widths = edges.x_high_m - edges.x_low_m

    # but for where physics bounds it, and for what ripples allow of a way that is gone back
    assert (np.diff(widths) >= -0.01 * (1.0 + np.abs(centre.x_m).max())).all()


@pytest.mark.parametrize("level", [0.7, 0.9])
def test_it_holds_fresh_runs_as_often_as_it_says(level):
    inside = []
    for run in many(120, seed=2):
        centre = MODEL.drive_run(run)
        if run.varies:
            meeting = Meeting.of_run(run, centre)
            edges = DOUBT.drive_edges(ways_of(run), meeting, level, centre)
        else:
            _, edges = edges_of(run.scenario, level, run.time_s)
        inside.append(((edges.x_low_m[0] <= run.x_m) & (run.x_m <= edges.x_high_m[0])).mean())

    assert level - 0.06 <= np.mean(inside) <= min(level + 0.15, 0.99)


def test_what_it_says_of_left_out_runs_is_what_fresh_ones_show():
    regimes = DOUBT.measured["regimes"]

    assert 0.84 <= DOUBT.measured["levels"]["0.9"] <= 0.98
    assert regimes["drives"]["runs"] == 15
    assert sum(each["runs"] for name, each in regimes.items() if name != "beyond 10 s") == len(RUNS)
    assert all(each["whole"] <= each["pointwise"] for each in regimes.values())


def test_worse_models_are_doubted_more():
    runs = many(60, seed=1, spread=0.02)
    worse = Doubt.calibrate(runs, models(runs))
    climbing = Scenarios.of(10, 500, 80)

    _, narrow = edges_of(climbing, 0.9)
    _, wide = edges_of(climbing, 0.9, doubt=worse)
    assert (wide.x_high_m - wide.x_low_m)[0, -1] > 2.0 * (narrow.x_high_m - narrow.x_low_m)[0, -1]


def test_a_batch_is_what_its_scenarios_are():
    every = Scenarios(np.radians([5.0, 18.0, 31.0, -8.0]), np.array([400.0, 800.0, 500.0, 430.0]), np.full(4, 70.0))
    _, together = edges_of(every, 0.8)
    chances = chances_of(every)

    for row in range(4):
        alone = Scenarios(
            *(column[row : row + 1] for column in (every.slope_angle_rad, every.mass_kg, every.torque_nm))
        )
        _, edges = edges_of(alone, 0.8)
        np.testing.assert_allclose(together.x_low_m[row], edges.x_low_m[0], atol=1e-12)
        np.testing.assert_allclose(together.y_high_m[row], edges.y_high_m[0], atol=1e-12)
        np.testing.assert_allclose(chances[row], chances_of(alone)[0], atol=1e-12)


def test_the_order_of_the_runs_does_not_matter():
    turned = Doubt.calibrate(RUNS[::-1], models(RUNS))
    scenario = Scenarios.of(20, 500, 70)

    np.testing.assert_allclose(edges_of(scenario, 0.9, doubt=turned)[1].x_low_m, edges_of(scenario, 0.9)[1].x_low_m)
    np.testing.assert_allclose(chances_of(scenario, doubt=turned), chances_of(scenario))


@given(scenarios, st.floats(1.0, 60.0))
def test_probabilities_are_probabilities_and_never_certain(scenario, horizon_s):
    chances = chances_of(scenario, horizon_s)

    assert chances.sum() == pytest.approx(1.0)
    assert chances.min() >= 0.5 / (len(RUNS) + 1.5) - 1e-12


@given(st.floats(300, 900), st.floats(40, 120))
@settings(max_examples=20)
def test_steeper_is_never_more_probably_climbed(mass_kg, torque_nm):
    slopes = np.linspace(0.0, 35.0, 71)
    every = Scenarios(np.radians(slopes), np.full(71, mass_kg), np.full(71, torque_nm))
    climbs, _, slides = chances_of(every).T

    # the scale changes with the place, so that this holds but for some percent
    assert (np.diff(climbs) <= 0.06).all()
    assert climbs[0] > 0.9 or climbs[-1] < 0.5
    assert (np.diff(slides) >= -0.06).all()


@given(scenarios)
def test_the_most_probable_outcome_needs_no_probabilities(scenario):
    horizons = np.full(1, 10.0)
    seen, end = MODEL.positions(scenario, DOUBT.look_s).x_m, ends_of(MODEL, scenario, horizons)
    chances = chances_of(scenario)[0]
    likeliest = DOUBT.likeliest(MODEL, scenario, horizons, end, seen)[0]

    assert chances[likeliest] == pytest.approx(chances.max(), abs=5e-3)
    if classes(*end)[0] == Class.STALLS:
        assert likeliest == chances.argmax()


@given(scenarios, st.floats(0.75, 0.98))
def test_what_surely_climbs_climbs_with_that_probability(scenario, confidence):
    horizons = np.full(1, 10.0)
    seen = MODEL.positions(scenario, DOUBT.look_s).x_m
    surely = DOUBT.surely_climbs(MODEL, scenario, horizons, confidence, seen)[0]
    chance = chances_of(scenario)[0, Class.CLIMBS]

    assert surely == (chance >= confidence) or chance == pytest.approx(confidence, abs=0.01)


def test_few_runs_support_no_great_confidence():
    runs = [run for run in RUNS if not run.varies][:5]
    few = Doubt.calibrate(runs, models(runs))
    flat = Scenarios.of(0, 400, 100)
    seen = MODEL.positions(flat, few.look_s).x_m

    assert not few.surely_climbs(MODEL, flat, np.array([10.0]), 0.995, seen)[0]
    assert few.surely_climbs(MODEL, flat, np.array([10.0]), 0.75, seen)[0]


def test_a_rover_below_its_start_never_climbs():
    up, still = 2.0 * LATE_SPEED_M_S, 0.0
    found = classes(np.array([up, up, still, -up]), np.array([0.1, -0.1, -0.1, 0.1]))

    assert found.tolist() == [Class.CLIMBS, Class.SLIDES, Class.STALLS, Class.SLIDES]


def test_a_drive_passes_sticks_or_slides():
    def chances(slope_deg: float) -> Array:
        run = made_drive(slope_deg, 0.0, "one")
        meeting = Meeting.of_run(run, MODEL.drive_run(run))
        return DOUBT.drive_probabilities(ways_of(run), meeting)

    easy, impossible = chances(5.0), chances(40.0)
    assert easy.argmax() == Class.CLIMBS
    assert impossible.argmax() == Class.SLIDES
    assert easy.sum() == pytest.approx(1.0)


def test_a_drive_that_only_brakes_has_a_band():
    run = made_drive(10.0, 0.0, "parked")
    parked = replace(run, controls=replace(run.controls, brake=np.ones(len(run.time_s), dtype=np.bool_)))
    centre = MODEL.drive_run(parked)
    edges = DOUBT.drive_edges(ways_of(parked), Meeting.of_run(parked, centre), 0.9, centre)

    assert np.isfinite(edges.x_low_m).all()
    assert (edges.x_low_m <= centre.x_m).all()


@given(scenarios, levels)
@settings(max_examples=20)
def test_stored_and_restored_it_says_the_same(scenario, level):
    prior = MODEL.prior
    restored = read_doubt(describe_doubt(DOUBT), doubt_bytes(DOUBT), prior.rover, prior.regolith)

    kept, now = edges_of(scenario, level, doubt=restored)[1], edges_of(scenario, level)[1]
    np.testing.assert_allclose(kept.x_low_m, now.x_low_m, rtol=1e-12)
    np.testing.assert_allclose(chances_of(scenario, doubt=restored), chances_of(scenario), rtol=1e-12)
    assert restored.measured == DOUBT.measured


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"levels": [0.5]}, "levels are"),
        ({"settled_s": 0.0}, "must be positive"),
        ({"outcome_spread": float("nan")}, "must be positive"),
        ({"outcome_runs": None}, "the band does not fit"),
    ],
)
def test_a_damaged_description_is_refused(change, complaint):
    with pytest.raises(CheckpointError, match=complaint):
        read_doubt(describe_doubt(DOUBT) | change, doubt_bytes(DOUBT), MODEL.prior.rover, MODEL.prior.regolith)


def test_arrays_that_do_not_fit_are_refused():
    for broken in (
        replace(DOUBT, multipliers=DOUBT.multipliers[:, :, ::-1]),
        replace(DOUBT, multipliers=DOUBT.multipliers[:1]),
        replace(DOUBT, scale=replace(DOUBT.scale, sizes=-DOUBT.scale.sizes)),
        replace(DOUBT, scale=replace(DOUBT.scale, places=DOUBT.scale.places * np.nan)),
    ):
        with pytest.raises(CheckpointError, match="the band does not fit"):
            read_doubt(describe_doubt(DOUBT), doubt_bytes(broken), MODEL.prior.rover, MODEL.prior.regolith)
    with pytest.raises(CheckpointError, match="safetensors"):
        read_doubt(describe_doubt(DOUBT), doubt_bytes(DOUBT)[:50], MODEL.prior.rover, MODEL.prior.regolith)


@pytest.mark.parametrize("level", [0.49, 0.995, float("nan")])
def test_other_levels_are_refused(level):
    with pytest.raises(InvalidValueError, match="band_level"):
        edges_of(Scenarios.of(10, 500, 60), level)


def test_runs_that_cannot_make_it_are_refused():
    with pytest.raises(ValueError, match="at least 3 runs"):
        Doubt.calibrate(RUNS[:2], models(RUNS))
    with pytest.raises(ValueError, match="has no model without it"):
        Doubt.calibrate(RUNS[:3], models(RUNS[:2]))


def test_drives_alone_make_one_too():
    runs = [made_drive(slope, 0.002 * (-1) ** at, f"d{at}") for at, slope in enumerate((2, 8, 14, 20))]
    only = Doubt.calibrate(runs, models(runs))

    assert set(only.measured["regimes"]) == {"drives"}
    assert np.isfinite(edges_of(Scenarios.of(10, 430, 60), 0.9, doubt=only)[1].x_low_m).all()


def test_a_run_that_agrees_with_its_model_leaves_the_ripples_alone():
    exact = [made(Scenarios.of(slope, 500, 80), 0.0, f"r{slope}") for slope in (0, 4, 8, 12, 16, 20)]
    sure = Doubt.calibrate(exact, models(exact))
    _, edges = edges_of(Scenarios.of(10, 500, 80), 0.9, doubt=sure)

    assert (edges.x_high_m - edges.x_low_m).max() < 0.15
