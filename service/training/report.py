"""How well a version does on runs that were left out one at a time: Markdown and figures for its report."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import StrMethodFormatter

from service.learning.evaluate import RunEvaluation
from service.learning.observed import ObservedRun
from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array, Positions, Scenarios
from service.physics.similarity import torque_ratio
from service.training.drawing import SMALLEST_CM, as_svg, log_cm, new_axes

CLIMBS_ABOVE_M = 0.3  # a run that ends further up than this climbs; the others stall or slide back
_SMALLEST_DISTANCE_M = 0.05  # relative errors: distance travelled, or this where that is less
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


def climbs(run: RunEvaluation) -> bool:
    """Whether the simulated rover ends clearly above where it started."""
    return run.final_x_m > CLIMBS_ABOVE_M


def relative_error(run: RunEvaluation) -> float:
    """Final error over how far the rover got along the slope, or over 5 cm where that is less; dimensionless."""
    return run.model.final_m / max(abs(run.final_x_m), _SMALLEST_DISTANCE_M)


_COLUMNS = (
    "set", "runs", "count", "final median", "final p90", "final max", "max. median", "max. p90", "relative median",
    "relative p90", "prior alone, final median",
)  # fmt: skip


def _page(evaluations: Sequence[RunEvaluation]) -> str:
    rows = [(*names, *_quantiles(runs)) for names, runs in _groups(evaluations)]
    worst = sorted(evaluations, key=relative_error, reverse=True)[:_WORST]
    worst_rows = [
        (run.run, f"{run.slope_deg:g}", f"{run.mass_kg:g}", f"{run.torque_nm:g}", f"{run.final_x_m:.3f}",
         _cm(run.model.final_m), _cm(run.model.maximum_m), _percent(relative_error(run)))
        for run in worst
    ]  # fmt: skip
    worst_columns = ("run", "slope, °", "mass, kg", "torque, N m", "ends at x, m", "final", "max.", "relative")
    return _PAGE.format(
        table=_markdown(_COLUMNS, rows, left=2), count=len(worst), worst=_markdown(worst_columns, worst_rows, left=1)
    )


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
    """Runs by set and by whether they climb, then all sets together; groups without runs are left out."""
    sets = list(dict.fromkeys(run.set_name for run in evaluations))
    for name in [*sets, None] if len(sets) > 1 else sets:
        inside = [run for run in evaluations if name in (None, run.set_name)]
        up = [run for run in inside if climbs(run)]
        rest = [run for run in inside if not climbs(run)]
        for kind, runs in (("climbing", up), ("stalling or sliding", rest), ("both", inside)):
            if runs and not (kind == "both" and len(inside) in (len(up), len(rest))):
                yield (name or "all sets", kind), runs


def _quantiles(runs: Sequence[RunEvaluation]) -> tuple[str, ...]:
    final = [run.model.final_m for run in runs]
    maximum = [run.model.maximum_m for run in runs]
    relative = [relative_error(run) for run in runs]
    return (
        str(len(runs)),
        *(_cm(float(np.quantile(final, level))) for level in (0.5, 0.9, 1.0)),
        *(_cm(float(np.quantile(maximum, level))) for level in (0.5, 0.9)),
        *(_percent(float(np.quantile(relative, level))) for level in (0.5, 0.9)),
        _cm(float(np.median([run.prior.final_m for run in runs]))),
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
    """Final error of each run by colour, over slope and torque ratio; shapes tell climbing runs from others."""
    figure, axes = new_axes(
        "Final error of runs left out one at a time", "slope, °", "torque / (mass · gravity · wheel radius)"
    )
    error_cm = np.maximum([100 * run.model.final_m for run in evaluations], SMALLEST_CM)
    norm = LogNorm(float(error_cm.min()), max(float(error_cm.max()), 1.01 * float(error_cm.min())))
    drawn = None
    for up, marker, words in ((True, "o", "climbs"), (False, "X", "stalls or slides")):
        chosen = [index for index, run in enumerate(evaluations) if climbs(run) is up]
        if chosen:
            runs = [evaluations[index] for index in chosen]
            drawn = axes.scatter(
                [run.slope_deg for run in runs],
                [_torque_ratio(run, rover, regolith) for run in runs],
                c=error_cm[chosen], norm=norm, cmap="viridis_r", marker=marker, s=52, edgecolors="black",
                linewidths=0.6,
            )  # fmt: skip
            axes.plot([], [], marker, color="none", markerfacecolor="#bbbbbb", markeredgecolor="black", label=words)
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
    up = {run.run for run in evaluations if climbs(run)}
    for words, colour, chosen in (
        ("climbing", "#009E73", [curve for curve in curves if curve.run in up]),
        ("stalling or sliding", "#D55E00", [curve for curve in curves if curve.run not in up]),
    ):
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
*max.* the largest during the run. *Relative* is the final error over the distance from the start that the rover reached
along the slope, or over {100 * _SMALLEST_DISTANCE_M:g} cm where that is less.
*Climbing* runs end above {CLIMBS_ABOVE_M:g} m.

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
