"""The card of a version as a picture (errors by regime, where its runs lie) and as a page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from service.pictures.drawing import Drawing, dress
from service.pictures.palette import FAINT, FIRST, INK, MARK, SECOND
from service.pictures.report import Cell, Report, Section, StoredFigure, Table, as_html
from service.wire.versions.card import Card, counted

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SIZE_INCHES = (10.5, 5.0)
_SMALLEST_CM = 0.01
_SPREAD = 0.26  # of dots around the line of their regime


def drawing_of_card(card: Card) -> Drawing:
    """The picture, to be drawn."""
    shown = "; ".join(
        f"{each.regime}: median {100 * each.final.median_m:.3g} cm over {each.runs} runs"
        for each in card.answer.regimes
    )
    told = (
        f"Errors at the end of left-out runs, by regime: {shown or 'none'}. Beside it slopes and torques of the runs."
    )
    return Drawing(f"{card.version}: errors on unseen runs, and where its runs lie", told, lambda: figure_of_card(card))


def figure_of_card(card: Card) -> Figure:
    """Left the final error of each left-out run by regime, right the scenarios of these runs and the domain."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - a second that only those pay who ask for a picture

    figure = Figure(figsize=_SIZE_INCHES)
    errors = figure.add_axes((0.255, 0.12, 0.37, 0.70))
    scenarios = figure.add_axes((0.705, 0.12, 0.28, 0.70))
    _errors(errors, card)
    _scenarios(scenarios, card)
    head = f"{card.version}: how far from Chrono on runs that it has not seen, and where its runs lie"
    figure.text(0.015, 0.945, head, fontsize=12, fontweight="bold")
    return figure


def card_as_html(card: Card) -> bytes:
    """The page. Raises MissingPartError where Matplotlib is not installed."""
    answer, drawing = card.answer, drawing_of_card(card)
    facts: dict[str, Cell] = {
        "state": answer.state,
        "published": f"{answer.created_at:%Y-%m-%d %H:%M} UTC by {answer.created_by}",
        "architecture": answer.architecture,
        "prior": answer.prior,
        "left-out runs": answer.left_out_runs,
        "band": "yes" if answer.band is not None else "no, or not measured",
    }
    sections = [
        Section("Where it must not be used", ["Or only with care:"], answer.not_for),
        Section("Errors on runs that it has not seen", [drawing.description], figure=drawing, tables=[_regimes(card)]),
        *_band(card),
        Section("Domain: what its runs cover", tables=[_domain(card)]),
        Section("Lineage: what it was made from", tables=[_datasets(card), _lineage(card)]),
        *(Section(name.replace("_", " "), figure=StoredFigure(f"Figure of the report: {name}", svg))
          for name, svg in card.figures.items()),
    ]  # fmt: skip
    warning = "" if answer.state == "published" else f"This version is {answer.state}."
    return as_html(
        Report(title=f"Model card: {card.version}", lead=answer.description, facts=facts, sections=sections,
               warning=warning)
    )  # fmt: skip


def _errors(axes: Axes, card: Card) -> None:
    regimes = card.answer.regimes
    for row, each in enumerate(regimes):
        runs = [run for run in card.runs if run.regime == each.regime]
        places = row + _SPREAD * np.linspace(-1, 1, len(runs)) if len(runs) > 1 else [row]
        cm = np.maximum([100 * run.model.final_m for run in runs], _SMALLEST_CM)
        axes.plot(cm, places, "o", color=FIRST, markersize=3.4, alpha=0.6, markeredgewidth=0)
        _tick(axes, row, each.final.median_m, INK)
        _tick(axes, row, each.final.p90_m, MARK)
        if each.prior_final is not None:
            _tick(axes, row, each.prior_final.median_m, SECOND, ":")
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    dress(axes, "", "distance at the end of the run, cm, logarithmic")
    axes.set_yticks(range(len(regimes)), [folded(each.regime, each.runs) for each in regimes], fontsize=9)
    axes.set_ylim(max(len(regimes), 1) - 0.5, -0.5)
    if not regimes:
        axes.text(0.5, 0.5, "no left-out runs", transform=axes.transAxes, ha="center", color=FAINT)
        return
    _key(axes, with_prior=any(each.prior_final is not None for each in regimes))


