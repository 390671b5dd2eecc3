"""What programs of Project Chrono write: which column is what, for files that can be learned from and for the others.

Read from the sources of Chrono 8.0, 9.0.1 and of August 2026 (main, towards 10.1). All write six significant digits
(the co-simulation eight), in world axes: x forward, y to the left, z up. A slope is made by tilting gravity about y, so
that x lies along it and z normal to it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

Rate = tuple[str | int, str | int]


@dataclass(frozen=True, slots=True)
class Demo:
    """One kind of file that has time and position.

    `sources`: canonical name -> column, by its name in lower case or by its index. `header`: those names, in order;
    () where the file has none. `width`: how many columns. `body`: what the position is of. `notes`: what else to know,
    each a clause. `rates`: (column, column that is its rate of change), `accelerations`: the same, where names say so,
    and `instead` is what the demo writes there.
    """

    program: str
    sources: Mapping[str, str | int]
    body: str
    width: int
    header: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    rates: tuple[Rate, ...] = ()
    accelerations: tuple[Rate, ...] = ()
    instead: str = ""

    @property
    def checked(self) -> tuple[str | int, ...]:
        """The columns that are compared with each other."""
        return tuple(dict.fromkeys(column for pair in (*self.rates, *self.accelerations) for column in pair))


@dataclass(frozen=True, slots=True)
class Silent:
    """A kind of file without position: nothing can be learned from it. `add` is what to write as well."""

    program: str
    what: str
    add: str
    width: int
    header: tuple[str, ...] = ()


def _by_name(x: str = "x", y: str = "y", z: str = "z", vx: str = "vx", time: str = "time") -> dict[str, str | int]:
    return {"time_s": time, "rear_x_m": x, "rear_y_m": z, "rear_lateral_m": y, "speed_mps": vx}


def _by_index(speed: int | None) -> dict[str, str | int]:
    places: dict[str, str | int] = {"time_s": 0, "rear_x_m": 1, "rear_y_m": 3, "rear_lateral_m": 2}
    return places if speed is None else places | {"speed_mps": speed}


_POSITION, _VELOCITY, _ACCELERATION = ("x", "y", "z"), ("vx", "vy", "vz"), ("ax", "ay", "az")
_FORCES = ("fx", "fy", "fz", "tx", "ty", "tz")
_QUATERNION = ("q0", "q1", "q2", "q3")
_RATES: tuple[Rate, ...] = tuple(zip(_POSITION, _VELOCITY, strict=True))
_RATES_BY_INDEX: tuple[Rate, ...] = ((1, 4), (2, 5), (3, 6))
_ACCELERATIONS: tuple[Rate, ...] = tuple(zip(_VELOCITY, _ACCELERATION, strict=True))

_SET_SPIN = "the wheel is turned at a set speed in this demo, not by a torque"
_CHASSIS = "the chassis, not the centre of a rear wheel (for a rover: --reference chassis)"

DEMOS: dict[str, Demo] = {
    "chrono-viper-slope": Demo(
        "demo_ROBOT_Viper_WheelSlope_CRM (results_fixed_time_step.txt, results_variable_time_step.txt)",
        _by_name(), "the only wheel", 16, ("time", *_POSITION, *_VELOCITY, *_ACCELERATION, *_FORCES),
        (_SET_SPIN,), _RATES, _ACCELERATIONS,
        "the wheel's angular velocity in rad/s and in the wheel's own axes, which depend on its mesh",
    ),
    "chrono-fsi-body": Demo(
        "SaveSolidData of Chrono::FSI (FSI_body0.csv ...; in demo_ROBOT_Viper_CRM 2 and 3 are the rear wheels)",
        _by_name(), "the body with the number of the file", 17,
        ("time", *_POSITION, *_QUATERNION, *_VELOCITY, *_FORCES), (), _RATES,
    ),
    "chrono-viper-sph": Demo(
        "demo_ROBOT_Viper_SPH of Chrono 8 and 9 (body_pos_rot_vel1.csv ...)",
        _by_name(), "the body with the number of the file (1: chassis)", 11,
        ("time", *_POSITION, *_QUATERNION, *_VELOCITY), (), _RATES,
    ),
    "chrono-tracked": Demo(
        "demo_VEH_CRMTerrain_TrackedVehicle (tracked_vehicle_stats.csv)",
        _by_name(), _CHASSIS, 17,
        ("time", *_POSITION, *_VELOCITY, *_ACCELERATION, "qw", "qx", "qy", "qz", "wx", "wy", "wz"),
        ("a vehicle on tracks is not what the service models",), _RATES, _ACCELERATIONS,
    ),
    "lander": Demo(
        "demo_ROBOT_Lander_CRM (lander_body_data.csv)",
        _by_name("px", "py", "pz"), "the lander's body", 10,
        ("time", "px", "py", "pz", *_VELOCITY, "wx", "wy", "wz"),
        ("a lander is not what the service models",), tuple(zip(("px", "py", "pz"), _VELOCITY, strict=True)),
    ),
    "vehicle-python": Demo(
        "demo_VEH_CRMTerrain_WheeledVehicle, C++ and Python (results.txt: time x y z speed)",
        _by_index(4), _CHASSIS, 5,
    ),
    "chrono-single-wheel": Demo(
        "demo_FSI_SingleWheelTest of Chrono 8 and 9 (results.txt: time, position, velocity, angular velocity, force, "
        "torque)",
        _by_index(4), "the only wheel", 16, (),
        (_SET_SPIN, "its carriage is pulled at a set speed too"), _RATES_BY_INDEX,
    ),
    "chrono-viper-sph-position": Demo(
        "demo_ROBOT_Viper_SPH of Chrono 8 and 9 (body_position.txt: time, position, velocity)",
        _by_index(4), _CHASSIS, 7, (), (), _RATES_BY_INDEX,
    ),
    "chrono-cosim-rover": Demo(
        "demo_VEH_Cosim_Viper, demo_VEH_Cosim_Curiosity (results.dat of the MBS node: time, position, four timers)",
        _by_index(None), _CHASSIS, 8,
    ),
    "chrono-cosim-wheel": Demo(
        "demo_VEH_Cosim_WheelRig (results.dat of the MBS node: time, spindle, its velocity and spin, chassis, force, "
        "torque, four timers)",
        _by_index(4), "the spindle", 23, (),
        (_SET_SPIN,), _RATES_BY_INDEX,
    ),
}  # fmt: skip
"""Kinds of files that can be learned from, by the name of their preset."""

_LINE = (
    "write csv << sys.GetChTime() << {body}->GetPos() << {body}->GetLinVel().x() << std::endl and give WriteToFile the "
    'header "time_s rear_x_m rear_lateral_m rear_y_m speed_mps"'
)
_VIPER = _LINE.format(body="viper.GetWheel(ViperWheelID::V_LB)")

SILENT: tuple[Silent, ...] = (
    Silent("demo_ROBOT_Viper_SCM", "time and four wheel torques", _VIPER, 5),
    Silent("demo_ROBOT_Curiosity_SCM", "time and six wheel torques",
           _LINE.format(body="rover.GetWheel(CuriosityWheelID::C_LB)"), 7),
    Silent("demo_VEH_SCMTerrain_RigidTire", "time, force and torque",
           "write csv << time << wheel->GetPos() << wheel->GetPosDt() << std::endl", 7),
    Silent("the drawbar rig of a co-simulation (DBP.dat)", "time, speeds, slips and pulls",
           "take results.dat of the same node", 7),
    Silent("demo_ROBOT_Viper_WheelSlope_CRM (DBP_Torque_*.txt)", "time, force and torque",
           "take results_fixed_time_step.txt or results_variable_time_step.txt of the same run", 3,
           ("time", "fx", "tz")),
    Silent("demo_FSI_SingleWheelTest of Chrono 8 and 9 (DBP_Torque.txt)", "time, force and torque",
           "take results.txt of the same run", 3),
    Silent("Chrono::FSI (fluid*.csv, boundary*.csv)", "soil particles at one moment",
           "take FSI_body2.csv of the folder that SaveSolidData wrote", 5, ("x", "y", "z", "|u|", "acc")),
    Silent("Chrono::FSI (FSI_1Dnode*.csv, FSI_2Dnode*.csv)", "a node of a flexible body",
           "take FSI_body*.csv beside it", 10,
           ("time", *_POSITION, *_VELOCITY, "fx", "fy", "fz")),
    Silent("demo_VEH_Test_Accel (veh_acceleration.out)", "time, throttle, speed in km/h, gear and distance",
           "write csv << vehicle.GetPos() as well", 5,
           ("time", "throttle", "vehiclespeed", "currenttransmissiongear", "distance")),
)  # fmt: skip
"""Kinds of files that cannot be learned from."""
