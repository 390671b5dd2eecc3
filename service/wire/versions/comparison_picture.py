"""Two versions side by side as a picture (errors by regime, curves on chosen slopes) and as a page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from service.pictures.drawing import Drawing, dress
from service.pictures.palette import FAINT, FIRST, INK, SECOND
from service.pictures.report import Cell, Report, Section, Table, as_html
from service.wire.versions.card import SpreadAnswer
from service.wire.versions.card_picture import folded
from service.wire.versions.comparison import ComparisonAnswer, CurveAnswer

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SIZE_INCHES = (10.5, 5.6)
_SMALLEST_CM = 0.01
_SHIFT = 0.17
_GAP_INCHES = 0.14  # between two names at the ends of curves


def drawing_of_comparison(answer: ComparisonAnswer) -> Drawing:
    """The picture, to be drawn."""
    return Drawing(f"{answer.candidate} beside {answer.against}", _told(answer), lambda: figure_of_comparison(answer))


def figure_of_comparison(answer: ComparisonAnswer) -> Figure:
    """Left the errors of both by regime on the runs unseen by both, right their positions over time."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - a second that only those pay who ask for a picture

    figure = Figure(figsize=_SIZE_INCHES)
    errors = figure.add_axes((0.215, 0.115, 0.31, 0.72))
    curves = figure.add_axes((0.615, 0.435, 0.33, 0.40))
    difference = figure.add_axes((0.615, 0.115, 0.33, 0.25), sharex=curves)
    _errors(errors, answer)
    _curves(curves, answer)
    _difference(difference, answer)
    figure.text(0.015, 0.95, f"{answer.candidate} beside {answer.against}: {answer.verdict.replace('_', ' ')}",
                fontsize=12, fontweight="bold")  # fmt: skip
    if answer.curves is not None and any("*" in _name(each) for each in answer.curves.slopes):
        note = "* outside the domain of one of them"
        figure.text(0.985, 0.012, note, ha="right", va="bottom", fontsize=8, color=FAINT)
    return figure


def comparison_as_html(answer: ComparisonAnswer) -> bytes:
    """The page. Raises MissingPartError where Matplotlib is not installed."""
    drawing = drawing_of_comparison(answer)
    facts: dict[str, Cell] = {
        "verdict": answer.verdict.replace("_", " "),
        "promote": answer.promote,
        "runs unseen by both": answer.common_runs,
        "ratio of rms errors": answer.ratio,
        "margin": answer.margin,
    }
    missing = [f"No curves: {answer.curves_missing}."] if answer.curves_missing else []
    sections = [
        Section(
            "Side by side", [drawing.description, *missing], figure=drawing, tables=[_regimes(answer), *_ends(answer)]
        ),
        *_tails(answer),
        Section("Domains", [_domain_words(answer)], tables=[_domain(answer)]),
        *_points(answer),
    ]
    return as_html(
        Report(title=f"{answer.candidate} beside {answer.against}", lead=answer.sentence + ".", facts=facts,
               sections=sections)
    )  # fmt: skip


def _errors(axes: Axes, answer: ComparisonAnswer) -> None:
    sides = ((answer.candidate, FIRST, "o", -_SHIFT), (str(answer.against), SECOND, "s", _SHIFT))
    for row, each in enumerate(answer.regimes):
        for (name, colour, marker, shift), final in zip(sides, (each.candidate_final, each.against_final), strict=True):
            middle, high = (max(100 * value, _SMALLEST_CM) for value in (final.median_m, final.p90_m))
            axes.plot([middle, high], [row + shift] * 2, "-", color=colour, linewidth=2.2)
            axes.plot(high, row + shift, "|", color=colour, markersize=9, markeredgewidth=2.2)
            label = name if row == 0 else None
            axes.plot(middle, row + shift, marker, color=colour, markersize=6.5, linestyle="none", label=label)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    dress(axes, "Error at the end: median, and bar to 90 %", "cm from Chrono, logarithmic")
    names = [folded(each.regime, each.runs) for each in answer.regimes]
    axes.set_yticks(range(len(names)), names, fontsize=8.5)
    axes.set_ylim(max(len(names), 3) - 0.5, -0.5)
    if names:
        axes.legend(frameon=False, fontsize=8.5, loc="lower left", bbox_to_anchor=(-0.02, -0.01))
    else:
        axes.text(0.5, 0.5, "no runs unseen by both", transform=axes.transAxes, ha="center", color=FAINT)


def _curves(axes: Axes, answer: ComparisonAnswer) -> None:
    curves = answer.curves
    if curves is None:
        axes.text(
            0.5, 0.5, "no curves: one of them cannot predict here", transform=axes.transAxes, ha="center", color=FAINT
        )
        dress(axes, "Position along the slope", "", "x, m")
        return
    for number, each in enumerate(curves.slopes):
        labels = (answer.candidate, answer.against) if number == 0 else (None, None)
        axes.plot(curves.time_s, each.against_x_m, "--", color=SECOND, linewidth=1.7, label=labels[1])
        axes.plot(curves.time_s, each.candidate_x_m, "-", color=FIRST, linewidth=1.7, label=labels[0])
    title = f"Position, {curves.mass_kg:g} kg, {curves.torque_nm:g} N m, by slope"
    dress(axes, title, "", "x along the slope, m")
    axes.tick_params(labelbottom=False)
    axes.set_xlim(0, curves.time_s[-1])
    _name_ends(axes, curves.time_s[-1], [(each.candidate_x_m[-1], _name(each)) for each in curves.slopes])
    axes.legend(frameon=False, fontsize=8.5, loc="upper left")


