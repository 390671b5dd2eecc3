"""What comes with an upload beside its bytes, and how large an upload may be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, StringConstraints

from service.datasets.alignment import ALLOWED, Alignment
from service.datasets.readers.column_map import PRESETS
from service.datasets.run_table import SCENARIO_LIMITS

_SLOPE, _MASS, _TORQUE, _HORIZON = (
    Field(default=None, ge=SCENARIO_LIMITS[name][0], le=SCENARIO_LIMITS[name][1], description=text)
    for name, text in (
        ("slope_deg", "Slope in degrees, positive uphill, of the one run or of all rows that name none."),
        ("mass_kg", "Mass of the whole rover, kg."),
        ("torque_nm", "Motor stall torque of each wheel, N m; 0: motors off, wheels free."),
        ("horizon_s", "How long the run was meant to last, s; without it, its last time."),
    )
)

_START = r"^(first-row|-?(\d{1,11}(\.\d*)?|\.\d+)([eE][+-]?\d{1,2})?)$"


def _as_text(value: object) -> object:
    return f"{value!r}" if isinstance(value, int | float) and not isinstance(value, bool) else value


class UploadForm(BaseModel):
    """The form fields of an upload; all optional. The scenario fields stand for what the files do not say."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    name: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,62}$")] | None = Field(
        default=None,
        description="Name for people: A-Z a-z 0-9 . _ -, at most 63; without it, from the file's name.",
        json_schema_extra={"x-allowed": "1 to 63 of A-Z a-z 0-9 . _ -, starting with a letter or digit"},
    )
    description: Annotated[str, StringConstraints(max_length=4000)] = Field(
        default="", description="A sentence for people, kept with the dataset."
    )
    column_map: (
        Annotated[str, StringConstraints(max_length=64)]
        | Annotated[dict[str, bool | int | str], Field(max_length=64)]
        | None
    ) = Field(
        default=None,
        description="Which column is which: a preset, or canonical name -> header or 0-based index.",
        json_schema_extra={
            "x-allowed": f"one of {', '.join(PRESETS)}, or a JSON object of column name to header or 0-based index"
        },
    )
    slope_deg: float | None = _SLOPE
    mass_kg: float | None = _MASS
    torque_nm: float | None = _TORQUE
    horizon_s: float | None = _HORIZON
    set_name: Annotated[str, StringConstraints(min_length=1, max_length=200)] = Field(
        default="default", description="Set of the runs that name none."
    )
    frame: Literal["slope", "slope-downhill", "world", "world-downhill"] | None = Field(
        default=None,
        description="Frame of the positions: slope (x along the slope, y normal to it), world (x horizontal, height "
        "vertical), slope-downhill or world-downhill (x grows downhill).",
        json_schema_extra={"x-allowed": ALLOWED["frame"]},
    )
    reference: Literal["rear-wheel", "front-wheel", "chassis"] | None = Field(
        default=None,
        description="Point of the rover whose positions rear_x_m and rear_y_m hold.",
        json_schema_extra={"x-allowed": ALLOWED["reference"]},
    )
    start: Annotated[str, StringConstraints(pattern=_START), BeforeValidator(_as_text)] | None = Field(
        default=None,
        description="When the motors were switched on: first-row, or a time stamp of the files, s. Rows before are "
        "left out; time and x are counted from there.",
        json_schema_extra={"x-allowed": ALLOWED["start"]},
    )
    passport: dict[str, Any] | None = Field(
        default=None, description="What was simulated, as passport.json; wins over one in the upload."
    )
    strict: bool = Field(default=False, description="Refuse everything when any run is unusable.")

    def said(self) -> Alignment:
        """How the runs were recorded, as far as the form says it."""
        return Alignment.said(frame=self.frame, reference=self.reference, start=self.start)

    def scenario(self) -> dict[str, float]:
        """The scenario values that the form has, by name."""
        given = {name: getattr(self, name) for name in SCENARIO_LIMITS}
        return {name: float(value) for name, value in given.items() if value is not None}


@dataclass(frozen=True, slots=True)
class UploadLimits:
    """How much one upload may expand to. A gigabyte of text is some eight million rows of ten columns.

    `ratio` is expanded to packed bytes, counted once `ratio_from_bytes` have come out: text of runs packs 3 to 15
    times, a rover that stands still 60 times; a bomb packs a thousand times.
    """

    members: int = 11_000
    total_bytes: int = 4 << 30
    file_bytes: int = 1 << 30
    ratio: float = 200.0
    ratio_from_bytes: int = 16 << 20
    path_length: int = 512
    depth: int = 16
    rows: int = 10_000_000