def _key(axes: Axes, *, with_prior: bool) -> None:
    from matplotlib.lines import Line2D  # noqa: PLC0415 - as above

    handles = [
        Line2D([], [], color=FIRST, marker="o", markersize=4, linestyle="none", label="a run"),
        Line2D([], [], color=INK, linewidth=2, label="median"),
        Line2D([], [], color=MARK, linewidth=2, label="90 % are nearer"),
        *(
            [Line2D([], [], color=SECOND, linewidth=2, linestyle=":", label="prior alone, median")]
            if with_prior
            else []
        ),
    ]
    axes.legend(handles=handles, frameon=False, fontsize=8, loc="lower left", bbox_to_anchor=(-0.02, 0.995), ncols=4,
                columnspacing=1.0, handlelength=1.4)  # fmt: skip


def _tick(axes: Axes, row: int, metres: float, colour: str, dashes: str = "-") -> None:
    at = max(100 * metres, _SMALLEST_CM)
    axes.plot([at, at], [row - 0.36, row + 0.36], dashes, color=colour, linewidth=2.0)


def folded(regime: str, runs: int) -> str:
    """A regime with the number of its runs, in lines that are short enough to stand beside a picture."""
    head, _, rest = regime.partition(" (")
    head = head.replace(", ", ",\n")
    return f"{head}\n{counted(runs)}" if not rest else f"{head}\n({rest}\n{counted(runs)}"


def _scenarios(axes: Axes, card: Card) -> None:
    for varies, marker, label in ((False, "o", "constant run"), (True, "D", "drive, at start")):
        runs = [run for run in card.runs if run.varies == varies]
        if runs:
            slopes, torques = [run.slope_deg for run in runs], [run.torque_nm for run in runs]
            face = FIRST if not varies else "none"
            axes.scatter(
                slopes, torques, s=18, marker=marker, facecolors=face, edgecolors=FIRST, alpha=0.7, label=label
            )
    spans = card.answer.domain
    if {"slope_deg", "torque_nm"} <= spans.keys():
        (left, right), (low, high) = spans["slope_deg"], spans["torque_nm"]
        axes.plot([left, right, right, left, left], [low, low, high, high, low], color=FAINT, linewidth=1.0,
                  linestyle="--", label="domain")  # fmt: skip
    dress(axes, "", "slope, ° (uphill)", "stall torque per wheel, N m")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, fontsize=8, loc="lower left", bbox_to_anchor=(-0.03, 0.995), ncols=3,
                    columnspacing=1.0, handlelength=1.4)  # fmt: skip


def _regimes(card: Card) -> Table:
    columns = ("regime", "runs", "final median_m", "final p90_m", "rmse median_m", "rmse p90_m", "prior final median_m")
    rows = [
        (
            each.regime, each.runs, each.final.median_m, each.final.p90_m, each.rmse.median_m, each.rmse.p90_m,
            None if each.prior_final is None else each.prior_final.median_m,
        )
        for each in card.answer.regimes
    ]  # fmt: skip
    return Table("Distance from Chrono's positions, m, of runs predicted without them", columns, rows, digits=3)


def _band(card: Card) -> list[Section]:
    band = card.answer.band
    if band is None:
        return []
    rows = [(name, int(each["runs"]), each["pointwise"], each["whole"]) for name, each in band["regimes"].items()]
    said = f"Made without the run, at the level {band['level']:g}: the share of times, and of whole runs, that it held."
    return [
        Section("What the band held", [said],
                tables=[Table("Band on left-out runs", ("regime", "runs", "pointwise", "whole"), rows, digits=3)])
    ]  # fmt: skip


def _domain(card: Card) -> Table:
    rows: list[tuple[Cell, ...]] = [(field, *span) for field, span in card.answer.domain.items()]
    return Table("Ranges of the training runs", ("field", "lowest", "highest"), rows)


def _datasets(card: Card) -> Table:
    return Table("Datasets", ("name", "id"), [(each.name, each.id) for each in card.answer.datasets])


def _lineage(card: Card) -> Table:
    answer = card.answer
    rows: list[tuple[Cell, ...]] = [
        ("training job", answer.job or "none: not trained by a job"),
        *((f"runs to {part} on", count) for part, count in answer.runs.items()),
        ("seed", answer.seed),
        ("code", answer.code_version),
        ("command", answer.command),
        ("weights sha256", answer.weights_sha256),
        ("same weights as", answer.same_weights_as),
    ]
    return Table("How it was made", ("what", "value"), rows)
