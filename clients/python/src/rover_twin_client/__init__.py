"""Predicts where a rover goes, by asking the rover-twin service.

    from rover_twin_client import RoverTwin

    with RoverTwin("http://127.0.0.1:8000") as twin:
        prediction = twin.predict(slope_deg=28, mass_kg=430, torque_nm=60)
        print(prediction.summary.outcome, prediction.x_m[-1])

`AsyncRoverTwin` has the same calls, to be awaited. `rover_twin_client.errors` shows the tree of errors.
"""

from __future__ import annotations

from rover_twin_client._async.client import AsyncRoverTwin
from rover_twin_client._async.live import AsyncLive
from rover_twin_client._sync.client import RoverTwin
from rover_twin_client._sync.live import Live
from rover_twin_client.answers import (
    Band,
    Domain,
    DomainReason,
    Frame,
    MobilityMap,
    ModelIdentity,
    ModelInfo,
    NearestRun,
    Prediction,
    Prior,
    Readiness,
    Scenario,
    SuggestedRun,
    SuggestedRuns,
    SuggestionReason,
    Summary,
)
from rover_twin_client.batch.answers import Batch, FailedPrediction
from rover_twin_client.drives import (
    Drive,
    DriveDomain,
    DriveEvent,
    DriveSummary,
    FailedDrive,
    Moment,
    Stretch,
)
from rover_twin_client.errors import (
    ConflictError,
    ConnectionFailedError,
    DatasetRejectedError,
    FieldFault,
    InvalidInputError,
    NotAllowedError,
    NotFoundError,
    NotReadyError,
    OutsideDomainError,
    Problem,
    QueueFullError,
    RefusedError,
    RoverTwinError,
    ServerError,
    TimedOutError,
    TrainingFailedError,
    UnexpectedAnswerError,
)
from rover_twin_client.stepping import RoverStep
from rover_twin_client.training import (
    Alias,
    Dataset,
    DatasetInfo,
    Finding,
    JobEvent,
    JobFailure,
    JobProgress,
    JobResult,
    TrainingJob,
    Upload,
    UploadReport,
    VersionState,
)

__all__ = [
    "Alias",
    "AsyncLive",
    "AsyncRoverTwin",
    "Band",
    "Batch",
    "ConflictError",
    "ConnectionFailedError",
    "Dataset",
    "DatasetInfo",
    "DatasetRejectedError",
    "Domain",
    "DomainReason",
    "Drive",
    "DriveDomain",
    "DriveEvent",
    "DriveSummary",
    "FailedDrive",
    "FailedPrediction",
    "FieldFault",
    "Finding",
    "Frame",
    "InvalidInputError",
    "JobEvent",
    "JobFailure",
    "JobProgress",
    "JobResult",
    "Live",
    "MobilityMap",
    "ModelIdentity",
    "ModelInfo",
    "Moment",
    "NearestRun",
    "NotAllowedError",
    "NotFoundError",
    "NotReadyError",
    "OutsideDomainError",
    "Prediction",
    "Prior",
    "Problem",
    "QueueFullError",
    "Readiness",
    "RefusedError",
    "RoverStep",
    "RoverTwin",
    "RoverTwinError",
    "Scenario",
    "ServerError",
    "Stretch",
    "SuggestedRun",
    "SuggestedRuns",
    "SuggestionReason",
    "Summary",
    "TimedOutError",
    "TrainingFailedError",
    "TrainingJob",
    "UnexpectedAnswerError",
    "Upload",
    "UploadReport",
    "VersionState",
]
