"""The same answers without a server, and without anything of one."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.errors import InvalidValueError
from service.local import LocalTwin, load

TRACK = {"distance_m": [0, 2, 2.3], "slope_deg": [10, 10, 20]}


@pytest.fixture(scope="module")
def twin() -> LocalTwin:
    return load("viper-lunar")


def test_the_shipped_champion_answers(twin: LocalTwin) -> None:
    found = twin.predict(slope_deg=28, mass_kg=430, torque_nm=60, include=["band", "speed"])

    assert found.summary.outcome == "climbs"
    assert found.band is not None
    assert found.trajectory["speed_m_s"].shape == (201,)


@given(slope=st.floats(-20, 28), mass=st.floats(310, 880), torque=st.floats(0, 125), horizon=st.floats(0.5, 25))
def test_a_constant_drive_is_a_prediction(
    twin: LocalTwin, slope: float, mass: float, torque: float, horizon: float
) -> None:
    times = np.linspace(0.0, horizon, 9)
    predicted = twin.predict(slope, mass, torque, times_s=times).trajectory
    driven = twin.drive(mass, {"distance_m": [0], "slope_deg": [slope]}, torque, times_s=times).trajectory

    np.testing.assert_allclose(driven["x_m"], predicted["x_m"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(driven["y_m"], predicted["y_m"], rtol=0, atol=1e-9)


@given(slope=st.floats(-20, 28), mass=st.floats(310, 880), torque=st.floats(0, 125), dt=st.floats(0.003, 0.7))
def test_steps_go_where_the_prediction_goes(
    twin: LocalTwin, slope: float, mass: float, torque: float, dt: float
) -> None:
    live = twin.live()
    live.start("rover", mass_kg=mass, slope_deg=slope)
    for _ in range(12):
        found = live.step("rover", slope_deg=slope, torque_nm=torque, dt_s=dt)
    whole = twin.predict(slope, mass, torque, times_s=[float(found.time_s[0])]).trajectory

    assert abs(found.x_m[0] - whole["x_m"][0]) < 1e-9


def test_a_torque_and_controls_of_one_time_are_the_same(twin: LocalTwin) -> None:
    one = twin.drive(430, TRACK, 100, horizon_s=5)
    other = twin.drive(430, TRACK, {"time_s": [0], "torque_nm": [100], "brake": [False]}, horizon_s=5)

    assert one.summary == other.summary


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"track": {"distance_m": [0]}}, "track"),
        ({"track": 10}, "track"),
        ({"track": {"distance_m": [0, 0], "slope_deg": [1, 2]}}, "track.distance_m"),
        ({"controls": {"torque_nm": [1]}}, "controls.time_s"),
        ({"controls": {"time_s": [0], "torque_nm": [1], "brake": ["false"]}}, "controls.brake"),
        ({"mass_kg": "x"}, "mass_kg"),
        ({"mass_kg": float("nan")}, "mass_kg"),
        ({"dt_s": 1e-9}, "dt_s"),
        ({"controls": None}, "controls"),
        ({"track": {"distance_m": 5, "slope_deg": [1]}}, "track.distance_m"),
        ({"track": {"distance_m": [0], "slope_deg": [80]}}, "track.slope_deg"),
        ({"controls": -1}, "controls"),
        ({"frame": "moon"}, "frame"),
        ({"include": ["prior"]}, "include"),
        ({"times_s": [2, 1]}, "times_s"),
        ({"mass_kg": -1}, "mass_kg"),
        ({"horizon_s": 1e9}, "horizon_s"),
    ],
)
def test_what_cannot_be_is_named(twin: LocalTwin, arguments: dict[str, object], field: str) -> None:
    with pytest.raises(InvalidValueError) as refused:
        twin.drive(**({"mass_kg": 430, "track": TRACK, "controls": 100} | arguments))  # type: ignore[arg-type]
    assert refused.value.field == field


@pytest.mark.processes
def test_nothing_of_a_server_is_loaded() -> None:
    ask = (
        "import sys; from service.local import load; "
        "load().drive(430, {'distance_m': [0], 'slope_deg': [10]}, 100); "
        "print({'fastapi', 'starlette', 'uvicorn', 'torch', 'dbos', 'httpx'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, timeout=60, check=True)

    assert done.stdout.strip() == "set()"
