"""A batch as a NumPy archive: `numpy.load(file)["x_m"]` has shape (scenario, time)."""

from __future__ import annotations

from typing import Any

import numpy as np

from service.wire.batch_forms.subject import BatchSubject
from service.wire.forms.npz import METADATA, archive_of
from service.wire.forms.numbers import dump, require_finite


def encode_batch_npz(subject: BatchSubject) -> bytes:
    """An uncompressed archive: `time_s` of shape (time,) or (scenario, time), a float64 array of shape (scenario, time)
    for each column, and one of shape (scenario,) for each column of `BatchSubject.tables`.

    Of a row only the first `points` are its own, the rest repeats the last one. `outside_of` has names with commas
    between them; `slip_ratio` is that of scenarios where `slip_ratio_known`. `metadata` is a JSON object as text. The
    same batch gives the same bytes. Raises NonFiniteError.
    """
    tables = subject.tables()
    by_scenario: dict[str, Any] = {**tables["scenarios"], **tables["domain"], **tables["summary"]}
    slips = by_scenario["slip_ratio"]
    by_scenario["slip_ratio"] = np.array([0.0 if slip is None else slip for slip in slips], dtype=np.float64)
    by_scenario["slip_ratio_known"] = np.array([slip is not None for slip in slips], dtype=np.bool_)
    by_scenario["outside_of"] = np.array([",".join(names) for names in by_scenario["outside_of"]], dtype=np.str_)
    by_scenario["outcome"] = np.array([str(outcome) for outcome in by_scenario["outcome"]], dtype=np.str_)
    arrays = {"time_s": subject.time_s(), **subject.columns()}
    arrays |= {name: np.asarray(column) for name, column in by_scenario.items()}
    require_finite({name: each for name, each in arrays.items() if each.dtype == np.float64}, "answer")
    return archive_of({**arrays, METADATA: np.array(dump(subject.about()).decode())})
