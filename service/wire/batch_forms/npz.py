"""A batch as a NumPy archive: `numpy.load(file)["x_m"]` has shape (scenario, time)."""

from __future__ import annotations

import numpy as np

from service.wire.batch_forms.subject import BatchWritable
from service.wire.forms.npz import METADATA, archive_of
from service.wire.forms.numbers import dump, require_finite


def encode_batch_npz(subject: BatchWritable) -> bytes:
    """An uncompressed archive: `time_s` of shape (time,) or (scenario, time), an array of shape (scenario, time) for
    each column, and those of shape (scenario,) of `BatchWritable.arrays`.

    Of a row only the first `points` are its own, the rest repeats the last one. `metadata` is a JSON object as text.
    The same batch gives the same bytes. Raises NonFiniteError.
    """
    arrays = {"time_s": subject.time_s(), **subject.columns(), **subject.arrays()}
    require_finite({name: each for name, each in arrays.items() if each.dtype == np.float64}, "answer")
    return archive_of({**arrays, METADATA: np.array(dump(subject.about() | subject.extras()).decode())})
