"""What a version's manifest proves about runs that it was not made from.

Two kinds of evidence count: a run kept apart from the fit (`test`), and a training run predicted by a model made
without it (`left_out`). A run that is in training under another name too, as when a dataset was uploaded twice, proves
nothing.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple, TypeVar

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from model_store import CorruptArtefactError, Manifest, ModelStore, NotFoundError
from service.learning.neighbourhood import MAX_RUNS

TRAIN_REPORT = "report/train.json"
_MAX_REPORT_BYTES = 16 << 20

Metres = Annotated[float, Field(ge=0)]


class Errors(BaseModel):
    """Distances (m) between predicted and simulated positions over one run: at its end, the largest, and rms."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    final_m: Metres
    maximum_m: Metres
    rmse_m: Metres


class RunKey(NamedTuple):
    """Which simulation a run is, whatever dataset it is in: name, scenario, and where it ended (rounded to 1 um)."""

    run: str
    slope_deg: float
    mass_kg: float
    torque_nm: float
    horizon_s: float
    final_x_um: int


class _Simulated(BaseModel):
    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    run: str
    slope_deg: float
    mass_kg: float
    torque_nm: float
    horizon_s: float
    final_x_m: Annotated[float, Field(ge=-1e6, le=1e6)]

    def key(self) -> RunKey:
        end_um = round(self.final_x_m * 1e6)
        return RunKey(self.run, self.slope_deg, self.mass_kg, self.torque_nm, self.horizon_s, end_um)


class _Evaluated(_Simulated):
    model: Errors


RunT = TypeVar("RunT", bound=BaseModel)


_SIMULATED = TypeAdapter(Annotated[list[_Simulated], Field(max_length=MAX_RUNS)], config=ConfigDict(defer_build=True))
_EVALUATED = TypeAdapter(Annotated[list[_Evaluated], Field(max_length=MAX_RUNS)], config=ConfigDict(defer_build=True))


@dataclass(frozen=True, slots=True)
class Evidence:
    """Errors of one version by run, only of runs it was not made from, and the names of those it was made from."""

    version: str
    errors: Mapping[RunKey, Errors]
    trained_on: frozenset[str]


def read_evidence(store: ModelStore, manifest: Manifest) -> Evidence:
    """The evidence of a version; without any when its manifest has no errors of left-out runs.

    Raises CorruptArtefactError when the metrics or the training report are not what this program writes, and what
    `ModelStore.read_file` raises.
    """
    version = f"{manifest.name}@{manifest.version}"
    trained_on = _trained_on(manifest)
    tested = [each for each in _by_run(manifest, "test") if each.run not in trained_on]
    # one prediction per run: leaving out one at a time comes last and wins
    errors = {each.key(): each.model for each in [*tested, *_by_run(manifest, "left_out")]}
    twins = _names_by_simulation(store, manifest)
    return Evidence(
        version,
        {key: found for key, found in errors.items() if twins.get(key[1:], {key.run}) <= {key.run}},
        trained_on,
    )


def _trained_on(manifest: Manifest) -> frozenset[str]:
    split = manifest.lineage.split
    names = split.get("train") if isinstance(split, dict) else None
    return frozenset(str(name) for name in names) if isinstance(names, list) else frozenset()


def _by_run(manifest: Manifest, part: str) -> list[_Evaluated]:
    found = manifest.metrics.get(part)
    rows = found.get("by_run") if isinstance(found, dict) else None
    return parsed(_EVALUATED, rows or [], f"metrics.{part}.by_run of {manifest.name}@{manifest.version}")


def _names_by_simulation(store: ModelStore, manifest: Manifest) -> dict[tuple[Any, ...], set[str]]:
    """Every name under which each simulation is among the training runs."""
    try:
        content = store.read_file(manifest, TRAIN_REPORT, limit_bytes=_MAX_REPORT_BYTES)
    except NotFoundError:
        return {}
    where = f"{TRAIN_REPORT} of {manifest.name}@{manifest.version}"
    try:
        report = json.loads(content)
    except ValueError as error:
        raise CorruptArtefactError(f"{where} is not JSON; publish the version anew") from error
    rows = report.get("by_run") if isinstance(report, dict) else None
    names: dict[tuple[Any, ...], set[str]] = {}
    for each in parsed(_SIMULATED, rows or [], where):
        names.setdefault(each.key()[1:], set()).add(each.run)
    return names


def parsed(kind: TypeAdapter[list[RunT]], rows: object, where: str) -> list[RunT]:
    """Rows that a version keeps, checked. Raises CorruptArtefactError; it names `where` and the first wrong field."""
    try:
        return kind.validate_python(rows)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        field = ".".join(str(part) for part in first["loc"])[:200]
        raise CorruptArtefactError(f"{where}: field '{field}': {first['msg']}; publish the version anew") from error
