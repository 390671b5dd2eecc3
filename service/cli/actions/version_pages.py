"""What `rover-twin models card` and `compare --format` do: the API's own answers about versions in a store."""

from __future__ import annotations

from model_store import DEFAULT_ALIAS, Manifest, ModelStore, NotFoundError, VersionRetiredError
from service.cli.threads import use_threads
from service.cli.views.models import find_version
from service.errors import CheckpointError, InvalidValueError, MissingPartError
from service.training.gate import MAX_MARGIN
from service.twin.load import load_twin
from service.wire.forms import PictureFormat
from service.wire.versions.card import card_of
from service.wire.versions.comparison import ComparisonInputs, Two, compared
from service.wire.versions.written import written_card, written_comparison


def card(store: ModelStore, reference: str, form: str) -> bytes:
    """The card of a version in a `PictureFormat`. Raises what the store raises."""
    found = card_of(store, find_version(store, reference), with_figures=form == PictureFormat.HTML.value)
    return written_card(found, PictureFormat(form))


def comparison(store: ModelStore, candidate: str, against: str | None, margin: float | None, form: str) -> bytes:
    """Two versions side by side in a `PictureFormat`; without a second one, beside the champion of the first.

    Raises InvalidValueError for a margin that cannot be, and what the store raises.
    """
    if margin is not None and not 0 <= margin <= MAX_MARGIN:
        raise InvalidValueError("margin", margin, f"0 to {MAX_MARGIN:g}")
    ours = find_version(store, candidate)
    theirs = find_version(store, against if against is not None else f"{ours.name}@{DEFAULT_ALIAS}")
    asked = ComparisonInputs.model_validate({} if margin is None else {"margin": margin})
    return written_comparison(compared(store, _with_twins(store, ours, theirs), asked), PictureFormat(form))


def _with_twins(store: ModelStore, ours: Manifest, theirs: Manifest) -> Two:
    use_threads()
    try:
        twins = load_twin(store, ours.name, ours.version), load_twin(store, theirs.name, theirs.version)
    except (MissingPartError, CheckpointError, VersionRetiredError, NotFoundError) as error:
        return Two(ours, theirs, None, str(error))
    return Two(ours, theirs, twins)
