"""What `rover-twin models compare` judges and how it is laid out."""

from __future__ import annotations

from collections.abc import Iterator

from rich.console import RenderableType

from model_store import DEFAULT_ALIAS, AliasNotFoundError, Manifest, ModelStore
from service.cli.output import make_table
from service.cli.views.models import find_version
from service.training.gate import DEFAULT_MARGIN, Comparison, compare_versions


def compare_references(store: ModelStore, candidate: str, against: str | None, margin: float | None) -> Comparison:
    """The gate's verdict on two references; without a second one, beside the champion of the first one's model.

    Raises NotFoundError when a version is not there, and what `compare_versions` raises.
    """
    judged = find_version(store, candidate)
    beside = find_version(store, against) if against is not None else _champion(store, judged.name)
    return compare_versions(
        store,
        (judged.name, judged.version),
        (beside.name, beside.version) if beside else None,
        margin=DEFAULT_MARGIN if margin is None else margin,
    )


def describe_comparison(compared: Comparison) -> Iterator[RenderableType]:
    """The verdict, then the 90th percentiles that it looked at."""
    yield compared.sentence()
    if not compared.tails:
        return
    table = make_table("error in cm, 90th percentile", compared.candidate, str(compared.against), "ratio")
    for name, tail in compared.tails.items():
        table.add_row(
            name.removesuffix("_m"), f"{100 * tail.candidate_m:.2f}", f"{100 * tail.against_m:.2f}", f"{tail.ratio:.3f}"
        )
    yield ""
    yield table


def _champion(store: ModelStore, name: str) -> Manifest | None:
    try:
        resolved = store.resolve(f"{name}@{DEFAULT_ALIAS}")
    except AliasNotFoundError:
        return None
    return store.manifest(resolved.name, resolved.version)
