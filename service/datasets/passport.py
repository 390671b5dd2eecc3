"""The passport of a dataset: what was simulated (gravity, soil, rover, drive, frame). Unknown fields are kept."""

from __future__ import annotations

import codecs
import json
from typing import Any, NoReturn

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from service.datasets.alignment import NOTHING_SAID, Alignment, Frame, Reference
from service.datasets.canonical import canonical_json
from service.errors import DatasetError

PASSPORT_FILE = "passport.json"
FORMAT = "rover-twin-passport"
MAJOR = 1
MAX_BYTES = 1024 * 1024
SLOPE_FRAME = "slope frame: x along the slope, positive uphill; y normal to it, zero at the undeformed surface"
REAR_WHEEL = "centre of the rear left wheel"


class _Open(BaseModel):
    """Immutable, finite numbers only, keeps what it does not know."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)


class Soil(_Open):
    """Bekker, Mohr-Coulomb and Janosi parameters of the soil contact model."""

    name: str = ""
    bekker_kphi: float | None = None
    bekker_kc: float | None = None
    bekker_n: float | None = None
    mohr_cohesion_pa: float | None = Field(default=None, ge=0)
    mohr_friction_deg: float | None = Field(default=None, ge=0, lt=90)
    janosi_shear_m: float | None = Field(default=None, gt=0)


class Rover(_Open):
    """Dimensions and stock mass of the rover."""

    wheel_radius_m: float = Field(gt=0, le=10)
    wheelbase_m: float | None = Field(default=None, gt=0, le=100)
    track_m: float | None = Field(default=None, gt=0, le=100)
    wheels: int | None = Field(default=None, ge=1, le=64)
    centre_of_mass_ahead_of_rear_axle_m: float | None = None
    centre_of_mass_above_surface_m: float | None = None
    stock_mass_kg: float | None = Field(default=None, gt=0)


class Drive(_Open):
    """The motor law in words and its no-load speed."""

    law: str = ""
    no_load_speed_rad_s: float | None = Field(default=None, gt=0, le=1000)


class Passport(_Open):
    """What one dataset's simulations have in common. Gravity, wheel radius, frame and body are required:
    without them positions cannot be interpreted.
    """

    format: str
    title: str = ""
    gravity_m_s2: float = Field(gt=0, le=100)
    frame: str = Field(min_length=1)
    reference_body: str = Field(min_length=1)
    rover: Rover
    soil: Soil | None = None
    drive: Drive | None = None
    columns: tuple[str, ...] | None = Field(default=None, max_length=256)
    column_map: str | dict[str, str | int] | None = None
    alignment: Alignment | None = None

    @field_validator("format")
    @classmethod
    def _known_major(cls, value: str) -> str:
        name, _, version = value.partition("/")
        major = version.partition(".")[0]
        if name != FORMAT or not major.isdecimal():
            raise ValueError(f"is {value!r}, expected '{FORMAT}/{MAJOR}'")
        if int(major) != MAJOR:
            raise ValueError(f"is major {major}, this version reads major {MAJOR}; update the service")
        return value

    def of_aligned(self, said: Alignment) -> Passport:
        """The passport of the runs once they are brought from what is `said` to slope frame, rear wheel and start."""
        fields: dict[str, Any] = {}
        if said.frame not in (None, Frame.SLOPE) and "slope" not in self.frame.lower():
            fields["frame"] = SLOPE_FRAME
        if said.reference not in (None, Reference.REAR_WHEEL) and "rear" not in self.reference_body.lower():
            fields["reference_body"] = REAR_WHEEL
        kept = self.model_dump(exclude_unset=True, exclude={"alignment"}) if self.alignment is not None else None
        passport = self if kept is None else Passport.model_validate(kept)
        return passport.model_copy(update=fields) if fields else passport

    @property
    def said(self) -> Alignment:
        """How it says that runs were recorded."""
        return self.alignment or NOTHING_SAID

    def canonical_json(self) -> str:
        """The same text for the same content, whatever the order and spacing of the file it came from."""
        return canonical_json(self.model_dump(mode="json", exclude_unset=True))


def parse_passport(data: bytes, *, file: str = PASSPORT_FILE) -> Passport:
    """Read a passport. Raises DatasetError naming the field, its value and what is expected."""
    if len(data) > MAX_BYTES:
        raise DatasetError(f"{file} has {len(data)} bytes, allowed are at most {MAX_BYTES}")
    try:
        content: Any = json.loads(passport_text(data), parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise DatasetError(f"{file} is not JSON: {error}") from error
    try:
        passport = Passport.model_validate(content)
        passport.canonical_json()
    except ValidationError as error:
        raise DatasetError(f"{file}: {_reasons(error)}") from error
    except (ValueError, RecursionError) as error:
        raise DatasetError(f"{file} cannot be kept as JSON: {error}") from error
    return passport


def passport_text(data: bytes) -> str:
    """UTF-8, or UTF-16 with its byte-order mark as PowerShell writes it. Raises ValueError for anything else."""
    try:
        return data.decode("utf-16" if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) else "utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(
            f"it is not text in UTF-8, nor in UTF-16 with a byte-order mark; save it as UTF-8 ({error.reason})"
        ) from error


def _refuse_constant(text: str) -> NoReturn:
    raise ValueError(f"{text} is not allowed, every number must be finite")


def _reasons(error: ValidationError) -> str:
    shown = [
        f"{'.'.join(map(str, each['loc'])) or 'passport'}: {each['msg']}"
        + ("" if each["type"] == "missing" else f" (got {str(each['input'])[:60]!r})")
        for each in error.errors(include_url=False)[:5]
    ]
    return "; ".join(shown)
