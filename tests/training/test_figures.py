from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

from service.learning.evaluate import PositionErrors, RunEvaluation, way_m
from service.learning.network.fit_config import FitConfig
from service.learning.observed import Controls
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.scenario import Positions
from service.training.drawing import RENDERERS
from service.training.figures import STYLES, reproduction_figures
from service.training.report import KINDS, error_curves, kind_of, left_out_report
from service.training.reproduce import CONTESTANTS, Effort, Reproduction, Row, Trial, set_course
from tests.learning.synthetic import synthetic_run
from tests.training.test_reproduce import paper_store

MOST_BYTES = 300_000
NAMES = {"figure_2_positions", "figure_3_distance", "error_against_time", "figure_4_double_mass"}


@pytest.fixture(scope="module")
def reproduction(tmp_path_factory) -> Reproduction:
    """As `reproduce` makes it, with predictions that are off by a centimetre times the contestant's number."""
    course = set_course(paper_store(tmp_path_factory.mktemp("figures") / "store"))
    rows = []
    for number, contestant in enumerate(CONTESTANTS, start=1):
        off = [Positions(run.x_m[None] + 0.01 * number, run.y_m[None]) for run in (course.unseen, course.heavy)]
        errors = [PositionErrors.between(*pair) for pair in zip(off, (course.unseen, course.heavy), strict=True)]
        rows.append(Row(contestant, (Trial(1, *off, *errors, 0.01),), 1.0))
    return Reproduction(course, Effort(1, FitConfig()), tuple(rows))


def drawn(reproduction, kind):
    """The files of all figures; a figure that is drawn again is another one."""
    return {name: RENDERERS[kind](figure) for name, figure in reproduction_figures(reproduction).items()}


@pytest.fixture(scope="module")
def twice(reproduction, slow):
    """Every file of one kind, made two times."""
    return {kind: (drawn(reproduction, kind), drawn(reproduction, kind)) for kind in RENDERERS}


def test_there_are_the_papers_four_figures(twice):
    assert twice["svg"][0].keys() == NAMES


@pytest.mark.parametrize("name", sorted(NAMES))
def test_a_figure_is_small_svg_with_every_series_and_units(twice, name):
    svg = twice["svg"][0][name]
    assert ET.fromstring(svg).tag == "{http://www.w3.org/2000/svg}svg"
    assert len(svg) < MOST_BYTES
    text = svg.decode()
    for style in STYLES.values():
        assert f"<!-- {style.label} -->" in text
    assert "cm -->" in text or ", m -->" in text
    assert "<dc:date>" not in text


@pytest.mark.parametrize("kind", RENDERERS)
@pytest.mark.parametrize("name", sorted(NAMES))
def test_the_same_numbers_give_the_same_bytes(twice, name, kind):
    one, other = twice[kind]
    assert one[name] == other[name]


def test_other_numbers_give_other_bytes(reproduction, twice):
    row = reproduction.rows[0]
    moved = replace(row.trials[0], unseen=Positions(row.trials[0].unseen.x_m + 0.1, row.trials[0].unseen.y_m))
    changed = replace(reproduction, rows=(replace(row, trials=(moved,)), *reproduction.rows[1:]))
    others = drawn(changed, "svg")
    for name in NAMES - {"figure_4_double_mass"}:
        assert others[name] != twice["svg"][0][name]


def test_a_png_is_a_png(twice):
    png = twice["png"][0]["figure_3_distance"]
    assert png.startswith(b"\x89PNG\r\n")
    assert len(png) < MOST_BYTES


def left_out():
    """Runs that climb, one that does not and one that varies, each predicted 1 cm, 2 cm, ... away."""
    runs = [synthetic_run(slope) for slope in (0, 5, 10, 15, 20)]
    stalled = replace(synthetic_run(30), x_m=np.full(81, 0.01))
    drive = replace(synthetic_run(12), controls=Controls(brake=stalled.time_s > 3.0))
    sets = ["paper"] * 3 + ["space"] * 3 + ["drive"]
    runs = [replace(run, set_name=name) for name, run in zip(sets, [*runs, stalled, drive], strict=True)]
    positions = {
        run.name: Positions(run.x_m[None] + 0.01 * number, run.y_m[None]) for number, run in enumerate(runs, start=1)
    }
    evaluations = []
    for run in runs:
        errors = PositionErrors.between(positions[run.name], run)
        scenario = run.slope_deg, run.mass_kg, run.torque_nm, run.horizon_s
        went = float(run.x_m[-1]), way_m(run), run.varies
        evaluations.append(
            RunEvaluation(run.name, run.set_name, *scenario, *went, errors, None if run.varies else errors)
        )
    return evaluations, error_curves(runs, positions)