def _difference(axes: Axes, answer: ComparisonAnswer) -> None:
    """How far the candidate is ahead, by slope: what the curves above are too near to show."""
    dress(axes, "", "time, s", "ahead, cm")
    axes.axhline(0, color=FAINT, linewidth=0.8)
    curves = answer.curves
    if curves is None:
        return
    ends = []
    for each in curves.slopes:
        ahead = [100 * (ours - theirs) for ours, theirs in zip(each.candidate_x_m, each.against_x_m, strict=True)]
        axes.plot(curves.time_s, ahead, color=FIRST, linewidth=1.3)
        ends.append((ahead[-1], _name(each)))
    axes.set_title(f"{answer.candidate} ahead of {answer.against}", fontsize=9, loc="left", pad=3)
    _name_ends(axes, curves.time_s[-1], ends)


def _name(curve: CurveAnswer) -> str:
    return f"{curve.slope_deg:g}°" + ("" if curve.candidate_inside_domain and curve.against_inside_domain else " *")


def _name_ends(axes: Axes, time_s: float, ends: list[tuple[float, str]]) -> None:
    """The slope beside the end of each curve, at its value; names keep off each other."""
    low, high = axes.get_ylim()
    gap = _GAP_INCHES / (axes.get_position().height * _SIZE_INCHES[1]) * (high - low)
    last = -float("inf")
    for value, name in sorted(ends):
        at = max(value, last + gap)
        axes.annotate(name, (time_s, at), xytext=(4, 0), textcoords="offset points", va="center", fontsize=8.5,
                      color=INK, annotation_clip=False)  # fmt: skip
        last = at


def _told(answer: ComparisonAnswer) -> str:
    regimes = "; ".join(
        f"{each.regime}: {100 * each.candidate_final.median_m:.3g} cm and {100 * each.against_final.median_m:.3g} cm"
        for each in answer.regimes
    )
    curves = ""
    if answer.curves is not None:
        ends = ", ".join(f"{each.final_difference_m:+.3g} m on {each.slope_deg:g}°" for each in answer.curves.slopes)
        curves = f" At the end {answer.candidate} is ahead of {answer.against} by {ends}."
    return f"Median error at the end of runs unseen by both, by regime: {regimes or 'none in common'}.{curves}"


def _regimes(answer: ComparisonAnswer) -> Table:
    a, b = answer.candidate, answer.against
    kinds = ("final median_m", "final p90_m", "rmse median_m", "rmse p90_m")
    columns = ("regime", "runs", *(f"{kind}, {name}" for kind in kinds for name in (a, b)))
    rows: list[tuple[Cell, ...]] = []
    for each in answer.regimes:
        both = (each.candidate_final, each.against_final), (each.candidate_rmse, each.against_rmse)
        rows.append((each.regime, each.runs, *(value for pair in both for value in _four(pair))))
    return Table("Left-out errors by regime, m", columns, rows, digits=3)


def _four(pair: tuple[SpreadAnswer, SpreadAnswer]) -> tuple[float, float, float, float]:
    return pair[0].median_m, pair[1].median_m, pair[0].p90_m, pair[1].p90_m


def _tails(answer: ComparisonAnswer) -> list[Section]:
    if not answer.p90:
        return []
    columns = ("error", f"{answer.candidate}, m", f"{answer.against}, m", "ratio")
    rows = [(name, each["candidate_m"], each["against_m"], each["ratio"]) for name, each in answer.p90.items()]
    return [Section("What the gate looked at", tables=[Table("90th percentiles over the common runs", columns, rows)])]


def _ends(answer: ComparisonAnswer) -> list[Table]:
    if answer.curves is None:
        return []
    columns = ("slope_deg", f"outcome, {answer.candidate}", f"outcome, {answer.against}",
               f"final x_m, {answer.candidate}", f"final x_m, {answer.against}", "final_difference_m")  # fmt: skip
    rows = [
        (each.slope_deg, each.candidate_outcome, each.against_outcome, each.candidate_x_m[-1], each.against_x_m[-1],
         each.final_difference_m)
        for each in answer.curves.slopes
    ]  # fmt: skip
    return [Table(f"Ends of the curves after {answer.curves.time_s[-1]:g} s", columns, rows)]


def _points(answer: ComparisonAnswer) -> list[Section]:
    """Every tenth point of each curve."""
    if answer.curves is None:
        return []
    columns = ["time_s"]
    for each in answer.curves.slopes:
        columns += [f"{each.slope_deg:g}°, {name}" for name in (answer.candidate, answer.against)]
    rows = [
        (
            answer.curves.time_s[at],
            *(x[at] for each in answer.curves.slopes for x in (each.candidate_x_m, each.against_x_m)),
        )
        for at in range(0, len(answer.curves.time_s), 10)
    ]
    return [Section("The curves in numbers", tables=[Table("x, m; every tenth point", columns, rows)])]


def _domain(answer: ComparisonAnswer) -> Table:
    rows: list[tuple[Cell, ...]] = [
        (each.field, *(each.candidate or (None, None)), *(each.against or (None, None))) for each in answer.domain
    ]
    columns = (
        "field",
        *(f"{end}, {name}" for name in (answer.candidate, answer.against) for end in ("lowest", "highest")),
    )
    return Table("What the training runs of both cover", columns, rows)


def _domain_words(answer: ComparisonAnswer) -> str:
    other = [each.field for each in answer.domain if each.candidate != each.against]
    return f"They differ in {', '.join(other)}." if other else "Both cover the same ranges."
