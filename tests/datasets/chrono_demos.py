"""Files as the programs of Project Chrono write them, made of one real run of VIPER: 28 deg, 430 kg, 60 N m.

Position, pitch and spin are those that Chrono computed. Velocities and accelerations are differences of the positions
at the run's full 0.5 ms, since the run has only one speed. Forces, torques and timers are not in it: zeros stand for
them, and nothing reads them. Each writer keeps the delimiter, the digits and the order of the program that it is named
after, and puts the rover where that program does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

import model_store
from model_store import ModelStore
from service.datasets import read_parquet
from service.training.dataset_import import RUNS_FILE

SCENARIO = {"slope_deg": 28.0, "mass_kg": 430.0, "torque_nm": 60.0}
RUN = "viper_s28_m430_t60_h10"
START_M = np.array([-1.05, 0.0, 0.1])
"""Where the wheel slope demo starts: left in its bin, whose soil ends 0.1 m above the origin."""


@dataclass(frozen=True)
class Real:
    """Columns of the run: time (row,), position, velocity and acceleration (row, 3) in world axes, spin (row,)."""

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    spin: np.ndarray

    def rows(self, chosen):
        return Real(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))


@cache
def whole() -> Real:
    """All 20,001 rows."""
    store = ModelStore.open(next(iter(model_store.__path__)))
    paper = read_parquet(store.read_dataset_file(store.dataset("paper").id, RUNS_FILE))
    run = next(run for run in paper.runs if run.name == RUN)
    time, columns = run.time_s, run.columns
    position = np.stack([columns["rear_x_m"], columns["rear_lateral_m"], columns["rear_y_m"]], axis=1)
    velocity = np.gradient(position, time, axis=0)
    return Real(time, position, velocity, np.gradient(velocity, time, axis=0), columns["rear_omega_radps"])


def fixed_step(every_s=0.01) -> Real:
    """A row each 10 ms, as `out_fps` 100 of the demos."""
    return whole().rows(slice(None, None, round(every_s / 5e-4)))


def variable_step() -> Real:
    """Rows 1 to 20 ms apart, as a solver with variable step takes them: finer and coarser again, twice a second."""
    steps = [2 + round(19 * (1 + np.sin(at / 11.0))) for at in range(2000)]
    at = np.cumsum([0, *steps])
    return whole().rows(at[at < len(whole().time)])


def lines(columns, delimiter, *, header="", trailing=False, number="{:.6g}") -> bytes:
    """Rows as `ofstream` writes them, or as ChWriterCSV does, with a delimiter after each value."""
    end = delimiter if trailing else ""
    rows = (delimiter.join(number.format(value) for value in row) + end for row in np.column_stack(columns))
    return ("\n".join([header, *rows] if header else rows) + "\n").encode()


def zeros(real: Real, count: int) -> Sequence[np.ndarray]:
    return [np.zeros_like(real.time)] * count


SLOPE_HEADER = "time\tx\ty\tz\tvx\tvy\tvz\tax\tay\taz\tfx\tfy\tfz\ttx\tty\ttz"


def viper_slope(real=None, *, header=SLOPE_HEADER, mended=False) -> bytes:
    """demo_ROBOT_Viper_WheelSlope_CRM: the wheel's angular velocity in its own axes stands under ax ay az."""
    real = real or fixed_step()
    spin = np.stack([0 * real.spin, 0 * real.spin, -real.spin], axis=1)
    third = real.acceleration if mended else spin
    return lines([real.time, real.position + START_M, real.velocity, third, *zeros(real, 6)], "\t", header=header)


def single_wheel(real=None) -> bytes:
    """demo_FSI_SingleWheelTest of Chrono 8 and 9: the same columns, without a header."""
    return viper_slope(real, header="")


def fsi_body(real=None) -> bytes:
    """FSI_body2.csv of Chrono::FSI, the left rear wheel in demo_ROBOT_Viper_CRM."""
    real = real or fixed_step()
    header = "Time,x,y,z,q0,q1,q2,q3,Vx,Vy,Vz,Fx,Fy,Fz,Tx,Ty,Tz"
    rotation = [np.ones_like(real.time), *zeros(real, 3)]
    position = real.position + np.array([0.61, 0.0, 0.25])
    return lines([real.time, position, *rotation, real.velocity, *zeros(real, 6)], ",", header=header)


