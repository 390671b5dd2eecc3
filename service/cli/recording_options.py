"""Options that say how runs were recorded: in which frame, of which point, from which moment on."""

from __future__ import annotations

from typing import Annotated

import typer

FrameWord = Annotated[
    str | None,
    typer.Option(
        "--frame",
        metavar="FRAME",
        help="Frame of the positions: slope (x along the slope, y normal to it: as if not given), world (x horizontal, "
        "height vertical), slope-downhill or world-downhill (x grows downhill).",
    ),
]
ReferenceWord = Annotated[
    str | None,
    typer.Option(
        "--reference",
        metavar="POINT",
        help="Point whose positions rear_x_m and rear_y_m hold: rear-wheel (as if not given), front-wheel, or chassis "
        "(Chrono's point between the axles).",
    ),
]
StartWord = Annotated[
    str | None,
    typer.Option(
        "--start",
        metavar="SECONDS|first-row",
        help="When the motors were switched on: a time stamp of the files, or first-row. Rows before are left out; "
        "time and x are counted from there.",
    ),
]
