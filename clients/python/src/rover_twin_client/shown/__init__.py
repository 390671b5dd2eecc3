"""How answers show themselves: one line, tables of other libraries, figures, and HTML in notebooks.

pandas, polars, xarray and matplotlib are imported when they are asked for, and need not be installed.
"""

from rover_twin_client.shown.facts import Facts, Line, Table
from rover_twin_client.shown.mixins import Plotted, Shown

__all__ = ["Facts", "Line", "Plotted", "Shown", "Table"]
