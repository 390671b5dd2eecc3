"""The one HTML page that pictures are shown in: figures, the numbers behind them, words. It asks for nothing else.

Light or dark as the reader's system is, white on paper. Everything that comes in is text and is escaped. A number in a
table stands there rounded; the `value` of its `data` element is the number of the JSON answer.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

from service import parts
from service.pictures.drawing import Drawing, clean, inside_page
from service.pictures.palette import THEMES

MEDIA_TYPE = "text/html"
POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'self'; sandbox"
)
"""The Content-Security-Policy of a page: nothing is loaded, nothing runs. Drawings style their elements inside it."""

_MINUS = "\N{MINUS SIGN}"

Cell = str | float | int | bool | None


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of cells under named columns; of a row the first cell is its head. `digits` are those that numbers show."""

    caption: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    digits: int = 4


@dataclass(frozen=True, slots=True)
class StoredFigure:
    """A picture that a version brings along, as SVG: it is shown as an image, so that nothing in it can run."""

    title: str
    svg: bytes


@dataclass(frozen=True, slots=True)
class Section:
    """A heading, sentences, a list of points, a figure, the table behind it (folded away where there is a figure)."""

    heading: str
    sentences: Sequence[str] = ()
    points: Sequence[str] = ()
    figure: Drawing | StoredFigure | None = None
    tables: Sequence[Table] = ()


@dataclass(frozen=True, slots=True)
class Report:
    """A page: what it is, the answer in a sentence or two, facts, sections. `warning` stands out."""

    title: str
    lead: str
    facts: Mapping[str, Cell]
    sections: Sequence[Section]
    warning: str = ""


def as_html(report: Report) -> bytes:
    """The page, UTF-8. Raises MissingPartError where Matplotlib is not installed."""
    parts.require(parts.PICTURES, "format=html")
    warning = f'<p class="warning" role="note">{_text(report.warning)}</p>' if report.warning else ""
    facts = "".join(
        f"<div><dt>{_text(name)}</dt><dd>{_cell(value, 6)}</dd></div>" for name, value in report.facts.items()
    )
    body = "\n".join(_section(number, each) for number, each in enumerate(report.sections))
    page = _PAGE.format(
        title=_text(report.title), lead=_text(report.lead), warning=warning, facts=facts, sections=body, style=_STYLE
    )
    return page.encode()


def _section(number: int, section: Section) -> str:
    sentences = "".join(f"<p>{_text(each)}</p>" for each in section.sentences)
    points = "".join(f"<li>{_text(each)}</li>" for each in section.points)
    tables = "\n".join(map(_table, section.tables))
    if section.figure is not None and tables:
        tables = f"<details><summary>The numbers as a table</summary>{tables}</details>"
    return (
        f'<section aria-labelledby="s{number}"><h2 id="s{number}">{_text(section.heading)}</h2>{sentences}'
        f"{'<ul>' + points + '</ul>' if points else ''}{_figure(section.figure)}{tables}</section>"
    )


def _figure(figure: Drawing | StoredFigure | None) -> str:
    if figure is None:
        return ""
    if isinstance(figure, StoredFigure):
        content, title = base64.b64encode(figure.svg).decode(), _text(figure.title)
        return f'<figure class="plate"><img alt="{title}" src="data:image/svg+xml;base64,{content}"></figure>'
    return f'<figure tabindex="0">{inside_page(figure).decode()}</figure>'


def _table(table: Table) -> str:
    heads = "".join(f'<th scope="col">{_text(each)}</th>' for each in table.columns)
    rows = "\n".join(
        f'<tr><th scope="row">{_cell(row[0], table.digits)}</th>'
        + "".join(f"<td{_kind(each)}>{_cell(each, table.digits)}</td>" for each in row[1:])
        + "</tr>"
        for row in table.rows
    )
    caption = _text(table.caption)
    return (
        f'<div class="wide" role="region" aria-label="{caption}" tabindex="0"><table><caption>{caption}</caption>'
        f"<thead><tr>{heads}</tr></thead><tbody>\n{rows}\n</tbody></table></div>"
    )


def _kind(value: Cell) -> str:
    return ' class="text"' if isinstance(value, str) else ""


def _cell(value: Cell, digits: int) -> str:
    if value is None:
        return '<span title="none">\N{EN DASH}</span>'
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        shown = f"{value:.{digits}g}" if isinstance(value, float) else str(value)
        if "e" in shown:
            shown = f"{value:.6f}".rstrip("0").rstrip(".") if abs(value) < 1 else f"{value:.0f}"
        return f'<data value="{value!r}">{shown.replace("-", _MINUS)}</data>'
    return _text(value)


def _text(text: str) -> str:
    return escape(clean(text))


def _colours(side: int) -> str:
    return "".join(f"--{name}:{pair[side]};" for name, pair in THEMES.items())


_STYLE = (
    f":root{{color-scheme:light dark;{_colours(0)}}}\n"
    f"@media screen and (prefers-color-scheme:dark){{:root{{{_colours(1)}}}}}\n"
    """*{box-sizing:border-box}
body{margin:0;background:var(--paper);color:var(--ink);
font:16px/1.5 system-ui,"Segoe UI",Roboto,"DejaVu Sans",sans-serif}
main{max-width:60rem;margin:0 auto;padding:1.5rem 1rem 3rem}
h1{font-size:1.6rem;line-height:1.25;margin:0 0 .4rem}
h2{font-size:1.15rem;margin:2.2rem 0 .4rem}
p,ul{max-width:44rem}
.lead{font-size:1.1rem;margin:.2rem 0 1rem}
.warning{border-left:4px solid var(--mark);padding:.5rem .8rem;background:var(--shade)}
dl{display:grid;grid-template-columns:repeat(auto-fit,minmax(11rem,1fr));gap:.7rem 1.2rem;margin:1rem 0;padding:0}
dt{color:var(--faint);font-size:.85rem}dd{margin:0;font-weight:600;overflow-wrap:anywhere}
figure{margin:.6rem 0}figure svg,figure img{width:100%;height:auto;display:block}
figure svg *{stroke-linejoin:round;stroke-linecap:butt}
.plate{background:#fff;padding:.4rem;border-radius:4px;max-width:50rem}
.wide{overflow-x:auto;max-width:100%}
table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.9rem;margin:.6rem 0}
caption{text-align:left;color:var(--faint);padding:.2rem 0}
th,td{padding:.2rem .8rem .2rem 0;text-align:right;border-bottom:1px solid var(--grid);vertical-align:top}
th:first-child,td.text{text-align:left}
tbody th{white-space:nowrap}td.text{overflow-wrap:anywhere}
thead th{border-bottom:1px solid var(--faint)}tbody th{font-weight:400}
summary{cursor:pointer;color:var(--second)}
:focus-visible{outline:2px solid var(--second);outline-offset:2px}
@media (max-width:40rem){figure{overflow-x:auto}figure svg{min-width:36rem}}
@media print{body{font-size:10.5pt}main{max-width:none;padding:0}
section,figure,tr{break-inside:avoid}h2{break-after:avoid}
details:not([open]){display:none}}"""
)
_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
<style>
{style}
</style>
</head>
<body>
<main>
<header><h1>{title}</h1><p class="lead">{lead}</p>{warning}</header>
<dl>{facts}</dl>
{sections}
</main>
</body>
</html>
"""
