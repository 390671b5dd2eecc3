"""The one page: whatever strangers write stays text, figures are named, colours can be told apart."""

from __future__ import annotations

from itertools import combinations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure

from service.pictures.drawing import Drawing, as_png, as_svg, inside_page
from service.pictures.palette import CLIMBS, INK, PAPER, SLIDES, STALLS, THEMES
from service.pictures.report import POLICY, Report, Section, StoredFigure, Table, as_html
from tests.pictures.looking import contrast, luminance, require_page, require_png, require_svg

HOSTILE = (
    '<script>alert("x")</script>', "</title><img src=x onerror=alert(1)>", "$\\frac{1}{0$", "a\0b\x1b[31m", "\ud800",
    "--><svg onload=alert(1)>", "{title} {0} %s", "'\"&amp;", "javascript:alert(1)", "]]>", "ü 月 \u202e",
)  # fmt: skip
words = st.one_of(st.sampled_from(HOSTILE), st.text(max_size=30))


def drawn(text: str) -> Figure:
    figure = Figure(figsize=(3, 2))
    axes = figure.add_subplot()
    axes.plot([0, 1], [0, 1], color=INK)
    axes.set_title("a title")
    return figure


def report(text: str, figure=None) -> Report:
    table = Table(text, (text, text), [(text, 1.5), (text, None), (text, True), (text, -0.000012345)])
    return Report(text, text, {text: text}, [Section(text, [text], [text], figure, [table])], text)


@given(text=words)
@settings(max_examples=60, deadline=None)
def test_what_strangers_write_stays_text(text):
    page = require_page(as_html(report(text)), figures=0)

    assert [tag for tag, _ in page.elements].count("img") == 0
    assert page.numbers() == {1.5, -0.000012345}
    if text.isascii() and text.isprintable() and "{" not in text:
        assert text in "".join(page.text)


@pytest.mark.parametrize("text", HOSTILE)
def test_titles_and_descriptions_of_drawings_stay_text(text):
    drawing = Drawing(text, text, lambda: drawn(text))
    title, description = list(require_svg(as_svg(drawing)))[:2]

    assert title.text == description.text
    if text.isprintable():
        assert title.text == text
    require_page(as_html(report("a page", drawing)))


def test_the_same_drawing_twice_on_a_page_has_its_own_ids_and_a_stored_one_is_an_image():
    one, other = (Drawing(name, "what is seen", lambda: drawn("x")) for name in ("one", "other"))
    stored = StoredFigure("kept", b'<svg xmlns="http://www.w3.org/2000/svg" onload="alert(1)"/>')
    sections = [Section("s", figure=each) for each in (one, other, stored)]
    page = require_page(as_html(Report("t", "l", {}, sections)), figures=2)

    assert [attributes["alt"] for tag, attributes in page.elements if tag == "img"] == ["kept"]


def test_a_drawing_is_the_same_each_time_and_takes_the_colours_of_its_page():
    drawing = Drawing("t", "d", lambda: drawn("x"))

    assert as_svg(drawing) == as_svg(drawing)
    assert as_png(drawing) == as_png(drawing)
    require_png(as_png(drawing), (3, 2))
    assert b"var(--ink)" in inside_page(drawing)
    assert INK.encode() not in inside_page(drawing)


def test_no_two_colours_are_one_and_text_can_be_read_on_its_ground_in_both_themes():
    for side in (0, 1):
        colours = {name: pair[side] for name, pair in THEMES.items()}
        assert len(set(colours.values())) == len(colours)
        for name in ("ink", "faint", "first", "second", "mark"):
            assert contrast(colours[name], colours["paper"]) >= 4.5, (side, name)
        for field in ("climbs", "stalls", "slides"):
            assert contrast(colours["ink"], colours[field]) >= 4.0, (side, field)


def test_outcomes_can_be_told_apart_in_grey():
    for one, other in combinations((luminance(each) for each in (CLIMBS, STALLS, SLIDES)), 2):
        assert one / other > 1.3
    assert luminance(PAPER) > luminance(CLIMBS)


def test_the_policy_lets_nothing_in():
    rules = dict(rule.strip().partition(" ")[::2] for rule in POLICY.split(";"))

    assert rules["default-src"] == "'none'"
    assert "script-src" not in rules
    assert rules["img-src"] == "data:"
