from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.learning.domain import FIELDS, Domain, DomainReason
from service.learning.observed import Controls
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.scenario import Scenarios
from tests.learning.synthetic import HORIZON_S, synthetic_run, synthetic_runs

DOMAIN = Domain.of_runs(synthetic_runs(), VIPER, LUNAR_REGOLITH)


def test_every_training_run_is_inside():
    for run in synthetic_runs():
        verdict = DOMAIN.judge(run.slope_deg, run.mass_kg, run.torque_nm, run.horizon_s)
        assert verdict.inside
        assert verdict.reasons == ()


@pytest.mark.parametrize(
    ("scenario", "fields"),
    [
        ((21, 430, 60, 4), ["slope_deg"]),
        ((-1, 430, 60, 4), ["slope_deg"]),
        ((10, 950, 60, 4), ["mass_kg", "torque_ratio"]),
        ((10, 430, 60, 4.5), ["horizon_s"]),
        ((10, 430, 130, 4), ["torque_nm", "torque_ratio"]),
        # mass and torque are each inside, but no run had so much torque for so little mass
        ((10, 300, 120, 4), ["torque_ratio"]),
    ],
)
def test_what_is_outside_is_named(scenario, fields):
    verdict = DOMAIN.judge(*scenario)
    assert not verdict.inside
    assert [reason.field for reason in verdict.reasons] == fields


def test_a_reason_says_how_far():
    (reason,) = DOMAIN.judge(21.5, 430, 60, HORIZON_S).reasons
    assert reason.detail == "slope_deg 21.5 deg is 1.5 deg above the training runs (0 to 20 deg)"


def test_a_reason_writes_no_exponents():
    far = DomainReason("mass_kg", 5000.0, 302.9, 892.1)
    near = DomainReason("slope_deg", 20.00002, 0.0, 20.0)

    assert far.detail == "mass_kg 5000 kg is 4110 kg above the training runs (302.9 to 892.1 kg)"
    assert near.detail == "slope_deg 20 deg is 0.00002 deg above the training runs (0 to 20 deg)"


def test_survives_json():
    restored = Domain.restore(json.loads(json.dumps(DOMAIN.describe())), VIPER, LUNAR_REGOLITH)
    assert restored.describe() == DOMAIN.describe()


@pytest.mark.parametrize("description", [{}, {"slope_deg": [1]}, {**DOMAIN.describe(), "mass_kg": [5, 1]}])
def test_a_description_that_does_not_fit_is_refused(description):
    with pytest.raises((KeyError, IndexError, ValueError)):
        Domain.restore(description, VIPER, LUNAR_REGOLITH)


def gap_domain() -> Domain:
    """Light rovers on gentle slopes, heavy ones on steep slopes, nothing between them or across."""
    light = [synthetic_run(slope, mass, mass / 6) for slope in (0, 2, 4, 6) for mass in (300, 330, 360)]
    heavy = [synthetic_run(slope, mass, mass / 6) for slope in (24, 26, 28, 30) for mass in (800, 850, 900)]
    return Domain.of_runs([*light, *heavy], VIPER, LUNAR_REGOLITH, {light[0].name: 0.02})


def test_a_combination_that_no_run_is_near_is_outside_though_every_input_is_inside():
    verdict = gap_domain().judge(30, 300, 50, 4)

    (reason,) = verdict.reasons
    assert not verdict.inside
    assert reason.field == "joint"
    assert reason.value == verdict.distance > reason.highest
    assert f"{verdict.distance - reason.highest:.3g} above what separates neighbouring runs" in reason.detail


def test_the_joint_limit_is_what_leaving_runs_out_shows():
    known = gap_domain().neighbourhood
    gaps = []
    for at, run in enumerate(known.runs):
        distances = known.distances(Scenarios.of(run.slope_deg, run.mass_kg, run.torque_nm))[0]
        gaps.append(np.delete(distances, at).min())

    assert known.limit == pytest.approx(np.quantile(gaps, 0.99))


@given(st.floats(-45, 45), st.floats(1, 10_000), st.floats(0, 10_000))
def test_the_nearest_runs_come_nearest_first_and_the_distance_is_the_first_ones(slope, mass, torque):
    verdict = DOMAIN.judge(slope, mass, torque, 1)

    distances = [run.distance for run in verdict.nearest_runs]
    assert len(distances) == 3
    assert distances == sorted(distances)
    assert verdict.distance == distances[0]
    assert np.isfinite(distances).all()
    everyone = DOMAIN.neighbourhood.distances(Scenarios.of(slope, mass, torque))[0]
    assert distances == pytest.approx(np.sort(everyone)[:3])


@given(st.floats(-45, 45), st.floats(50, 2000), st.floats(0, 300))
def test_of_runs_that_are_equally_near_the_first_comes_first(slope, mass, torque):
    known = DOMAIN.neighbourhood
    again = [replace(run, run=f"{run.run} again") for run in known.runs]
    twice = replace(known, runs=(*known.runs, *again))
    order, distances = twice.nearest_many(twice.places_of(slope, mass, torque)[np.newaxis])

    assert twice.nearest_to(twice.place_of(slope, mass, torque)) == twice.nearest_runs(order[0], distances[0])


def test_a_training_run_is_its_own_nearest_and_tells_its_left_out_error():
    domain = gap_domain()
    known, unknown = domain.judge(0, 300, 50, 4).nearest_runs[0], domain.judge(30, 900, 150, 4).nearest_runs[0]

    assert (known.run, known.distance, known.left_out_final_error_m) == ("s0_m300_t50", pytest.approx(0), 0.02)
    assert (unknown.run, unknown.left_out_final_error_m) == ("s30_m900_t150", None)


