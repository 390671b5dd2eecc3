"""Turns the JSON documents of the service into the values of `answers`. Unknown members are ignored."""

from __future__ import annotations

from types import MappingProxyType
from typing import Any, cast, get_args

from rover_twin_client.answers import (
    Array,
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
from rover_twin_client.document import Node
from rover_twin_client.errors import UnexpectedAnswerError


def prediction(answer: Node) -> Prediction:
    """The answer of /v1/predictions; positions in metres, times in seconds."""
    frame = frame_of(answer["frame"])
    trajectory = answer["trajectory"]
    time_s = trajectory["time_s"].array()
    across = "y_m" if frame == "slope" else "z_m"
    positions = {name: trajectory[name].array(time_s.size) for name in ("x_m", across)}

    def on_request(name: str) -> Array | None:
        return trajectory.optional(name, lambda column: column.array(time_s.size))

    return Prediction(
        model=identity(answer["model"]),
        scenario=_scenario(answer["scenario"]),
        frame=frame,
        time_s=time_s,
        x_m=positions["x_m"],
        y_m=positions.get("y_m"),
        z_m=positions.get("z_m"),
        prior=answer.optional("prior", lambda prior: _prior(prior, across, time_s.size)),
        domain=_domain(answer["domain"]),
        summary=_summary(answer["summary"]),
        band=answer.optional("band", lambda found: band(found, time_s.size)),
        speed_m_s=on_request("speed_m_s"),
        rear_wheel_speed_rad_s=on_request("rear_wheel_speed_rad_s"),
        front_wheel_speed_rad_s=on_request("front_wheel_speed_rad_s"),
    )


def mobility(answer: Node) -> MobilityMap:
    """The answer of /v1/mobility. Every table must have a row for each torque and a column for each slope."""
    torque_nm, slope_deg = answer["torque_nm"].array(), answer["slope_deg"].array()
    shape = torque_nm.size, slope_deg.size
    return MobilityMap(
        model=identity(answer["model"]),
        mass_kg=answer["mass_kg"].number(),
        horizon_s=answer["horizon_s"].number(),
        confidence=answer.optional("confidence", Node.number),
        steepest_by=answer["steepest_by"].text(),
        torque_nm=torque_nm,
        slope_deg=slope_deg,
        outcome=answer["outcome"].words(*shape),
        mean_speed_m_s=answer["mean_speed_m_s"].numbers(*shape),
        slip_ratio=answer["slip_ratio"].numbers(*shape, gaps=True),
        inside_domain=answer["inside_domain"].flags(*shape),
        steepest_climb_slope_deg=answer["steepest_climb_slope_deg"].numbers(torque_nm.size, gaps=True),
        steepest_inside_domain=tuple(
            None if each.value is None else each.flag()
            for each in answer["steepest_inside_domain"].items(torque_nm.size)
        ),
    )


def suggested_runs(answer: Node) -> SuggestedRuns:
    """The answer of /v1/models/{name}/versions/{version}/suggested-runs."""
    return SuggestedRuns(
        model=identity(answer["model"]), runs=tuple(_suggested_run(item) for item in answer["runs"].items())
    )


def models(answer: Node) -> list[ModelInfo]:
    """The answer of /v1/models."""
    return [model(item) for item in answer["models"].items()]


def model(answer: Node) -> ModelInfo:
    """The answer of /v1/models/{name}."""
    return ModelInfo(
        name=answer["name"].text(),
        versions=_rising(answer["versions"]),
        aliases=MappingProxyType({alias: v.whole() for alias, v in answer["aliases"].members()}),
        description=answer.optional("description", Node.text),
        archived=answer.optional("archived", _rising) or (),
        deleted=answer.optional("deleted", _rising) or (),
    )


def _rising(numbers: Node) -> tuple[int, ...]:
    return tuple(sorted(number.whole() for number in numbers.items()))


def manifest(answer: Node) -> dict[str, Any]:
    """The answer of /v1/models/{name}/versions/{version}: the manifest as it was published."""
    return {key: member.value for key, member in answer.members()}


def readiness(answer: Node) -> Readiness:
    """The answer of /health/ready when the service can predict."""
    failures = answer.get("failures")
    return Readiness(
        model=identity(answer["model"]),
        failures=tuple(item.value for item in failures.items()) if failures else (),
    )


def frame_of(node: Node) -> Frame:
    """The frame of a trajectory."""
    if node.text() not in get_args(Frame):
        raise UnexpectedAnswerError(f"{node.path} is {node.value!r}, expected {' or '.join(get_args(Frame))}")
    return cast("Frame", node.value)


def identity(node: Node) -> ModelIdentity:
    """Which version answered."""
    return ModelIdentity(
        name=node["name"].text(), version=node["version"].whole(), alias=node.optional("alias", Node.text)
    )


def _scenario(node: Node) -> Scenario:
    return Scenario(
        slope_deg=node["slope_deg"].number(),
        mass_kg=node["mass_kg"].number(),
        torque_nm=node["torque_nm"].number(),
        horizon_s=node["horizon_s"].number(),
    )


def _prior(node: Node, across: str, length: int) -> Prior:
    positions = {name: node[name].array(length) for name in ("x_m", across)}
    return Prior(
        name=node["name"].text(),
        x_m=positions["x_m"],
        y_m=positions.get("y_m"),
        z_m=positions.get("z_m"),
    )


def band(node: Node, length: int) -> Band:
    """The band around a trajectory of so many times."""
    return Band(
        level=node["level"].number(),
        x_lower_m=node["x_lower_m"].array(length),
        x_upper_m=node["x_upper_m"].array(length),
        y_lower_m=node["y_lower_m"].array(length),
        y_upper_m=node["y_upper_m"].array(length),
    )


def _domain(node: Node) -> Domain:
    nearest = node.get("nearest_runs")
    return Domain(
        inside=node["inside"].flag(),
        reasons=tuple(reason(item) for item in node["reasons"].items()),
        distance=node.optional("distance", Node.number),
        nearest_runs=() if nearest is None else tuple(_nearest_run(item) for item in nearest.items()),
    )


def _nearest_run(node: Node) -> NearestRun:
    return NearestRun(
        run=node["run"].text(),
        slope_deg=node["slope_deg"].number(),
        mass_kg=node["mass_kg"].number(),
        torque_nm=node["torque_nm"].number(),
        left_out_final_error_m=node.optional("left_out_final_error_m", Node.number),
        distance=node["distance"].number(),
    )


def reason(node: Node) -> DomainReason:
    """One input outside the domain."""
    return DomainReason(
        field=node["field"].text(),
        value=node["value"].number(),
        lowest=node.optional("lowest", Node.number),
        highest=node.optional("highest", Node.number),
        detail=node["detail"].text(),
    )


def _summary(node: Node) -> Summary:
    return Summary(
        outcome=node["outcome"].text(),
        final_x_m=node["final_x_m"].number(),
        final_y_m=node["final_y_m"].number(),
        distance_m=node["distance_m"].number(),
        mean_speed_m_s=node["mean_speed_m_s"].number(),
        slip_ratio=node.optional("slip_ratio", Node.number),
    )


def _suggested_run(node: Node) -> SuggestedRun:
    reason = node["reason"]
    return SuggestedRun(
        file=node["file"].text(),
        set=node["set"].text(),
        slope_deg=node["slope_deg"].number(),
        mass_kg=node["mass_kg"].number(),
        torque_nm=node["torque_nm"].number(),
        horizon_s=node["horizon_s"].number(),
        step_s=node["step_s"].number(),
        reason=SuggestionReason(
            expected_error_m=reason.optional("expected_error_m", Node.number),
            distance=reason["distance"].number(),
            nearest_run=reason["nearest_run"].text(),
        ),
    )
