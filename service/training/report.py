"""How well a version does on runs that were left out one at a time: Markdown and figures for its report."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import StrMethodFormatter

from service.learning.evaluate import LEAST_WAY_M, RunEvaluation
from service.learning.observed import ObservedRun
from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array, Positions, Scenarios
from service.physics.similarity import torque_ratio
from service.training.drawing import SMALLEST_CM, as_svg, log_cm, new_axes

CLIMBS_ABOVE_M = 0.3  # a run that ends further up than this climbs; the others stall or slide back
KINDS = ("climbing", "stalling or sliding", "drives")
_TIMES = 101
_WORST = 10


@dataclass(frozen=True, slots=True, eq=False)
class ErrorCurve:
    """Distance (m) between predicted and simulated position of a left-out run, at a hundred times over its horizon."""

    run: str
    time_s: Array
    error_m: Array


def error_curves(runs: Sequence[ObservedRun], left_out: Mapping[str, Positions]) -> list[ErrorCurve]:
    """The curve of each run; `left_out` has, by run name, positions of shape (1, time) at the run's own times."""
    curves = []
    for run in runs:
        kept = np.linspace(0, len(run.time_s) - 1, min(_TIMES, len(run.time_s))).round().astype(int)
        dx, dy = left_out[run.name].x_m[0] - run.x_m, left_out[run.name].y_m[0] - run.y_m
        curves.append(ErrorCurve(run.name, run.time_s[kept], np.hypot(dx, dy)[kept]))
    return curves


def left_out_report(
    evaluations: Sequence[RunEvaluation],
    curves: Sequence[ErrorCurve],
    rover: RoverParameters,
    regolith: RegolithParameters,
    slopes: Sequence[RunEvaluation] = (),
) -> dict[str, bytes]:
    """Files of the report by their path in a version. The same input gives the same bytes.

    `slopes` are runs predicted from the other slopes of their own series; without any that section is missing.
    Raises ValueError without runs.
    """
    if not evaluations:
        raise ValueError("a report on left-out runs needs at least one run")
    return {
        "report/left_out.md": (_page(evaluations) + _slopes_section(slopes)).encode(),
        "report/left_out_errors.svg": as_svg(errors_figure(evaluations, rover, regolith)),
        "report/left_out_time.svg": as_svg(time_figure(evaluations, curves)),
    }


def kind_of(run: RunEvaluation) -> str:
    """Of `KINDS`: a drive, where slope, torque or brake change; else whether the rover ends clearly above its start."""
    return KINDS[2] if run.varies else KINDS[0] if run.final_x_m > CLIMBS_ABOVE_M else KINDS[1]


_COLUMNS = (
    "set", "runs", "count", "relative median", "relative p90", "on the way p90", "final median", "final p90",
    "final max", "prior alone, final median",
)  # fmt: skip


def _page(evaluations: Sequence[RunEvaluation]) -> str:
    rows = [(*names, *_quantiles(runs)) for names, runs in _groups(evaluations)]
    worst = sorted(evaluations, key=lambda run: run.relative_final, reverse=True)[:_WORST]
    worst_rows = [
        (run.run, run.set_name, _at_start(run, run.slope_deg), f"{run.mass_kg:g}", _at_start(run, run.torque_nm),
         f"{run.way_m:.3f}", f"{run.final_x_m:.3f}", _cm(run.model.final_m), _cm(run.model.maximum_m),
         _percent(run.relative_final))
        for run in worst
    ]  # fmt: skip
    worst_columns = (
        "run", "set", "slope, °", "mass, kg", "torque, N m", "way, m", "ends at x, m", "final", "max.", "relative",
    )  # fmt: skip
    return _PAGE.format(
        table=_markdown(_COLUMNS, rows, left=2), count=len(worst), worst=_markdown(worst_columns, worst_rows, left=2)
    )


