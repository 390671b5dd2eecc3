"""How `format=usda` puts a rover on somebody's stage: the parameters of an address that belong to that form alone."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from typing import Annotated

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field
from pydantic.json_schema import SkipJsonSchema

from service.errors import InvalidValueError
from service.wire.commas import split_commas
from service.wire.forms.placement import PLAIN, Placement

_PATH = r"^(/[A-Za-z_][A-Za-z0-9_]{0,63}){1,8}$"
_FURTHEST_M = 1e7
_THREE = Field(min_length=3, max_length=3)
_POINT = "three numbers with commas between them: x,y,z"


class UpAxis(StrEnum):
    """Which axis of a stage points up."""

    Y = "Y"
    Z = "Z"


def _parts(value: object) -> object:
    """The command line gives one text."""
    return split_commas([value] if isinstance(value, str) else value)


def _point(sent: list[float] | None) -> tuple[float, float, float] | None:
    return None if sent is None else (sent[0], sent[1], sent[2])


class StageInputs(BaseModel):
    """Where on which stage the rover of a USD layer is."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    prim_path: Annotated[
        Annotated[str, Field(pattern=_PATH)] | SkipJsonSchema[None],
        Field(
            description="USD: the rover's prim on your stage, such as `/World/Rover`. It is moved (`over`), not "
            "defined, unless `proxy` is true. Without it the layer defines `/Rover`.",
            examples=["/World/Rover"],
            json_schema_extra={
                "x-allowed": "a path such as /World/Rover: 1 to 8 names of letters a-z, digits and _, "
                "none with a digit first, each of at most 64 characters"
            },
        ),
    ] = None
    origin_m: Annotated[
        Annotated[list[Annotated[float, Field(ge=-_FURTHEST_M, le=_FURTHEST_M)]], _THREE] | SkipJsonSchema[None],
        BeforeValidator(_parts),
        Field(
            description="USD: where the zero of the positions is, along the axes of the stage, in metres: x,y,z. "
            "Without it, the zero of the stage.",
            examples=[[12, 3, 0.5]],
            json_schema_extra={"x-allowed": f"{_POINT}, each -{_FURTHEST_M:.0f} to {_FURTHEST_M:.0f}"},
        ),
    ] = None
    heading_deg: Annotated[
        float,
        Field(
            ge=-360,
            le=360,
            description="USD: where the rover looks at the start, in degrees from X, counterclockwise from above.",
            examples=[90],
        ),
    ] = 0.0
    pivot: Annotated[
        Annotated[list[Annotated[float, Field(ge=-1e6, le=1e6)]], _THREE] | SkipJsonSchema[None],
        BeforeValidator(_parts),
        Field(
            description="USD: the middle between the rear wheels' centres, which the positions are of, in the asset's "
            "own coordinates: x,y,z. Without it, the asset's zero.",
            examples=[[-0.64, 0, 0.25]],
            json_schema_extra={"x-allowed": f"{_POINT}, each -1000000 to 1000000"},
        ),
    ] = None
    scale: Annotated[
        Annotated[float, Field(ge=1e-6, le=1e6)] | SkipJsonSchema[None],
        Field(description="USD: `xformOp:scale` of the rover. Without it, a rover that is moved keeps its own."),
    ] = None
    up_axis: Annotated[
        UpAxis, Field(description="USD: axis of your stage that points up. USD converts no axes when it adds a layer.")
    ] = UpAxis.Z
    meters_per_unit: Annotated[
        float,
        Field(
            ge=1e-6,
            le=1e6,
            description="USD: `metersPerUnit` of your stage, 0.01 for centimetres. USD converts no units when it adds "
            "a layer.",
            examples=[0.01],
        ),
    ] = 1.0
    proxy: Annotated[
        bool, Field(description="USD: define a rover of VIPER's size made of simple shapes, for a stage without one.")
    ] = False

    def require_usd(self, form: str) -> None:
        """Raises InvalidValueError where one of these was given and the answer is another form.

        Their defaults ask for nothing; generated clients send them with every question.
        """
        if _NAMES.isdisjoint(self.__pydantic_fields_set__):  # `model_fields_set` only asks for it
            return
        fields, asked = type(self).model_fields, _NAMES & self.model_fields_set
        changed = sorted(name for name in asked if getattr(self, name) != fields[name].default)
        if form != "usda" and changed:
            name = changed[0]
            value = getattr(self, name)
            said = str(value) if isinstance(value, UpAxis) else value
            raise InvalidValueError(name, said, f"nothing beside format={form}: it belongs to format=usda")

    def placement(self) -> Placement:
        """The same for the writer of layers."""
        if _NAMES.isdisjoint(self.__pydantic_fields_set__):
            return PLAIN
        return Placement(
            prim_path=self.prim_path or "",
            origin_m=_point(self.origin_m) or PLAIN.origin_m,
            heading_deg=self.heading_deg,
            pivot=_point(self.pivot),
            scale=self.scale,
            up_axis=self.up_axis.value,
            meters_per_unit=self.meters_per_unit,
            proxy=self.proxy,
        )


class FleetInputs(StageInputs):
    """The same for many rovers in one layer."""

    spacing_m: Annotated[
        float,
        Field(
            ge=0,
            le=1000,
            description="USD: how far to its right each rover starts from the one before, in metres.",
            examples=[3],
        ),
    ] = 0.0

    def placement(self) -> Placement:
        """The same for the writer of layers."""
        return replace(super().placement(), spacing_m=self.spacing_m) if self.spacing_m else super().placement()


_NAMES = frozenset(FleetInputs.model_fields)
