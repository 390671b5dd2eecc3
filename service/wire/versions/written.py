"""Cards and comparisons in their forms: JSON, a picture, a page."""

from __future__ import annotations

from service.pictures.drawing import Drawing, as_png, as_svg
from service.wire.forms import PictureFormat
from service.wire.forms.numbers import dump
from service.wire.versions.card import Card
from service.wire.versions.card_picture import card_as_html, drawing_of_card
from service.wire.versions.comparison import ComparisonAnswer
from service.wire.versions.comparison_picture import comparison_as_html, drawing_of_comparison


def written_card(card: Card, form: PictureFormat) -> bytes:
    """The card. Raises MissingPartError for a picture where Matplotlib is not installed, NonFiniteError."""
    content = dump(card.answer.model_dump(mode="json"))
    if form is PictureFormat.JSON:
        return content
    return card_as_html(card) if form is PictureFormat.HTML else _picture(drawing_of_card(card), form)


def written_comparison(answer: ComparisonAnswer, form: PictureFormat) -> bytes:
    """The comparison. Raises as `written_card` does."""
    content = dump(answer.model_dump(mode="json"))
    if form is PictureFormat.JSON:
        return content
    return comparison_as_html(answer) if form is PictureFormat.HTML else _picture(drawing_of_comparison(answer), form)


def _picture(drawing: Drawing, form: PictureFormat) -> bytes:
    return (as_svg if form is PictureFormat.SVG else as_png)(drawing)