def _at_start(run: RunEvaluation, value: float) -> str:
    return f"from {value:g}" if run.varies else f"{value:g}"


def _slopes_section(evaluations: Sequence[RunEvaluation]) -> str:
    if not evaluations:
        return ""
    series: dict[tuple[str, float, float], list[RunEvaluation]] = {}
    for run in evaluations:
        series.setdefault((run.set_name, run.mass_kg, run.torque_nm), []).append(run)
    rows = [row for runs in series.values() for row in _slope_rows(sorted(runs, key=lambda run: run.slope_deg))]
    columns = ("set", "mass, kg", "torque, N m", "slope, °", "ends at x, m", "final", "max.")
    return _SLOPES.format(table=_markdown(columns, rows, left=1))


def _slope_rows(runs: Sequence[RunEvaluation]) -> Iterator[tuple[str, ...]]:
    """Of one series by slope: each run, then median and 90th percentile over those that have slopes on both sides."""
    same = runs[0].set_name, f"{runs[0].mass_kg:g}", f"{runs[0].torque_nm:g}"
    inner = runs[1:-1]
    for at, run in enumerate(runs):
        mark = "" if 0 < at < len(runs) - 1 else ", extrapolated"
        errors = _cm(run.model.final_m), _cm(run.model.maximum_m)
        yield *same, f"{run.slope_deg:g}{mark}", f"{run.final_x_m:.3f}", *errors
    for words, level in (("median", 0.5), ("90th percentile", 0.9)) if inner else ():
        values = ([run.model.final_m for run in inner], [run.model.maximum_m for run in inner])
        yield *same, f"{words} of {len(inner)} inner", "", *(_cm(float(np.quantile(each, level))) for each in values)


def _groups(evaluations: Sequence[RunEvaluation]) -> Iterator[tuple[tuple[str, str], list[RunEvaluation]]]:
    """Runs by set and kind, then all sets together; groups without runs are left out."""
    sets = list(dict.fromkeys(run.set_name for run in evaluations))
    for name in [*sets, None] if len(sets) > 1 else sets:
        inside = [run for run in evaluations if name in (None, run.set_name)]
        kinds = {kind: [run for run in inside if kind_of(run) == kind] for kind in KINDS}
        for kind, runs in kinds.items():
            if runs:
                yield (name or "all sets", kind), runs
        if all(len(runs) < len(inside) for runs in kinds.values()):
            yield (name or "all sets", "all"), inside


def _quantiles(runs: Sequence[RunEvaluation]) -> tuple[str, ...]:
    final = [run.model.final_m for run in runs]
    relative = [run.relative_final for run in runs]
    prior = [run.prior.final_m for run in runs if run.prior is not None]
    return (
        str(len(runs)),
        *(_percent(float(np.quantile(relative, level))) for level in (0.5, 0.9)),
        _percent(float(np.quantile([run.relative_maximum for run in runs], 0.9))),
        *(_cm(float(np.quantile(final, level))) for level in (0.5, 0.9, 1.0)),
        _cm(float(np.median(prior))) if prior else "",
    )


def _markdown(columns: Sequence[str], rows: Sequence[Sequence[str]], left: int) -> str:
    rule = ["---"] * left + ["---:"] * (len(columns) - left)
    escaped = ([cell.replace("|", r"\|") for cell in row] for row in (columns, rule, *rows))
    return "\n".join(f"| {' | '.join(row)} |" for row in escaped)


def _cm(metres: float) -> str:
    return f"{100 * metres:.2f} cm"


def _percent(share: float) -> str:
    return f"{100 * share:.2f} %"


