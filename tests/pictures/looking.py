"""Pictures and pages taken apart as a reader, a screen reader or a browser would."""

from __future__ import annotations

import io
import math
import re
import xml.etree.ElementTree as ET
from html.parser import HTMLParser

import numpy as np
from matplotlib.image import imread

SVG = "{http://www.w3.org/2000/svg}"
_LOADS = {"src", "href", "xlink:href", "action", "data", "srcset", "poster", "background"}
_VOID = {"meta", "img", "br", "link", "input", "hr"}


class Page(HTMLParser):
    """Elements, attributes, text and `data` values of a page; raises AssertionError where tags do not match."""

    def __init__(self, body: bytes) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.text: list[str] = []
        self.values: list[str] = []
        self.feed(body.decode())
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag == "data":
            self.values.append(dict(attrs)["value"])
        if tag not in _VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)

    def numbers(self) -> set[float]:
        """Every number of a table or fact, exactly."""
        return {float(each) for each in self.values}


def require_page(body: bytes, *, figures: int = 1) -> Page:
    """A page that parses, asks for nothing, runs nothing, and whose figures say what they are."""
    page = Page(body)
    tags = [tag for tag, _ in page.elements]
    assert not {"script", "iframe", "object", "embed", "link", "base", "form"} & set(tags)
    for tag, attributes in page.elements:
        assert not [name for name in attributes if name.startswith("on")], tag
        for name in _LOADS & attributes.keys():
            assert re.match(r"#|data:image/(svg\+xml|png);base64,", attributes[name]), (tag, attributes[name][:80])
    outside = re.findall(r"(?:url\(|@import)[^;)]*", body.decode())
    assert all(each.startswith("url(#") for each in outside), outside
    assert tags.count("h1") == tags.count("main") == 1
    identities = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(identities) == len(set(identities))
    drawn = [attributes for tag, attributes in page.elements if tag == "svg"]
    assert len(drawn) == figures
    for attributes in drawn:
        assert attributes["role"] == "img"
        assert set(attributes["aria-labelledby"].split()) <= set(identities)
    assert all(attributes.get("alt") for tag, attributes in page.elements if tag == "img")
    assert all(math.isfinite(each) for each in page.numbers())
    return page


def require_svg(body: bytes) -> ET.Element:
    """A well-formed document with title and description, that asks for nothing and is dated nowhere."""
    root = ET.fromstring(body)
    assert root.tag == f"{SVG}svg"
    names = [child.tag for child in root][:2]
    assert names == [f"{SVG}title", f"{SVG}desc"]
    assert all(child.text and child.text.strip() for child in list(root)[:2])
    assert root.get("role") == "img"
    for element in root.iter():
        assert element.tag != f"{SVG}script"
        for name, value in element.attrib.items():
            if name.endswith("href"):
                assert value.startswith(("#", "data:image/png;base64,")), value[:80]
    assert b"dc:date" not in body
    require_no_nan(" ".join(" ".join(element.attrib.values()) for element in root.iter()))
    return root


def require_png(body: bytes, inches: tuple[float, float], dpi: int = 110) -> None:
    """Pixels of the size that the figure has."""
    assert body.startswith(b"\x89PNG")
    height, width = imread(io.BytesIO(body)).shape[:2]
    assert (width, height) == tuple(int(round(each * dpi, 6)) for each in inches)


def require_no_nan(text: str) -> None:
    assert not re.search(r"\b(nan|inf|infinity)\b", text, re.IGNORECASE), text[:200]


def leaves(document: object) -> set[float]:
    """Every number somewhere in a JSON document."""
    if isinstance(document, bool) or document is None:
        return set()
    if isinstance(document, int | float):
        return {float(document)}
    if isinstance(document, dict):
        return set().union(*map(leaves, document.values())) if document else set()
    if isinstance(document, list):
        return set().union(*map(leaves, document)) if document else set()
    return set()


def luminance(colour: str) -> float:
    """Of a colour as #rrggbb, 0 to 1, as the contrast of WCAG takes it."""
    parts = np.array([int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)])
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(one: str, other: str) -> float:
    """1 to 21."""
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)
