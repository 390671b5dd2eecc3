"""A prediction as a NumPy archive: `numpy.load(file)["x_m"]`."""

from __future__ import annotations

import io

import numpy as np

from service.api.encoders.numbers import dump, require_finite
from service.api.encoders.subject import Subject

METADATA = "metadata"


def encode_npz(subject: Subject) -> bytes:
    """An uncompressed archive with a float64 array of shape (time,) for each column, under the column's name.

    `metadata` is a text array without axes: a JSON object with all that is no column, `Subject.about`. The same
    prediction gives the same bytes: NumPy dates the archive's members 1980. Raises NonFiniteError.
    """
    columns = subject.columns()
    require_finite(columns, "answer")
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **columns, **{METADATA: np.array(dump(subject.about()).decode())})
    return file.getvalue()