def errors_figure(evaluations: Sequence[RunEvaluation], rover: RoverParameters, regolith: RegolithParameters) -> Figure:
    """Final error of each run by colour, over slope and torque ratio (of drives at the start); shapes are kinds."""
    figure, axes = new_axes(
        "Final error of runs left out one at a time", "slope, °", "torque / (mass · gravity · wheel radius)"
    )
    error_cm = np.maximum([100 * run.model.final_m for run in evaluations], SMALLEST_CM)
    norm = LogNorm(float(error_cm.min()), max(float(error_cm.max()), 1.01 * float(error_cm.min())))
    drawn = None
    for kind, marker in zip(KINDS, ("o", "X", "D"), strict=True):
        chosen = [index for index, run in enumerate(evaluations) if kind_of(run) == kind]
        if chosen:
            runs = [evaluations[index] for index in chosen]
            drawn = axes.scatter(
                [run.slope_deg for run in runs],
                [_torque_ratio(run, rover, regolith) for run in runs],
                c=error_cm[chosen], norm=norm, cmap="viridis_r", marker=marker, s=52, edgecolors="black",
                linewidths=0.6,
            )  # fmt: skip
            axes.plot([], [], marker, color="none", markerfacecolor="#bbbbbb", markeredgecolor="black", label=kind)
    assert drawn is not None
    bar = figure.colorbar(drawn, ax=axes, label="distance from Chrono's final position, cm", pad=0.02)
    bar.ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.legend(frameon=True, fontsize=9, loc="best")
    return figure


def _torque_ratio(run: RunEvaluation, rover: RoverParameters, regolith: RegolithParameters) -> float:
    return float(torque_ratio(rover, regolith, Scenarios.of(run.slope_deg, run.mass_kg, run.torque_nm))[0])


def time_figure(evaluations: Sequence[RunEvaluation], curves: Sequence[ErrorCurve]) -> Figure:
    """Median and 90th percentile, over the runs that last as long, of the error at each time."""
    figure, axes = new_axes("Error against time, runs left out one at a time", "time, s", "distance from Chrono, cm")
    log_cm(axes)
    kinds = {run.run: kind_of(run) for run in evaluations}
    for words, colour in zip(KINDS, ("#009E73", "#D55E00", "#0072B2"), strict=True):
        chosen = [curve for curve in curves if kinds[curve.run] == words]
        if not chosen:
            continue
        times = np.linspace(0.0, max(curve.time_s[-1] for curve in chosen), _TIMES)
        for level, dashes, name in ((0.5, "-", "median"), (0.9, "--", "90th percentile")):
            error_cm = np.maximum(100 * _quantile_at(times, chosen, level), SMALLEST_CM)
            axes.plot(times, error_cm, dashes, color=colour, linewidth=1.8, label=f"{words}, {name} ({len(chosen)})")
    axes.legend(frameon=False, fontsize=9, loc="lower right")
    return figure


def _quantile_at(times: Array, curves: Sequence[ErrorCurve], level: float) -> Array:
    """The quantile over the curves at each time; a curve that has ended counts no more."""
    grid = np.array([np.interp(times, curve.time_s, curve.error_m, right=np.nan) for curve in curves])
    return np.asarray(np.nanquantile(grid, level, axis=0))


_PAGE = f"""# Errors on left-out runs

Each run was predicted without it; only what is chosen once for all runs, such as hyperparameters, stays as it is.
Errors are distances between predicted and simulated positions of the reference wheel: *final* after the run's horizon,
*max.* the largest during the run. *Relative* is the final error over the way that the rover went, up and down, or over
{LEAST_WAY_M:g} m where it went less; *on the way* is the largest error over the same. In *drives* slope, torque or
brake change, and a prior has no answer; of the other runs, *climbing* ones end above {CLIMBS_ABOVE_M:g} m.

{{table}}

![Final error over slope and torque ratio](left_out_errors.svg)

![Error against time](left_out_time.svg)

## The {{count}} runs with the largest relative errors

{{worst}}
"""

_SLOPES = """
## One slope left out of its series

A series is the runs of one set with the same mass and torque. Each run was predicted from the other slopes of its own
series, and no other run. The ends of a series are extrapolated; median and 90th percentile are over the others.

{table}
"""
