"""Turns the JSON documents of the service into the values of `training`. Unknown members are ignored."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, cast, get_args

from rover_twin_client.document import Node
from rover_twin_client.errors import UnexpectedAnswerError
from rover_twin_client.training import (
    Alias,
    Dataset,
    DatasetInfo,
    Finding,
    JobEvent,
    JobFailure,
    JobProgress,
    JobResult,
    JobState,
    TrainingJob,
    Upload,
    UploadReport,
    VersionState,
    VersionStateName,
)


def upload(answer: Node) -> Upload:
    """The answer of POST /v1/admin/datasets."""
    return Upload(
        id=answer["id"].text(),
        name=answer.optional("name", Node.text),
        created=answer["created"].flag(),
        stored=answer["stored"].flag(),
        dry_run=answer["dry_run"].flag(),
        report=report(answer["report"]),
        already_known_as=answer.optional("already_known_as", _texts) or (),
    )


def report(node: Node) -> UploadReport:
    """What the service found in an upload."""
    return UploadReport(
        accepted=_texts(node["accepted"]),
        rejected=_texts(node["rejected"]),
        findings=tuple(_finding(item) for item in node["findings"].items()),
        findings_count=node["findings_count"].whole(),
        summary=node.optional("summary", _members),
    )


def datasets(answer: Node) -> tuple[list[DatasetInfo], bool]:
    """One page of GET /v1/admin/datasets, and whether there is another."""
    return [DatasetInfo(**_info(item)) for item in answer["datasets"].items()], answer.get("next") is not None


def dataset(answer: Node) -> Dataset:
    """The answer of GET /v1/admin/datasets/{dataset}."""
    users = answer["used_by"]
    return Dataset(
        **_info(answer),
        passport=_members(answer["passport"]),
        source=_members(answer["source"]),
        versions=_texts(users["versions"]),
        jobs=users.optional("jobs", _texts),
    )


def jobs(answer: Node) -> list[TrainingJob]:
    """One page of GET /v1/admin/training-jobs."""
    return [job(item) for item in answer["jobs"].items()]


def job(answer: Node) -> TrainingJob:
    """The answer of GET /v1/admin/training-jobs/{id}."""
    return TrainingJob(
        id=answer["id"].text(),
        state=_state(answer["state"]),
        request=_members(answer["request"]),
        actor=answer["actor"].text(),
        created_at=answer["created_at"].moment(),
        started_at=answer.optional("started_at", Node.moment),
        finished_at=answer.optional("finished_at", Node.moment),
        attempts=answer["attempts"].whole(),
        progress=answer.optional("progress", _progress),
        result=answer.optional("result", _result),
        failure=answer.optional("failure", _failure),
    )


def event(number: int, kind: str, data: Node) -> JobEvent:
    """One event of GET /v1/admin/training-jobs/{id}/events."""
    others = {name: member.value for name, member in data.members() if name != "time"}
    return JobEvent(number=number, kind=kind, time=data["time"].moment(), data=MappingProxyType(others))


def alias(answer: Node) -> Alias:
    """The answer of /v1/models/{name}/aliases/{alias}."""
    return Alias(
        version=answer["version"].whole(),
        seq=answer["seq"].whole(),
        time=answer["time"].moment(),
        actor=answer["actor"].text(),
        reason=answer["reason"].text(),
    )


def aliases(answer: Node) -> list[Alias]:
    """The answer of /v1/models/{name}/aliases/{alias}/history, newest first."""
    return [alias(item) for item in answer["history"].items()]


def version_state(answer: Node) -> VersionState:
    """The answer of /v1/models/{name}/versions/{version}/state, and of what changes it."""
    return VersionState(
        name=answer["name"].text(),
        version=answer["version"].whole(),
        state=_version_state(answer["state"]),
        since=answer.optional("since", Node.moment),
        actor=answer.optional("actor", Node.text),
        reason=answer.optional("reason", Node.text),
    )


def content(answer: Node) -> bytes:
    """The body of the answer, unchanged."""
    body: bytes = answer.value
    return body


def nothing(_answer: Node) -> None:
    """An answer without a body."""


def _info(node: Node) -> dict[str, Any]:
    return {
        "id": node["id"].text(),
        "name": node["name"].text(),
        "description": node["description"].text(),
        "created_at": node.optional("created_at", Node.moment),
        "created_by": node["created_by"].text(),
        "summary": _members(node["summary"]),
        "unreadable": node.optional("unreadable", Node.text),
    }


def _finding(node: Node) -> Finding:
    return Finding(
        file=node["file"].text(),
        row=node.optional("row", Node.whole),
        column=node.optional("column", Node.text),
        code=node["code"].text(),
        severity=node["severity"].text(),
        message=node["message"].text(),
    )


def _progress(node: Node) -> JobProgress:
    return JobProgress(
        phase=node["phase"].text(),
        fraction=node["fraction"].number(),
        epoch=node.optional("epoch", Node.whole),
        epochs=node.optional("epochs", Node.whole),
        train_error_m=node.optional("train_error_m", Node.number),
        validation_error_m=node.optional("validation_error_m", Node.number),
        eta_s=node.optional("eta_s", Node.number),
    )


def _result(node: Node) -> JobResult:
    return JobResult(
        model=node["model"].text(),
        version=node["version"].whole(),
        promoted=node["promoted"].flag(),
        metrics=_members(node["metrics"]),
        comparison=node.optional("comparison", _members),
        moves=tuple(_members(item) for item in node["moves"].items()),
        same_weights_as=node.optional("same_weights_as", Node.text),
    )


def _failure(node: Node) -> JobFailure:
    return JobFailure(type=node["type"].text(), message=node["message"].text(), remedy=node["remedy"].text())


def _state(node: Node) -> JobState:
    return cast("JobState", _one_of(node, get_args(JobState)))


def _version_state(node: Node) -> VersionStateName:
    return cast("VersionStateName", _one_of(node, get_args(VersionStateName)))


def _one_of(node: Node, words: tuple[str, ...]) -> str:
    if node.text() not in words:
        raise UnexpectedAnswerError(f"{node.path} is {node.value!r}, expected one of {', '.join(words)}")
    return node.text()


def _members(node: Node) -> Mapping[str, Any]:
    return MappingProxyType({name: member.value for name, member in node.members()})


def _texts(node: Node) -> tuple[str, ...]:
    return tuple(item.text() for item in node.items())
