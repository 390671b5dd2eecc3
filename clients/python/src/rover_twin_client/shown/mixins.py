"""What every answer with arrays can do."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rover_twin_client.shown import pages, tables
from rover_twin_client.shown.facts import Facts, Table

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    import xarray as xr


class Plotted:
    """An answer that shows itself: one line as text, a small page in a notebook."""

    __slots__ = ()

    def _facts(self) -> Facts:
        raise NotImplementedError

    def __repr__(self) -> str:
        facts = self._facts()
        said = ", ".join(f"{name} {value}" for name, value in facts.rows)
        return f"<{type(self).__name__} {facts.title}: {said}>"

    def _repr_html_(self) -> str:
        return pages.page(self._facts())


class Shown(Plotted):
    """An answer that is a table too."""

    __slots__ = ()

    def _table(self) -> Table:
        raise NotImplementedError

    def to_pandas(self) -> pd.DataFrame:
        """The arrays as columns of a pandas DataFrame; units are in the names, model and scenario in `attrs`."""
        return tables.to_pandas(self._table())

    def to_polars(self) -> pl.DataFrame:
        """The arrays as columns of a polars DataFrame; units are in the names."""
        return tables.to_polars(self._table())

    def to_xarray(self) -> xr.Dataset:
        """The arrays as an xarray Dataset with coordinates; each variable has `units`, the whole model and scenario."""
        return tables.to_xarray(self._table())
