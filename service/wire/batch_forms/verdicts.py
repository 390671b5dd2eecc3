"""The verdicts on many scenarios as one document, for lines: `service.wire.forms.subject.domain_document` of each."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from service.learning.domain import DomainVerdicts
from service.learning.neighbourhood import Neighbourhood
from service.physics.scenario import Array
from service.wire.forms.numbers import dump_finite
from service.wire.forms.subject import reasons_document
from service.wire.lines import Cells


def verdict_cells(verdicts: DomainVerdicts) -> dict[str, Any]:
    """A verdict whose values are those of each line."""
    inside = verdicts.inside.tolist()
    reasons = [b"[]" if fits else _reasons(verdicts, row) for row, fits in enumerate(inside)]
    document = {"inside": Cells.listed(dump_finite(inside)), "reasons": Cells.of(reasons)}
    known = verdicts.domain.neighbourhood
    if verdicts.nearest is None or known is None:
        return {**document, "distance": None, "nearest_runs": ()}
    order, distances = verdicts.nearest
    runs = _nearest(known, order, distances)
    return {**document, "distance": _numbers(distances[:, 0]), "nearest_runs": runs}


def _reasons(verdicts: DomainVerdicts, row: int) -> bytes:
    return dump_finite(reasons_document(verdicts[row].reasons))


def _nearest(known: Neighbourhood, order: npt.NDArray[np.intp], distances: Array) -> list[Cells]:
    """The nearest runs of each line, then the second ones."""
    begun = {at: dump_finite(known.runs[at])[:-1] + b',"distance":' for at in set(order.ravel().tolist())}
    texts = (dump_finite(np.ascontiguousarray(each))[1:-1].split(b",") for each in distances.T)
    return [
        Cells.of([begun[at] + text + b"}" for at, text in zip(runs, texts_of_rank, strict=True)])
        for runs, texts_of_rank in zip(order.T.tolist(), texts, strict=True)
    ]


def _numbers(values: Array) -> Cells:
    return Cells.listed(dump_finite(np.ascontiguousarray(values)))
