"""What an FMU refuses, and what it says then: the rules that importers trip over."""

from __future__ import annotations

import ctypes
import math
from urllib.parse import quote

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.fmu.variables import REFERENCES, VARIABLES, Role
from tests.fmu.rovers import NUMBERS, WARNING, Rover


@pytest.fixture
def rover(made):
    rover = Rover(made)
    yield rover
    rover.close()


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        *(("slope_deg", value, "-45 to 45 deg") for value in (45.000001, -60.0, math.nan, math.inf, -math.inf, 1e300)),
        *(("torque_nm", value, "0 to 10000 N m") for value in (-1e-9, 10001.0, math.nan, math.inf)),
        *(("mass_kg", value, "1 to 10000 kg") for value in (0.0, 0.999, -430.0, math.nan, math.inf, 1e5)),
        *(("start_speed_m_s", value, "-5 to 5 m/s") for value in (5.1, -6.0, math.nan, math.inf)),
    ],
)
def test_numbers_that_cannot_be_are_refused_and_change_nothing(rover, name, value, allowed):
    rover.enter()
    before = rover.get()
    message = rover.refusal(rover.set, **{name: value})
    assert f"{name} is " in message
    assert f"allowed is {allowed}" in message
    assert rover.get() == before
    rover.exit()


def test_of_several_values_none_is_set_where_one_is_refused(rover):
    rover.begin()
    rover.refusal(rover.set, torque_nm=50.0, slope_deg=90.0)
    assert rover.get()["torque_nm"] == 0.0


@pytest.mark.parametrize("name", [each.name for each in VARIABLES if each.role in (Role.OUTPUT, Role.TIME)])
def test_outputs_and_time_cannot_be_set(rover, name):
    rover.begin()
    assert f"{name} is " in rover.refusal(rover.set, **{name: 0.0})


@pytest.mark.parametrize("name", [each.name for each in VARIABLES if each.role is Role.PARAMETER])
def test_parameters_are_fixed_once_the_rover_goes(rover, name):
    rover.begin()
    assert rover.refusal(rover.set, **{name: 1.0}).endswith(f"{name} is a parameter: it cannot be set in step mode")


def test_variables_that_are_not_there(rover):
    get, boolean = (rover.fmu.getFloat64 if rover.three else rover.fmu.getReal), rover.fmu.getBoolean
    assert "no variable with value reference 14" in rover.refusal(get, [14])
    assert "value reference 4294967295" in rover.refusal(get, [4294967295])
    assert "brake is a Boolean" in rover.refusal(get, [REFERENCES["brake"]])
    assert "x_m is a number" in rover.refusal(boolean, [REFERENCES["x_m"]])
    assert "no variable of type" in rover.refusal(rover.fmu.getInt32 if rover.three else rover.fmu.getInteger, [1])
    assert "no variable of type String" in rover.refusal(rover.fmu.setString, [1], ["a"])


def test_calls_in_the_wrong_order(rover):
    step = rover.fmu.doStep
    at = {"currentCommunicationPoint": 0.0, "communicationStepSize": 0.1}
    assert "allowed in step mode, not before initialization" in rover.refusal(step, **at)
    assert "allowed in initialization mode, not before" in rover.refusal(rover.exit)
    assert "allowed in step mode" in rover.refusal(rover.fmu.terminate)
    rover.enter()
    assert "allowed in step mode, not in initialization mode" in rover.refusal(step, **at)
    assert "not in initialization mode" in rover.refusal(rover.enter)
    rover.exit()
    assert "not in step mode" in rover.refusal(rover.exit)
    rover.step(0.0, 0.1)
    rover.fmu.terminate()
    reached = rover.get()
    assert reached["time"] == 0.1
    assert "not after termination" in rover.refusal(step, **at)
    assert "after termination" in rover.refusal(rover.set, slope_deg=1.0)
    assert rover.get() == reached


@pytest.mark.parametrize(
    ("at", "step", "told"),
    [
        (0.0, 0.0, "takes 0 s"),
        (0.0, -0.1, "takes -0.1 s"),
        (0.0, math.nan, "takes NaN s"),
        (0.0, math.inf, "takes infinity s"),
        (0.0, 1e9, "takes 1000000000 s"),
        (0.0, 1e300, "takes 1e+300 s"),
        (0.5, 0.1, "begins at 0.5 s, the last one ended at 0 s"),
        (math.nan, 0.1, "begins at NaN s"),
        (0.0, 10.5, "ends at 10.5 s, after the stop time of 10 s"),
    ],
)
def test_steps_that_cannot_be(rover, at, step, told):
    rover.begin(stop_s=10.0)
    before = rover.get()
    assert told in rover.refusal(rover.step, at, step)
    assert rover.get() == before
    rover.step(0.0, 10.0)


def test_sums_of_steps_may_round(rover):
    rover.begin(stop_s=1.0)
    now = 0.0
    for number in range(10):
        rover.step(number * 0.1, 0.1)
        now += 0.1
    assert rover.get()["time"] == pytest.approx(now)


