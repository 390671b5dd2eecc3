"""What to train: the one description that the CLI, the API and a manifest share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from service.learning.network.fit_config import FitConfig

PriorName = Literal["rigid_slope", "motor_slope"]
ArchitectureName = Literal["drive_model", "paper_network", "zero"]
FEWEST_RUNS: Mapping[ArchitectureName, int] = {"drive_model": 3, "paper_network": 1, "zero": 1}
"""Training runs that each architecture needs. One that predicts left-out runs needs three, for its band."""
TAKES_VARYING_RUNS: frozenset[ArchitectureName] = frozenset({"drive_model"})
"""Architectures that know what to do with runs whose slope, torque or brake change underway."""
InputName = Literal["time_s", "slope_deg", "mass_kg", "torque_nm", "torque_ratio"]
XForm = Literal["position", "mean_speed"]


class TrainingConfig(BaseModel):
    """A training run, complete: the same config, datasets and machine give the same weights."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    model: str = Field(description="Name of the model that gets a new version")
    datasets: Annotated[list[str], Field(min_length=1, max_length=64, description="Ids, unique id starts, or names")]
    prior: PriorName = Field("motor_slope", description="Closed-form part")
    architecture: ArchitectureName = Field("paper_network", description="Learned part")
    inputs: Annotated[list[InputName], Field(min_length=1, max_length=16)] = Field(
        ["time_s", "slope_deg", "mass_kg", "torque_nm", "torque_ratio"],
        description="What the learned part sees, time_s first; torque_ratio is torque/(mass g wheel radius)",
    )
    x_form: XForm = Field(
        "mean_speed",
        description="Whether the network's x output is the correction (as in the paper) or the correction per time",
    )
    test_slopes_deg: Annotated[list[float], Field(max_length=64)] = Field(
        default_factory=list, description="Every run at these slopes is kept for testing"
    )
    test_fraction: float = Field(0.0, ge=0, le=0.9, description="Share of the other runs kept for testing, at random")
    description: str = Field("", max_length=4000, description="A sentence for people, kept in the manifest")
    fit: FitConfig = Field(default_factory=FitConfig)
