"""An answer of the service as a motion: where the middle between the rear wheels is, and how the rover is pitched."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rover_twin_usd.failures import ServiceError


@dataclass(frozen=True)
class Motion:
    """Columns over time, all of the same length: seconds, metres ahead and up, degrees with the nose up.

    `columns` are all columns of the answer by name, `labels` say who predicted what.
    """

    time_s: Sequence[float]
    ahead_m: Sequence[float]
    up_m: Sequence[float]
    pitch_deg: Sequence[float]
    columns: Mapping[str, Sequence[float]] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, answer: Mapping[str, Any]) -> Motion:
        """The motion in one JSON answer in the world frame. Raises ServiceError for a refusal."""
        if "trajectory" not in answer:
            where = f"rover {answer['index']}: " if "index" in answer else ""
            raise ServiceError(f"{where}{answer.get('detail', 'the answer has no trajectory')}")
        columns = dict(answer["trajectory"])
        pitch = columns.get("slope_deg") or [answer["scenario"]["slope_deg"]] * len(columns["time_s"])
        band = {name: values for name, values in answer.get("band", {}).items() if name != "level"}
        prior = {f"prior_{name}": values for name, values in answer.get("prior", {}).items() if name != "name"}
        return cls(
            time_s=columns.pop("time_s"),
            ahead_m=columns["x_m"],
            up_m=columns["z_m"],
            pitch_deg=pitch,
            columns={name: _numbers(values) for name, values in {**columns, **prior, **band}.items()},
            labels=_labels(answer),
        )


def _numbers(values: Sequence[Any]) -> Sequence[float]:
    """True and false stay so; JSON writes some floats as whole numbers."""
    return values if isinstance(values[0], bool) else list(map(float, values))


def _labels(answer: Mapping[str, Any]) -> dict[str, str]:
    """The labels that the service's own layers have."""
    model = answer["model"]
    found = {
        "model": f"{model['name']}@{model['version']}",
        "frame": answer["frame"],
        "domain": "inside" if answer["domain"]["inside"] else "outside",
        "outcome": answer["summary"]["outcome"],
    }
    if "band" in answer:
        found["bandLevel"] = f"{answer['band']['level']:g}"
    return found
