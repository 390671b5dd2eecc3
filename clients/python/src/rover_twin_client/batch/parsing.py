"""Turns the answers of /v1/predictions/batch, NumPy archives, into a `Batch`. Unknown arrays are ignored."""

from __future__ import annotations

import io
import json
import math
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from rover_twin_client.answers import Array, Band, Frame, ModelIdentity, Prior
from rover_twin_client.batch.answers import Batch, FailedPrediction
from rover_twin_client.document import Node
from rover_twin_client.drive_parsing import fault
from rover_twin_client.errors import FieldFault, UnexpectedAnswerError
from rover_twin_client.parsing import frame_of, identity

_POSITIONS = ("x_m", "y_m", "z_m")
_COLUMNS = (
    *_POSITIONS,
    *("speed_m_s", "rear_wheel_speed_rad_s", "front_wheel_speed_rad_s"),
    *(f"prior_{name}" for name in _POSITIONS),
    *("x_lower_m", "x_upper_m", "y_lower_m", "y_upper_m"),
)
_SUMMARY = ("final_x_m", "final_y_m", "distance_m", "mean_speed_m_s")
_WORDS = ("outcome", "outside_of", "nearest_run")


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """The answer to some of the scenarios: `arrays` by name, a row for each that is answered at `index` (row,)."""

    model: ModelIdentity
    frame: Frame
    prior_name: str
    band_level: float
    arrays: Mapping[str, NDArray[Any]]
    failures: tuple[FailedPrediction, ...]


def piece(answer: Node) -> Piece:
    """One answer; raises UnexpectedAnswerError where it does not hold what it should."""
    arrays = _arrays(cast("bytes", answer.value))
    try:
        about = Node(json.loads(str(arrays["metadata"])), "metadata")
    except (KeyError, ValueError) as unreadable:
        raise UnexpectedAnswerError("the answer has no metadata: is base_url right?") from unreadable
    found = Piece(
        model=identity(about["model"]),
        frame=frame_of(about["frame"]),
        prior_name=about.optional("prior", lambda prior: prior["name"].text()) or "",
        band_level=about.optional("band", lambda band: band["level"].number()) or np.nan,
        arrays=arrays,
        failures=tuple(_failed(item) for item in about["errors"].items()),
    )
    _require_shapes(found)
    return found


def _arrays(content: bytes) -> dict[str, NDArray[Any]]:
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except (ValueError, OSError, EOFError, TypeError, AttributeError, zipfile.BadZipFile) as unreadable:
        raise UnexpectedAnswerError("the answer is no NumPy archive: is base_url right?") from unreadable


def _require_shapes(found: Piece) -> None:
    needed = ("index", "points", "time_s", "x_m", "inside", "slip_ratio", "slip_ratio_known", "outcome", *_SUMMARY)
    for name in (*needed, "horizon_s", "y_m" if found.frame == "slope" else "z_m"):
        if name not in found.arrays:
            raise UnexpectedAnswerError(f"the answer has no array {name!r}: is this a rover-twin service?")
    rows, times = found.arrays["index"].size, found.arrays["time_s"].shape[-1:]
    for name, array in found.arrays.items():
        over_time = name in _COLUMNS or (name == "time_s" and array.ndim > 1)
        wanted = (rows, *times) if over_time else times if name == "time_s" else (rows,)
        if name != "metadata" and rows and array.shape != wanted:
            raise UnexpectedAnswerError(f"{name} has the shape {array.shape}, expected {wanted}")


def _failed(node: Node) -> FailedPrediction:
    errors = node.get("errors")
    faults = tuple(fault(item) for item in errors.items()) if errors else ()
    return FailedPrediction(node["index"].whole(), node["detail"].text(), faults)