def viper_sph(real=None) -> bytes:
    """body_pos_rot_vel<n>.csv of demo_ROBOT_Viper_SPH in Chrono 8 and 9."""
    real = real or fixed_step()
    rotation = [np.ones_like(real.time), *zeros(real, 3)]
    header = "Time,x,y,z,q0,q1,q2,q3,Vx,Vy,Vz"
    return lines([real.time, real.position + START_M, *rotation, real.velocity], ",", header=header)


def viper_sph_position(real=None) -> bytes:
    """body_position.txt of the same: two spaces between most values, four before the velocity."""
    real = real or fixed_step()
    text = lines([real.time, real.position + START_M, real.velocity], "  ").decode()
    rows = [row.split("  ") for row in text.splitlines()]
    return "".join("  ".join(row[:4]) + "    " + "  ".join(row[4:]) + "\n" for row in rows).encode()


def tracked(real=None) -> bytes:
    """demo_VEH_CRMTerrain_TrackedVehicle: true accelerations."""
    real = real or fixed_step()
    rest = [np.ones_like(real.time), *zeros(real, 6)]
    header = "time,x,y,z,vx,vy,vz,ax,ay,az,qw,qx,qy,qz,wx,wy,wz"
    position = real.position + START_M
    return lines([real.time, position, real.velocity, real.acceleration, *rest], ",", header=header)


def lander(real=None) -> bytes:
    """demo_ROBOT_Lander_CRM."""
    real = real or fixed_step()
    header = "time,px,py,pz,vx,vy,vz,wx,wy,wz"
    return lines([real.time, real.position + START_M, real.velocity, *zeros(real, 3)], ",", header=header)


def vehicle(real=None) -> bytes:
    """demo_VEH_CRMTerrain_WheeledVehicle (C++): ChWriterCSV with a space after each value, also the last one."""
    real = real or fixed_step()
    return lines([real.time, real.position + START_M, real.velocity[:, 0]], " ", trailing=True)


def vehicle_python(real=None) -> bytes:
    """The same demo in Python: csv.writer, as many digits as a double has, lines that end in CR LF."""
    real = real or fixed_step()
    columns = [real.time, real.position + START_M, real.velocity[:, 0]]
    return lines(columns, " ", number="{!r:}").replace(b"np.float64(", b"").replace(b")", b"").replace(b"\n", b"\r\n")


def cosim_rover(real=None) -> bytes:
    """results.dat of demo_VEH_Cosim_Viper: scientific, seven decimals, two spaces after each value."""
    real = real or fixed_step()
    columns = [real.time, real.position + START_M, *zeros(real, 4)]
    return lines(columns, "  ", trailing=True, number="{:.7e}")


def cosim_wheel(real=None) -> bytes:
    """results.dat of demo_VEH_Cosim_WheelRig."""
    real = real or fixed_step()
    spin = np.stack([0 * real.spin, real.spin, 0 * real.spin], axis=1)
    position = real.position + START_M
    columns = [real.time, position, real.velocity, spin, position, *zeros(real, 10)]
    return lines(columns, "  ", trailing=True, number="{:.7e}")


def scm_torques(wheels=4) -> bytes:
    """demo_ROBOT_Viper_SCM and demo_ROBOT_Curiosity_SCM. The torque is what the motor law gives at the run's spin."""
    real = fixed_step()
    torque = 60.0 * (1.0 - np.abs(real.spin) / np.pi)
    return lines([real.time, *[torque] * wheels], " ", trailing=True)


def scm_with_position() -> bytes:
    """demo_ROBOT_Viper_SCM with the line that the service asks for."""
    real = fixed_step()
    header = "time_s rear_x_m rear_lateral_m rear_y_m speed_mps"
    return lines([real.time, real.position, real.velocity[:, 0]], " ", header=header, trailing=True)


def drawbar(header="time\tfx\ttz") -> bytes:
    """DBP_Torque_fixed_time_step.txt."""
    real = fixed_step()
    return lines([real.time, *zeros(real, 2)], "\t", header=header)


def particles() -> bytes:
    """fluid0.csv of Chrono::FSI: a comma and a space between values, only a comma in the header."""
    real = fixed_step()
    return lines([real.position, *zeros(real, 2)], ", ", header="x,y,z,|U|,acc")