@pytest.mark.parametrize("start", [math.nan, math.inf])
def test_times_that_cannot_be(rover, start):
    assert "the start time is" in rover.refusal(rover.enter, start)


def test_a_stop_before_the_start(rover):
    assert "before the start at 5 s" in rover.refusal(rover.enter, 5.0, 4.0)


def test_reset_gives_what_a_new_instance_gives(rover, made):
    new = Rover(made, "new")
    assert rover.get() == new.get()
    rover.begin(start_s=3.0, mass_kg=800.0, slope_deg=9.0, torque_nm=90.0)
    rover.step(3.0, 2.0)
    rover.fmu.reset()
    assert rover.get() == new.get()
    for each in (rover, new):
        each.begin(torque_nm=60.0)
        each.step(0.0, 5.0)
    assert rover.get() == new.get()
    new.close()


def test_a_speed_that_is_not_looked_at_is_warned_of(rover):
    rover.begin(start_speed_m_s=0.3)
    assert rover.said[-1][0] == WARNING
    assert "start_speed_m_s is not looked at" in rover.said[-1][1]


def test_states_go_on_where_they_were(rover, made):
    rover.begin(mass_kg=500.0, slope_deg=10.0, torque_nm=70.0)
    rover.step(0.0, 3.03)
    state, data, there = rover.keep(), rover.to_bytes(), rover.get()
    rover.step(3.03, 4.0)
    ahead = rover.get()
    for resume in (lambda: rover.resume(state), lambda: rover.from_bytes(data)):
        rover.fmu.reset()
        resume()
        assert rover.get() == there
        rover.step(3.03, 4.0)
        assert rover.get() == ahead
    other = Rover(made, "other")
    other.from_bytes(data)
    other.step(3.03, 4.0)
    assert other.get() == ahead
    rover.forget(state)
    other.close()


def test_states_keep_what_a_short_step_owes(rover):
    rover.begin(slope_deg=-10.0)
    rover.step(0.0, 1.0)
    rover.step(1.0, 9e-7)
    data = rover.to_bytes()
    rover.step(1.0 + 9e-7, 9e-7)
    ahead = rover.get()
    rover.from_bytes(data)
    rover.step(1.0 + 9e-7, 9e-7)
    assert rover.get() == ahead


@given(at=st.integers(0, 1_000_000), flip=st.integers(1, 255))
def test_altered_states_are_refused(made, at, flip):
    rover = Rover(made).begin(slope_deg=5.0)
    rover.step(0.0, 1.0)
    data = bytearray(rover.to_bytes())
    data[at % len(data)] ^= flip
    assert "state" in rover.refusal(rover.from_bytes, bytes(data))
    rover.close()


@pytest.mark.parametrize("size", [0, 1, 100, 5000])
def test_states_of_another_size_are_refused(rover, size):
    rover.begin()
    data = rover.to_bytes().ljust(5000, b"\0")
    assert "bytes" in rover.refusal(rover.from_bytes, data[:size])


def _library(rover):
    """The functions without FMPy's declarations: pointers may be anything."""
    return ctypes.CDLL(rover.fmu.dll._name)


def _instantiate(rover, made, resources, token=None, name=b"rover"):
    """A second instance by the same library; its handle, or None."""
    token, library = token or rover.description.guid.encode(), _library(rover)
    start = library.fmi3InstantiateCoSimulation if rover.three else library.fmi2Instantiate
    start.restype = ctypes.c_void_p
    if rover.three:
        return start(name, token, resources, 0, 0, 0, 0, None, ctypes.c_size_t(0), None, rover._log, None)
    return start(name, 1, token, resources, ctypes.byref(rover._log), 0, 0)


def _free(rover, instance):
    library = _library(rover)
    (library.fmi3FreeInstance if rover.three else library.fmi2FreeInstance)(ctypes.c_void_p(instance))


def test_places_of_resources_as_importers_write_them(rover, made):
    folder = (made.folder / "resources").as_posix()
    places = [folder, folder + "/", made.folder.as_posix()]
    if not rover.three:
        coded = quote(folder)
        places += [f"file://{coded}", f"file:{coded}", f"file://localhost{coded}", f"FILE://{coded}/"]
        places += [f"file://{folder}".replace("%", "%25"), f"file://{folder}", f"file:{folder}"]
    for place in places:
        instance = _instantiate(rover, made, place.encode())
        assert instance, (place, rover.said)
        _free(rover, instance)


@pytest.mark.parametrize("place", [b"", b"/nowhere", b"file:///nowhere/at%20all", b"file://", b"%", b"file:%4", None])
def test_resources_that_are_not_there(rover, made, place):
    assert not _instantiate(rover, made, place)
    assert "law.bin cannot be read" in rover.said[-1][1] or "it is NULL" in rover.said[-1][1]


@pytest.mark.parametrize("spoil", ["cut", "flip", "empty", "other", "format"])
def test_resources_that_are_damaged(rover, made, tmp_path, spoil):
    data = bytearray((made.folder / "resources/law.bin").read_bytes())
    if spoil == "cut":
        del data[-8:]
    elif spoil == "flip":
        data[2000] ^= 1
    elif spoil == "empty":
        data.clear()
    elif spoil == "other":
        data[:4] = b"PK\3\4"
    else:
        data[4] = 99
    (tmp_path / "law.bin").write_bytes(data)
    assert not _instantiate(rover, made, str(tmp_path).encode())
    assert "law.bin" in rover.said[-1][1]


