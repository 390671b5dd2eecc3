"""Answers as tables of pandas and polars and as datasets of xarray."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from rover_twin_client.shown.facts import Table, Variable, unit_of

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    import xarray as xr

_EXTRAS = {"pandas": "data", "polars": "data", "xarray": "data", "matplotlib": "plot"}


def needed(module: str, word: str) -> Any:  # noqa: ANN401 - whatever it is, it need not be installed
    """The module; raises ImportError with the command that installs it."""
    try:
        return importlib.import_module(module)
    except ImportError as missing:
        library = module.partition(".")[0]
        raise ImportError(
            f"{word}() needs {library}, which is not installed: pip install {library}, "
            f"or all that this client can use: pip install 'rover-twin-client[{_EXTRAS[library]}]'"
        ) from missing


def to_pandas(table: Table) -> pd.DataFrame:
    """One row for each time; `about` is in `attrs`."""
    frame: pd.DataFrame = needed("pandas", "to_pandas").DataFrame(dict(table.columns))
    frame.attrs.update(table.about)
    return frame


def to_polars(table: Table) -> pl.DataFrame:
    """The same for polars, which has no place for `about`."""
    frame: pl.DataFrame = needed("polars", "to_polars").DataFrame(dict(table.columns))
    return frame


def to_xarray(table: Table) -> xr.Dataset:
    """Variables over named axes, each with its `units`; `about` is in `attrs`."""
    dataset: xr.Dataset = needed("xarray", "to_xarray").Dataset(
        {name: _with_unit(name, each) for name, each in table.variables.items()},
        coords={name: _with_unit(name, each) for name, each in table.coordinates.items()},
        attrs=dict(table.about),
    )
    return dataset


def _with_unit(name: str, variable: Variable) -> tuple[Any, ...]:
    unit = unit_of(name)
    return variable if unit is None else (*variable, {"units": unit})
