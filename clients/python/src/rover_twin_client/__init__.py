"""Asks a rover digital twin where the rover goes.

from rover_twin_client import RoverTwin

with RoverTwin("http://127.0.0.1:8000") as twin:
prediction = twin.predict(slope_deg=28, mass_kg=430, torque_nm=60)
print(prediction.summary.outcome, prediction.x_m[-1])
"""

from __future__ import annotations

from rover_twin_client.answers import (
    Band,
    Domain,
    DomainReason,
    Frame,
    ModelIdentity,
    ModelInfo,
    NearestRun,
    Prediction,
    Prior,
    Readiness,
    Scenario,
    Summary,
)
from rover_twin_client.async_client import AsyncRoverTwin
from rover_twin_client.client import RoverTwin
from rover_twin_client.errors import (
    ConnectionFailedError,
    FieldFault,
    InvalidInputError,
    NotFoundError,
    NotReadyError,
    OutsideDomainError,
    Problem,
    RefusedError,
    RoverTwinError,
    ServerError,
    TimedOutError,
    UnexpectedAnswerError,
)

__all__ = [
    "AsyncRoverTwin",
    "Band",
    "ConnectionFailedError",
    "Domain",
    "DomainReason",
    "FieldFault",
    "Frame",
    "InvalidInputError",
    "ModelIdentity",
    "ModelInfo",
    "NearestRun",
    "NotFoundError",
    "NotReadyError",
    "OutsideDomainError",
    "Prediction",
    "Prior",
    "Problem",
    "Readiness",
    "RefusedError",
    "RoverTwin",
    "RoverTwinError",
    "Scenario",
    "ServerError",
    "Summary",
    "TimedOutError",
    "UnexpectedAnswerError",
]