@pytest.fixture(scope="module")
def report():
    return left_out_report(*left_out(), VIPER, LUNAR_REGOLITH)


@pytest.mark.slow
def test_the_left_out_report_is_small_files_that_are_the_same_each_time(report):
    one, other = report, left_out_report(*left_out(), VIPER, LUNAR_REGOLITH)
    assert one == other
    assert one.keys() == {"report/left_out.md", "report/left_out_errors.svg", "report/left_out_time.svg"}
    for name, content in one.items():
        assert len(content) < MOST_BYTES
        if name.endswith(".svg"):
            assert ET.fromstring(content).tag == "{http://www.w3.org/2000/svg}svg"
            assert name.removeprefix("report/") in one["report/left_out.md"].decode()


@pytest.mark.slow
def test_the_left_out_table_tells_sets_and_kinds_apart(report):
    page = report["report/left_out.md"].decode()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in page.splitlines() if line[:1] == "|"]
    found = {(row[0], row[1]): row[2:] for row in rows if row[1] in (*KINDS, "all")}
    assert {names: int(cells[0]) for names, cells in found.items()} == {
        ("paper", "climbing"): 3,
        ("space", "climbing"): 2,
        ("space", "stalling or sliding"): 1,
        ("space", "all"): 3,
        ("drive", "drives"): 1,
        ("all sets", "climbing"): 5,
        ("all sets", "stalling or sliding"): 1,
        ("all sets", "drives"): 1,
        ("all sets", "all"): 7,
    }
    assert found["paper", "climbing"][4:7] == ["2.00 cm", "2.80 cm", "3.00 cm"]
    assert found["space", "stalling or sliding"][1:5] == ["12.00 %", "12.00 %", "12.00 %", "6.00 cm"]
    assert found["paper", "climbing"][-1] == "2.00 cm"
    assert found["drive", "drives"][-1] == ""  # no prior has an answer


@pytest.mark.slow
def test_a_section_tells_how_well_slopes_are_predicted_from_the_others():
    evaluations, curves = left_out()
    series = [replace(run, set_name="a|b") for run in evaluations[4::-1]]
    other = [replace(run, mass_kg=860.0) for run in series]
    page = left_out_report(evaluations, curves, VIPER, LUNAR_REGOLITH, [*series, *other])["report/left_out.md"].decode()
    rows = [line.strip("| ").split(" | ") for line in page.split("## One slope left out of its series")[1].splitlines()]
    of_one = [row[3:] for row in rows if row[:3] == [r"a\|b", "430", "60"]]
    assert [row[0] for row in of_one] == [
        "0, extrapolated", "5", "10", "15", "20, extrapolated", "median of 3 inner", "90th percentile of 3 inner",
    ]  # fmt: skip
    assert [row[2] for row in of_one] == ["1.00 cm", "2.00 cm", "3.00 cm", "4.00 cm", "5.00 cm", "3.00 cm", "3.80 cm"]
    assert [row[3:] for row in rows if row[:3] == [r"a\|b", "860", "60"]] == of_one


@pytest.mark.slow
def test_without_series_there_is_no_such_section(report):
    evaluations, curves = left_out()
    assert b"One slope left out" not in report["report/left_out.md"]
    assert left_out_report(evaluations, curves, VIPER, LUNAR_REGOLITH, evaluations).keys() == report.keys()


def test_each_run_is_of_one_kind():
    evaluations, _ = left_out()
    assert [kind_of(run) for run in evaluations] == [KINDS[0]] * 5 + list(KINDS[1:])


def test_error_curves_keep_the_first_and_the_last_error():
    evaluations, curves = left_out()
    for number, (run, curve) in enumerate(zip(evaluations, curves, strict=True), start=1):
        assert curve.run == run.run
        assert (curve.time_s[0], curve.time_s[-1]) == (0.0, run.horizon_s)
        np.testing.assert_allclose(curve.error_m, 0.01 * number)


def test_no_runs_no_report():
    with pytest.raises(ValueError, match="at least one run"):
        left_out_report([], [], VIPER, LUNAR_REGOLITH)


@pytest.mark.slow
def test_a_name_cannot_break_the_table():
    evaluations, curves = left_out()
    odd = [replace(evaluations[0], set_name="a|b"), *evaluations[1:]]
    page = left_out_report(odd, curves, VIPER, LUNAR_REGOLITH)["report/left_out.md"].decode()
    assert r"a\|b" in page