def test_descriptions_of_another_version(rover, made):
    place = str(made.folder / "resources").encode()
    assert not _instantiate(rover, made, place, token=b"{other}")
    assert "the model description is of {other}, the resources are of {" in rover.said[-1][1]
    assert not _instantiate(rover, made, place, name=b"")
    assert "no name" in rover.said[-1][1]
    assert not _instantiate(rover, made, place, name=None)


def test_messages_have_nothing_to_be_formatted(rover, made):
    assert not _instantiate(rover, made, b"file:///%s%n%d#r1#")
    assert not {"%", "#"} & set(rover.said[-1][1])


def test_callbacks_may_be_missing(rover, made):
    """No logger, no memory functions, no callbacks at all."""
    place, token = str(made.folder / "resources").encode(), rover.description.guid.encode()
    library = _library(rover)
    if rover.three:
        start = library.fmi3InstantiateCoSimulation
        start.restype = ctypes.c_void_p
        made_by = [start(b"a", token, place, 0, 0, 0, 0, None, ctypes.c_size_t(0), None, None, None)]
        step, free = library.fmi3ExitInitializationMode, library.fmi3FreeInstance
    else:
        start = library.fmi2Instantiate
        start.restype = ctypes.c_void_p
        empty = (ctypes.c_void_p * 5)()
        made_by = [start(b"a", 1, token, place, callbacks, 0, 0) for callbacks in (None, empty)]
        step, free = library.fmi2ExitInitializationMode, library.fmi2FreeInstance
        assert start(b"a", 0, token, place, None, 0, 0) is None
    for instance in made_by:
        assert instance
        assert step(ctypes.c_void_p(instance)) == 3
        free(ctypes.c_void_p(instance))
    assert step(None) == 3
    free(None)


def test_missing_arguments_are_errors(rover):
    library, instance = _library(rover), ctypes.c_void_p(rover.fmu.component)
    one = ctypes.c_size_t(1)
    if rover.three:
        assert library.fmi3GetFloat64(instance, None, one, None, one) == 3
        assert library.fmi3GetFMUState(instance, None) == 3
        assert library.fmi3SetFMUState(instance, None) == 3
        assert library.fmi3FreeFMUState(instance, None) == 0
    else:
        assert library.fmi2GetReal(instance, None, one, None) == 3
        assert library.fmi2GetFMUstate(instance, None) == 3
        assert library.fmi2SetFMUstate(instance, None) == 3
        assert library.fmi2FreeFMUstate(instance, None) == 0
    assert "it is NULL" in rover.said[-1][1]


def test_what_is_not_provided_says_so(rover):
    library, instance = _library(rover), ctypes.c_void_p(rover.fmu.component)
    names = ["GetDirectionalDerivative"]
    names += ["GetAdjointDerivative", "EnterEventMode", "SetTime"] if rover.three else ["CancelStep"]
    for name in names:
        assert getattr(library, f"fmi{3 if rover.three else 2}{name}")(instance, *[None] * 6) == 3
        assert f"{name}: " in rover.said[-1][1]


def test_log_categories(rover):
    rover.fmu.setDebugLogging(True, ["logStatusError", "logStatusWarning"])
    rover.fmu.setDebugLogging(False, [])
    assert "no log category loud" in rover.refusal(rover.fmu.setDebugLogging, True, ["loud"])


def test_values_may_be_read_at_any_time(rover):
    assert set(NUMBERS) < set(rover.get())
    assert rover.get()["mass_kg"] == 430.0
    assert rover.get()["speed_m_s"] != 0.0  # of a parked rover that is let go
    rover.set(parked=False)
    assert rover.get()["speed_m_s"] == 0.0
    assert not rover.get()["moving"]


def test_hostile_states_do_not_lead_out_of_bounds(made):
    """With a right checksum, any numbers in the rover's state are taken: the engine bears all of them."""
    import struct
    import zlib

    import numpy as np

    rng = np.random.default_rng(0)
    rover = Rover(made).begin(slope_deg=5.0, torque_nm=60.0)
    rover.step(0.0, 1.0)
    kept = rover.to_bytes()
    hostile = [math.nan, math.inf, -math.inf, 1e308, -1e308, 0.0, -0.0, 5e-324, 1e18, -1e18]
    first = 24 + 8 * (4 + len(VARIABLES))  # behind head and values
    for _ in range(300):
        numbers = np.frombuffer(kept[first:], dtype="<f8").copy()
        places = rng.integers(0, len(numbers), rng.integers(1, len(numbers)))
        numbers[places] = rng.choice(hostile, len(places))
        body = kept[16:first] + numbers.tobytes()
        rover.from_bytes(kept[:8] + struct.pack("<I", zlib.crc32(body)) + kept[12:16] + body)
        rover.step(1.0, 0.5)
        rover.get()
    rover.close()
