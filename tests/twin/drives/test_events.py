"""Events on ways that are made by hand, and on drives that must have them."""

from __future__ import annotations

import numpy as np
import pytest

from service.learning.drive.engine import Motion
from service.twin.drives import DriveQuestion, EventName, Ground, Wanted, controls_of, drive
from service.twin.drives.events import MOST_EVENTS, events_of
from service.twin.drives.way import Way
from tests.twin.drives.made import champion


def way_of(speed) -> Way:
    """A way with a speed (m/s) as a function of time, exactly integrated."""
    time = np.linspace(0.0, 20.0, 401)
    fine = np.linspace(0.0, 20.0, 80_001)
    x = np.concatenate([[0.0], np.cumsum(0.5 * (speed(fine[1:]) + speed(fine[:-1])) * np.diff(fine))])[::200]
    nothing = np.zeros(401)
    return Way(time, Motion(x, speed(time), nothing, nothing, nothing, nothing))


def names_of(way: Way, driven: bool | np.ndarray = True) -> list[tuple[str, float]]:
    flags = np.broadcast_to(driven, way.time_s.shape)
    return [(each.event.value, each.time_s) for each in events_of(way, flags, 0.64, None, False)[0]]


def test_it_sticks_when_it_gets_slow_and_goes_on_when_it_gets_fast():
    found = names_of(way_of(lambda t: 0.2 * np.cos(np.pi * t / 20.0) ** 2 + 0.0))  # slow around 10 s

    slow = 20.0 / np.pi * np.arccos(np.sqrt(0.015 / 0.2))
    assert [name for name, _ in found] == ["sticks", "goes_on"]
    assert found[0][1] == pytest.approx(slow, abs=1e-3)
    assert found[1][1] == pytest.approx(20.0 - slow, abs=1e-3)


def test_without_motors_it_does_not_stick():
    assert names_of(way_of(lambda t: 0.2 * np.cos(np.pi * t / 20.0) ** 2), driven=False) == []


def test_it_slides_with_and_without_motors():
    for driven in (True, False):
        found = names_of(way_of(lambda t: 0.1 - 0.02 * t), driven)
        assert [name for name, _ in found] == ["sticks"] * driven + ["slides"]
        assert found[-1][1] == pytest.approx(5.75, abs=1e-6)


def test_a_moment_of_trouble_is_none():
    assert names_of(way_of(lambda t: np.where((t > 5) & (t < 5.4), -0.1, 0.3))) == []
    assert names_of(way_of(lambda t: np.where((t > 5) & (t < 5.8), 0.0, 0.3))) == []


def test_one_that_never_starts_sticks_from_the_start():
    assert names_of(way_of(lambda t: 0.0 * t)) == [("sticks", 0.0)]


def test_many_events_are_cut_and_counted():
    way = way_of(lambda t: 0.1 * np.sin(2.0 * np.pi * t / 2.0))
    time, speed = np.linspace(0.0, 400.0, 8001), np.tile(way.motion.speed_m_s[:400], 20)
    speed = np.append(speed, speed[0])
    x = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * 0.05)])
    long = Way(time, Motion(x, speed, speed, speed, speed, speed))
    kept, left_out = events_of(long, np.ones(8001, dtype=np.bool_), 0.64, None, True)

    assert len(kept) == MOST_EVENTS + 1
    assert kept[-1].event is EventName.ARRIVES
    assert len(kept) - 1 + left_out == pytest.approx(400, abs=2)


def test_the_middle_passes_the_last_knot():
    ground = Ground.of_slopes([0, 2, 4], [10, 15, 12])
    question = DriveQuestion(430, ground, controls_of([0], [80]))
    found = drive(champion(), question, Wanted())
    passes = next(each for each in found.events if each.event is EventName.PASSES)
    fine = drive(
        champion(),
        DriveQuestion(430, ground, controls_of([0], [80])),
        Wanted(times_s=np.array([0.0, passes.time_s, 20.0])),
    )

    assert passes.x_m == pytest.approx(4.0 - 0.5 * champion().model.prior.rover.wheelbase_m)
    assert fine.trajectory["x_m"][1] == pytest.approx(passes.x_m, abs=1e-6)


def test_a_rover_that_loses_its_motors_uphill_slides_and_goes_on():
    controls = controls_of([0, 6, 9], [90, 0, 90])
    found = drive(champion(), DriveQuestion(430, Ground.constant(24), controls), Wanted())

    assert [each.event for each in found.events] == [EventName.SLIDES, EventName.GOES_ON]
    assert 6.0 < found.events[0].time_s < 9.0 < found.events[1].time_s


def test_a_brake_is_no_sticking():
    controls = controls_of([0, 6, 9], [90, 0, 90], [False, True, False])
    found = drive(champion(), DriveQuestion(430, Ground.constant(10), controls), Wanted())

    assert [each.event for each in found.events] == []


def test_a_track_that_gets_too_steep_is_where_it_sticks_or_slides():
    ground = Ground.of_slopes([0, 4, 5], [10, 10, 40])
    found = drive(champion(), DriveQuestion(430, ground, controls_of([0], [60])), Wanted())

    assert {each.event for each in found.events} & {EventName.STICKS, EventName.SLIDES}
    assert found.events[0].x_m == pytest.approx(4.0, abs=1.5)