def test_a_lone_run_is_inside_its_own_domain_and_nothing_else_is():
    domain = Domain.of_runs([synthetic_run(12.34567)], VIPER, LUNAR_REGOLITH)

    assert domain.judge(12.34567, 430, 60, 1).inside
    assert not domain.judge(12.4, 430, 60, 1).inside


def test_a_domain_from_before_the_runs_were_kept_still_judges_input_by_input():
    old = {field: DOMAIN.describe()[field] for field in FIELDS}
    restored = Domain.restore(old, VIPER, LUNAR_REGOLITH)
    verdict = restored.judge(21, 430, 60, 4)

    assert restored.describe() == old
    assert [reason.field for reason in verdict.reasons] == ["slope_deg"]
    assert verdict.distance is None
    assert verdict.nearest_runs == ()


@pytest.mark.parametrize(
    "change",
    [
        {"runs": []},
        {"runs": [{"run": "a"}]},
        {"runs": [{"run": "a", "slope_deg": 1, "mass_kg": -1, "torque_nm": 1, "left_out_final_error_m": None}]},
        {"runs": [{"run": "a", "slope_deg": 1, "mass_kg": 1, "torque_nm": 1, "left_out_final_error_m": -1}]},
        {"runs": [{"run": "a", "slope_deg": float("nan"), "mass_kg": 1, "torque_nm": 1, "left_out_final_error_m": 0}]},
        {"scales": {"slope_deg": 1}},
        {"scales": {"slope_deg": 0, "log_torque_ratio": 1, "log_mass_kg": 1}},
        {"joint_limit": float("inf")},
        {"joint_limit": None},
    ],
)
def test_runs_that_do_not_fit_are_refused(change):
    with pytest.raises((KeyError, TypeError, ValueError)):
        Domain.restore(DOMAIN.describe() | change, VIPER, LUNAR_REGOLITH)


@pytest.mark.slow
@given(st.lists(st.tuples(st.floats(-45, 45), st.floats(50, 2000), st.floats(0, 300), st.floats(0, 9)), max_size=30))
def test_many_verdicts_are_those_of_each(asked):
    for domain in (
        DOMAIN,
        gap_domain(),
        Domain.restore({f: DOMAIN.describe()[f] for f in FIELDS}, VIPER, LUNAR_REGOLITH),
    ):
        columns = np.array(asked, dtype=np.float64).reshape(-1, 4).T
        verdicts = domain.judge_many(*columns)

        assert len(verdicts) == len(asked)
        assert np.array_equal(domain.inside_many(*columns), verdicts.inside)
        for row, one in enumerate(asked):
            alone = domain.judge(*one)
            assert verdicts[row].inside == verdicts.inside[row] == alone.inside
            assert [each.field for each in verdicts[row].reasons] == [each.field for each in alone.reasons]
            assert [each.run for each in verdicts[row].nearest_runs] == [each.run for each in alone.nearest_runs]
            assert verdicts[row].distance == pytest.approx(alone.distance)


def test_chunks_do_not_show_in_verdicts(monkeypatch):
    columns = np.random.default_rng(2).uniform([0, 300, 30, 1], [30, 900, 130, 5], (50, 4)).T
    whole = DOMAIN.judge_many(*columns)
    monkeypatch.setattr("service.learning.neighbourhood._CELLS_AT_ONCE", 40)
    parts = DOMAIN.judge_many(*columns)

    assert [parts[row] for row in range(50)] == [whole[row] for row in range(50)]


def drive(slopes_deg, torques_nm, brake=None):
    run = synthetic_run(10)
    ramp = np.linspace(0.0, 1.0, len(run.time_s))
    slopes, torques = (low + (high - low) * ramp for low, high in (slopes_deg, torques_nm))
    return replace(run, name="drive", controls=Controls(np.radians(slopes), torques, brake))


def test_a_drive_covers_what_it_goes_through_and_is_no_neighbour():
    domain = Domain.of_runs([*synthetic_runs(), drive((-12.0, 27.0), (10.0, 150.0))], VIPER, LUNAR_REGOLITH)
    assert domain.spans["slope_deg"] == (-12.0, 27.0)
    assert domain.spans["torque_nm"] == (10.0, 150.0)
    assert domain.neighbourhood.describe() == DOMAIN.neighbourhood.describe()


def test_drives_alone_leave_a_domain_without_neighbours():
    domain = Domain.of_runs([drive((0.0, 20.0), (40.0, 80.0))], VIPER, LUNAR_REGOLITH)
    assert domain.neighbourhood is None
    assert domain.judge(10.0, 430.0, 60.0, HORIZON_S).inside
    assert Domain.restore(json.loads(json.dumps(domain.describe())), VIPER, LUNAR_REGOLITH).spans == domain.spans


def test_a_drive_is_inside_while_all_it_goes_through_is():
    assert all(DOMAIN.holds_run(run) for run in synthetic_runs())
    assert DOMAIN.holds_run(drive((0.0, 20.0), (40.0, 80.0)))
    assert not DOMAIN.holds_run(drive((0.0, 20.5), (40.0, 80.0)))
    assert not DOMAIN.holds_run(drive((0.0, 20.0), (0.0, 80.0)))


def test_what_motors_would_give_counts_only_while_the_brake_is_off():
    released = np.linspace(0.0, 1.0, 81) >= 0.5
    domain = Domain.of_runs([drive((10.0, 10.0), (0.0, 80.0), brake=~released)], VIPER, LUNAR_REGOLITH)
    assert domain.spans["torque_nm"] == (40.0, 80.0)
