"""Figures as bytes: SVG that explains itself, PNG, and SVG to stand inside a page. The same figure, the same bytes.

Drawn through Matplotlib's objects, without pyplot's global state. Strings are text, never formulas.
"""

from __future__ import annotations

import hashlib
import io
import re
import threading
from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

from service import parts
from service.pictures.palette import FAINT, GRID, INK, PAPER, THEMES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DPI = 110
_LOOK: Any = {
    "svg.hashsalt": "rover-twin",  # the ids inside an SVG are the same each time
    "svg.fonttype": "path",  # letters look the same everywhere
    "text.parse_math": False,  # a dollar sign in a name is a dollar sign
    "text.color": INK,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.facecolor": PAPER,
    "figure.facecolor": PAPER,
    "savefig.facecolor": PAPER,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "grid.color": GRID,
    "hatch.linewidth": 0.6,
}
# Matplotlib reads process-wide parameters while it draws, and its fonts are not made for several threads.
_drawing = threading.Lock()
_COMMENTS = re.compile(rb"<!--.*?-->\s*", re.DOTALL)
_METADATA = re.compile(rb"\s*<metadata>.*?</metadata>", re.DOTALL)
_ROOT = re.compile(rb"<svg [^>]*>", re.DOTALL)
_TOLD = re.compile(rb"<title>.*?</desc>\s*", re.DOTALL)
_OWN_IDS = re.compile(rb'(\bid="|href="#|url\(#)')
_OWN_STYLE = re.compile(rb"<defs>\s*<style.*?</style>\s*</defs>", re.DOTALL)


@dataclass(frozen=True, slots=True)
class Drawing:
    """A figure to be drawn, by `draw`, when its turn has come; its title, and what it shows for those who cannot see.

    `draw` is called with the look of all pictures in place.
    """

    title: str
    description: str
    draw: Callable[[], Figure]


def as_svg(picture: Drawing) -> bytes:
    """A document of its own, white, with title and description, without date.

    Raises MissingPartError where Matplotlib is not installed.
    """
    drawn = _COMMENTS.sub(b"", _METADATA.sub(b"", _saved(picture, "svg")))
    return _ROOT.sub(lambda root: _named(root.group(), picture), drawn, count=1)


def as_png(picture: Drawing) -> bytes:
    """The figure in pixels, 110 to the inch. Raises as `as_svg` does."""
    return _saved(picture, "png")


def inside_page(picture: Drawing) -> bytes:
    """The SVG as an element of an HTML page: its colours are the page's, its ids and its style are its own.

    Raises as `as_svg` does.
    """
    drawn = as_svg(picture)
    element = _OWN_STYLE.sub(b"", drawn[drawn.index(b"<svg ") :])
    own = f"f{hashlib.sha256(element).hexdigest()[:8]}-".encode()
    element = _OWN_IDS.sub(lambda found: found.group() + own, element)
    element = re.sub(rb'aria-labelledby="title desc"', b'aria-labelledby="%btitle %bdesc"' % (own, own), element)
    for name, (light, _) in THEMES.items():
        element = element.replace(light.encode(), f"var(--{name})".encode())
    return element


def _named(root: bytes, picture: Drawing) -> bytes:
    role = b' role="img" aria-labelledby="title desc">'
    title, description = (escape(clean(each), quote=False) for each in (picture.title, picture.description))
    told = f'\n <title id="title">{title}</title>\n <desc id="desc">{description}</desc>'
    return root[:-1] + role + told.encode()


def _saved(picture: Drawing, kind: str) -> bytes:
    parts.require(parts.PICTURES, f"format={kind}")
    import matplotlib as mpl  # noqa: PLC0415 - a second that only those pay who ask for a picture

    metadata = {"svg": {"Date": None, "Creator": None}, "png": {"Software": None}}[kind]
    buffer = io.BytesIO()
    with _drawing, mpl.rc_context(_LOOK):
        picture.draw().savefig(buffer, format=kind, dpi=_DPI, metadata=metadata)
    return buffer.getvalue()


def clean(text: str) -> str:
    """The text without what no XML document may hold: control characters and lone surrogates."""
    return "".join(each if each.isprintable() or each in "\n\t" else "\N{REPLACEMENT CHARACTER}" for each in text)


def dress(axes: Axes, title: str = "", x_label: str = "", y_label: str = "") -> None:
    """The look that all axes share; what is empty stays as it is."""
    if title:
        axes.set_title(title, fontsize=10, loc="left")
    if x_label:
        axes.set_xlabel(x_label)
    if y_label:
        axes.set_ylabel(y_label)
    axes.grid(True, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
