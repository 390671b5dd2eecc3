"""Errors as tables: the model always beside its prior alone, in centimetres."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from service.cli.output import make_table, titled

if TYPE_CHECKING:
    from rich.console import RenderableType

    from service.learning.evaluate import RunEvaluation

_ROWS = {
    "final_m": "final position",
    "maximum_m": "maximum over time",
    "rmse_m": "rms over time",
    "rmse_x_m": "rms in x",
    "rmse_y_m": "rms in y",
}
_RELATIVE_ROWS = {"final": "final, % of the way", "maximum": "maximum, % of the way"}
_SPREAD = ("median", "p90", "maximum")


def error_table(title: str, summary: Mapping[str, Any]) -> RenderableType:
    """Median, 90th percentile and maximum over the runs of each error, cm; `summary` is `learning.evaluate`'s."""
    table = make_table(
        "error in cm", "model median", "p90", "max", "prior median", "p90", "max",
    )  # fmt: skip
    for name, words in _ROWS.items():
        spreads = [summary[side][name] if side in summary else {} for side in ("model", "prior")]
        table.add_row(words, *(_cm(spread.get(each)) for spread in spreads for each in _SPREAD))
    for name, words in _RELATIVE_ROWS.items():
        if "relative" in summary:  # versions of earlier releases do without
            table.add_row(words, *(_cm(summary["relative"][name][each]) for each in _SPREAD), *[""] * len(_SPREAD))
    return titled(f"{title}: model beside its prior alone", table)


def runs_table(rows: Sequence[tuple[RunEvaluation, str, bool]]) -> RenderableType:
    """One line per run: (errors, what the run was to the model, whether it lies inside the domain)."""
    table = make_table(
        "run", "seen in", "domain", "slope deg", "mass kg", "torque N m", "final", "max", "rms x", "rms y",
        left=3,
    )  # fmt: skip
    for run, role, inside in rows:
        names = ("final_m", "maximum_m", "rmse_x_m", "rmse_y_m")
        errors = [f"{_cm(getattr(run.model, name))} | {_cm(getattr(run.prior, name, None))}" for name in names]
        scenario = [f"{value:g}" for value in (run.slope_deg, run.mass_kg, run.torque_nm)]
        table.add_row(run.run, role, "inside" if inside else "outside", *scenario, *errors)
    return titled("error of each run in cm, model | prior alone", table)


def _cm(metres: float | None) -> str:
    """A dash where the prior has no answer: it knows no run whose slope, torque or brake change."""
    return "-" if metres is None else f"{100.0 * metres:.2f}"
