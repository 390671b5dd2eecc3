"""How far a version may be trusted, as measured on left-out runs: Markdown and a figure for its report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from service.training.drawing import as_svg, new_axes

_COLUMNS = ("regime", "runs", "times inside", "whole runs inside", "y inside", "half-width at the end")
_INSIDE, _WHOLE = "#0072B2", "#D55E00"


def doubt_report(measured: Mapping[str, Any], steeper: Mapping[str, Any] | None = None) -> dict[str, bytes]:
    """Files of the report by their path in a version, from `Doubt.measured` and `measure_steeper`.

    The same input gives the same bytes.
    """
    return {
        "report/doubt.md": (_page(measured) + _steeper(steeper)).encode(),
        "report/doubt_regimes.svg": as_svg(regimes_figure(measured)),
        "report/doubt_reliability.svg": as_svg(reliability_figure(measured)),
    }


def regimes_figure(measured: Mapping[str, Any]) -> Figure:
    """How much of times and of whole runs bands made without a run held, by regime."""
    figure, axes = new_axes(f"Band at {_percent(measured['level'])}: inside, by regime", "share", "")
    regimes = measured["regimes"]
    for words, colour, name, shift in (("times", _INSIDE, "pointwise", -0.18), ("whole runs", _WHOLE, "whole", 0.18)):
        places, shares = [row + shift for row in range(len(regimes))], [each[name] for each in regimes.values()]
        axes.barh(places, shares, 0.34, color=colour, label=words)
    axes.axvline(measured["level"], color="black", linewidth=0.8)
    axes.set_yticks(list(range(len(regimes))), [f"{name} ({each['runs']})" for name, each in regimes.items()])
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.0)
    axes.xaxis.set_major_formatter(PercentFormatter(1.0))
    axes.legend(frameon=True, fontsize=9, loc="lower left")
    return figure


def reliability_figure(measured: Mapping[str, Any]) -> Figure:
    """What was said against what was found: of the band by level, of the outcomes' probabilities by fifths."""
    figure, axes = new_axes("Said and found, left-out runs", "said", "found", size=(4.6, 4.2))
    axes.plot([0.3, 1.0], [0.3, 1.0], color="black", linewidth=0.8)
    said = [float(level) for level in measured["levels"]]
    axes.plot(said, list(measured["levels"].values()), "o-", color=_INSIDE, markersize=4, label="band: times inside")
    fifths = measured["outcomes"]["fifths"]
    sure, right = [each["said"] for each in fifths], [each["right"] for each in fifths]
    axes.plot(sure, right, "s", color=_WHOLE, label="outcomes, in fifths")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(PercentFormatter(1.0))
    axes.legend(frameon=False, fontsize=9, loc="upper left")
    return figure


def _page(measured: Mapping[str, Any]) -> str:
    regimes = [
        (name, str(each["runs"]), _percent(each["pointwise"]), _percent(each["whole"]), _percent(each["y_pointwise"]),
         f"{100 * each['median_half_width_m']:.1f} cm")
        for name, each in measured["regimes"].items()
    ]  # fmt: skip
    outcomes = measured["outcomes"]
    fifths = [(str(each["runs"]), _percent(each["said"]), _percent(each["right"])) for each in outcomes["fifths"]]
    levels = [(_percent(float(level)), _percent(share)) for level, share in measured["levels"].items()]
    return _PAGE.format(
        level=_percent(measured["level"]),
        runs=measured["runs"],
        y=_percent(measured["y"]),
        regimes=_table(_COLUMNS, regimes),
        levels=_table(("level", "times inside"), levels),
        counts=", ".join(f"{count} {name}" for name, count in outcomes["of_each"].items()),
        right=_percent(outcomes["right"]),
        score=f"{outcomes['log_score']:.3f}",
        base=f"{outcomes['log_score_of_base_rates']:.3f}",
        fifths=_table(("runs", "said", "came true"), fifths),
    )


def _steeper(found: Mapping[str, Any] | None) -> str:
    if found is None:
        return ""
    between = found["between_deg"]
    where = "" if between is None else f", from {between[0]:g} to {between[1]:g} °, by {found['most_m']:.2f} m at most"
    return _STEEPER.format(**found, per_cent=_percent(found["share"], 2), where=where)


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    rule = ["---"] + ["---:"] * (len(columns) - 1)
    return "\n".join(f"| {' | '.join(row)} |" for row in (columns, rule, *rows))


def _percent(share: float, digits: int = 1) -> str:
    return f"{100 * share:.{digits}f} %"


_PAGE = """# How far to trust this version

Measured on {runs} runs, each with a model, a band and probabilities that were made without it. The band is made by
driving the model with its force balance wrong by as much as left-out runs suggest there (a fraction of the weight).

![What bands held, by regime](doubt_regimes.svg)

![What was said against what was found](doubt_reliability.svg)

## The band at {level}

*Times inside*: mean over the runs of the share of times at which x is inside. *Half-width*: of x at the end, median.
The first three regimes are constant, uphill scenarios that do not slide, by their reserve: the resistance, as a
fraction of the weight, against which the rover would still climb: more than 0.25, 0.12 to 0.25, less. Drives are runs
whose slope, torque or brake change. Over all runs y is inside at {y} of times.

{regimes}

By level, all runs:

{levels}

## Outcomes

Of these runs, {counts}. The most probable outcome was right for {right}. The mean log score is {score} (lower is
better), that of the outcomes' base rates {base}. In fifths, by how sure the version was:

{fifths}
"""

_STEEPER = """
## Steeper never gets further

In {columns} columns of one mass and torque inside the domain, {further} of {steps} steps of {step_deg} ° more
({per_cent}) take the rover more than {allowed_m} m further in ten seconds, in {columns_with_one} columns{where}.
In {sure} of these steps the bands of both slopes do not overlap.
"""