def batch(
    scenarios: Mapping[str, Array],
    pieces: Mapping[int, Piece],
    unreadable: Mapping[int, FailedPrediction] | None = None,
) -> Batch:
    """All pieces together, each by its first scenario; a row for each scenario, NaN where there is no answer.

    `scenarios` are the columns that were sent, `unreadable` what the client says of those it could not read.
    """
    count = scenarios["slope_deg"].size
    ordered = sorted(pieces.items())
    first = next((each for _, each in ordered if each.arrays["index"].size), ordered[0][1])
    time_s = _times(count, ordered)
    points = time_s.shape[-1]
    known = {name for _, each in ordered for name in each.arrays}
    columns = {name: _filled(np.full((count, points), np.nan), name, ordered) for name in _COLUMNS if name in known}
    numbers = {name: _filled(np.full(count, np.nan), name, ordered) for name in (*_SUMMARY, "distance", "slip_ratio")}
    words = {name: _filled(np.full(count, "", dtype=object), name, ordered).astype(np.str_) for name in _WORDS}
    flags = {name: _filled(np.zeros(count, dtype=np.bool_), name, ordered) for name in ("inside", "slip_ratio_known")}
    numbers["slip_ratio"][~flags["slip_ratio_known"]] = np.nan
    horizon_s = _filled(scenarios["horizon_s"].copy(), "horizon_s", ordered)
    shown: dict[str, Any] = {
        **scenarios,
        "horizon_s": horizon_s,
        **numbers,
        **words,
        "inside": flags["inside"],
    }
    for array in (time_s, *columns.values(), *shown.values()):
        array.setflags(write=False)
    position: dict[str, Any] = {name: columns.pop(name, None) for name in _POSITIONS}
    speeds: dict[str, Any] = {name: columns.pop(name, None) for name in _COLUMNS[3:6]}
    prior: list[Any] = [columns.pop(f"prior_{name}", None) for name in _POSITIONS]
    return Batch(
        model=first.model,
        frame=first.frame,
        time_s=time_s,
        **position,
        **speeds,
        **shown,
        prior=None if prior[0] is None else Prior(first.prior_name, *prior),
        band=Band(first.band_level, **columns) if columns else None,
        failures=tuple(
            (unreadable or {}).get(failure.index + start) or _placed(failure, start)
            for start, each in ordered
            for failure in each.failures
        ),
    )


def _times(count: int, ordered: Sequence[tuple[int, Piece]]) -> Array:
    """(T,) where all scenarios that are answered share it, else (N, T) with NaN where a row has ended."""
    answered = [(start, each) for start, each in ordered if each.arrays["index"].size]
    if not answered:
        return np.empty(0)
    shared = answered[0][1].arrays["time_s"]
    if all(np.array_equal(each.arrays["time_s"], shared) for _, each in answered) and shared.ndim == 1:
        return shared.astype(np.float64)
    most = max(each.arrays["time_s"].shape[-1] for _, each in answered)
    return _filled(np.full((count, most), np.nan), "time_s", answered)


def _filled(whole: NDArray[Any], name: str, ordered: Sequence[tuple[int, Piece]]) -> NDArray[Any]:
    """Puts the rows of each piece to their places; what only fills up a row over time is left out."""
    for start, each in ordered:
        if name not in each.arrays or not each.arrays["index"].size:
            continue
        rows, values = each.arrays["index"] + start, each.arrays[name]
        if whole.ndim == 1:
            whole[rows] = values
            continue
        points = np.arange(values.shape[-1])
        own = points < each.arrays["points"][:, None]
        whole[rows, : points.size] = np.where(own, values, np.nan)
    return whole


def _placed(failure: FailedPrediction, start: int) -> FailedPrediction:
    """With its place among all scenarios, and its fields in the caller's words."""
    at = failure.index + start
    name = f"scenarios[{at}]"
    faults = tuple(_in_words(each, name) for each in failure.faults)
    told = failure.detail == "; ".join(each.message for each in failure.faults)
    detail = "; ".join(each.message for each in faults) if told else f"{name}: {failure.detail}"
    return FailedPrediction(at, detail, faults)


def _in_words(fault: FieldFault, scenario: str) -> FieldFault:
    """As the caller knows it: a number that is missing went as null, and was NaN before."""
    message = fault.message.replace(" is null", " is nan", 1) if fault.value is None else fault.message
    value = math.nan if fault.value is None else fault.value
    return replace(fault, field=f"{scenario}.{fault.field}", value=value, message=f"{scenario}.{message}")
