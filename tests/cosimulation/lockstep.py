"""Simulators that know a terrain and ask somebody else where their rover goes: peers, stepped side by side.

Each peer is one way to the engine: an FMU, the WebSocket, single requests, this process. All are asked the same: the
slope under the rover's middle in the middle of the step, for steps that are the engine's cells of time (`cells`), or
all alike.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import fmpy
import numpy as np
from fmpy.fmi3 import FMU3Slave

from rover_twin_client import RoverTwin
from service.local import LocalTwin
from service.physics.scenario import Array

AHEAD_M = 0.6418  # of the rear wheel: the rover's middle
EARLY_S, EARLY_CELL_S, CELL_S, BRAKED_PARTS = 0.3, 0.02, 0.05, 8  # as in native/drive.c


@dataclass(frozen=True, slots=True)
class Terrain:
    """Slope (deg) over distance (m): what a testbed has in its own way."""

    distance_m: Array
    slope_deg: Array

    def under(self, middle_m: float) -> float:
        """Degrees."""
        return float(np.interp(middle_m, self.distance_m, self.slope_deg))


@dataclass(frozen=True, slots=True)
class Told:
    """Torque (N m) and brake from `time_s` on."""

    time_s: float
    torque_nm: float
    brake: bool


class Peer(Protocol):
    """One rover in one simulator."""

    def step(self, slope_deg: float, torque_nm: float, brake: bool, dt_s: float) -> tuple[float, float]:
        """Position (m) and speed (m/s) at the end of the step."""
        ...


class LivePeer:
    """Over `/v1/live`, or a request for each step."""

    def __init__(self, url: str, mass_kg: float, transport: Any, stack: ExitStack) -> None:
        twin = stack.enter_context(RoverTwin(url))
        self._live = stack.enter_context(twin.live(transport=transport))
        self._live.start("rover", mass_kg=mass_kg)

    def step(self, slope_deg: float, torque_nm: float, brake: bool, dt_s: float) -> tuple[float, float]:
        rover = self._live.step("rover", slope_deg, torque_nm, dt_s, brake=brake)
        return rover.x_m, rover.speed_m_s


class LocalPeer:
    """In this process."""

    def __init__(self, twin: LocalTwin, mass_kg: float, slope_deg: float) -> None:
        self._live = twin.live()
        self._live.start("rover", mass_kg=mass_kg, slope_deg=slope_deg)

    def step(self, slope_deg: float, torque_nm: float, brake: bool, dt_s: float) -> tuple[float, float]:
        rover = self._live.step("rover", slope_deg=slope_deg, torque_nm=torque_nm, brake=brake, dt_s=dt_s)
        return float(rover.x_m[0]), float(rover.speed_m_s[0])


class FmuPeer:
    """An FMU 3.0 by FMPy's own interface: none of our code runs but what is in the file."""

    def __init__(self, file: Path, mass_kg: float, folder: Path, stack: ExitStack) -> None:
        description = fmpy.read_model_description(str(file))
        self._number = {each.name: each.valueReference for each in description.modelVariables}
        self._fmu = FMU3Slave(
            guid=description.instantiationToken,
            unzipDirectory=fmpy.extract(str(file), str(folder)),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="rover",
        )
        self._fmu.instantiate()
        stack.callback(self._fmu.freeInstance)
        self._fmu.setFloat64([self._number["mass_kg"]], [mass_kg])
        self._fmu.enterInitializationMode()
        self._fmu.exitInitializationMode()
        self._time_s = 0.0

    def step(self, slope_deg: float, torque_nm: float, brake: bool, dt_s: float) -> tuple[float, float]:
        number = self._number
        self._fmu.setFloat64([number["slope_deg"], number["torque_nm"]], [slope_deg, torque_nm])
        self._fmu.setBoolean([number["brake"]], [brake])
        self._fmu.doStep(currentCommunicationPoint=self._time_s, communicationStepSize=dt_s)
        self._time_s += dt_s
        x_m, speed_m_s = self._fmu.getFloat64([number["x_m"], number["speed_m_s"]])
        return x_m, speed_m_s


@dataclass(frozen=True, slots=True)
class Step:
    """What acts for `dt_s`. `looks_s` is how far ahead the slope is looked up: half the engine's cell of time."""

    told: Told
    dt_s: float
    looks_s: float


def cells(controls: Iterable[Told], until_s: float) -> Iterator[Step]:
    """The engine's cells of time under controls; the last one before a change is cut short by it."""
    told = list(controls)
    for each, end in zip(told, [*(later.time_s for later in told[1:]), until_s], strict=True):
        whole, parts = end - each.time_s, BRAKED_PARTS if each.brake else 1
        early = round(EARLY_S / EARLY_CELL_S)
        borders = [at * EARLY_CELL_S for at in range(early)] + list(np.arange(EARLY_S, whole + CELL_S, CELL_S))
        for start, stop in pairwise(borders):
            cell_s = (stop - start) / parts
            for part in range(parts):
                dt_s = min(cell_s, whole - (start + part * cell_s))
                if dt_s > 1e-9:
                    yield Step(each, dt_s, 0.5 * cell_s)


def evenly(controls: Iterable[Told], until_s: float, dt_s: float, looks_s: float) -> Iterator[Step]:
    """Steps of one length; controls act from the first step on that begins when they are told, or later."""
    told = list(controls)
    for at in range(round(until_s / dt_s)):
        yield Step([each for each in told if each.time_s <= at * dt_s + 1e-9][-1], dt_s, looks_s)


def ride(peer: Peer, terrain: Terrain, steps: Iterable[Step]) -> Array:
    """Positions (step,) at the end of each step."""
    x_m = speed_m_s = 0.0
    found = []
    for step in steps:
        slope_deg = terrain.under(x_m + speed_m_s * step.looks_s + AHEAD_M)
        x_m, speed_m_s = peer.step(slope_deg, step.told.torque_nm, step.told.brake, step.dt_s)
        found.append(x_m)
    return np.array(found)
