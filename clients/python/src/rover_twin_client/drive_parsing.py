"""Turns the service's answers about drives and steps into the values of `drives`. Unknown members are ignored."""

from __future__ import annotations

import json
from types import MappingProxyType
from typing import cast

from rover_twin_client.answers import Array, Frame
from rover_twin_client.document import Node
from rover_twin_client.drives import Drive, DriveDomain, DriveEvent, DriveSummary, FailedDrive, Moment, Stretch
from rover_twin_client.errors import FieldFault, UnexpectedAnswerError
from rover_twin_client.parsing import band, frame_of, identity, reason


def drive(answer: Node) -> Drive:
    """The answer of /v1/drives."""
    frame: Frame = frame_of(answer["frame"])
    trajectory = answer["trajectory"]
    time_s = trajectory["time_s"].array()
    count = time_s.size

    def column(name: str) -> Array:
        return trajectory[name].array(count)

    def on_request(name: str) -> Array | None:
        return trajectory.optional(name, lambda found: found.array(count))

    return Drive(
        model=identity(answer["model"]),
        frame=frame,
        time_s=time_s,
        x_m=column("x_m"),
        y_m=column("y_m") if frame == "slope" else None,
        z_m=column("z_m") if frame == "world" else None,
        speed_m_s=column("speed_m_s"),
        slope_deg=column("slope_deg"),
        torque_nm=column("torque_nm"),
        brake=trajectory["brake"].flags(count),
        slip_ratio=column("slip_ratio"),
        rear_wheel_speed_rad_s=on_request("rear_wheel_speed_rad_s"),
        front_wheel_speed_rad_s=on_request("front_wheel_speed_rad_s"),
        band=answer.optional("band", lambda found: band(found, count)),
        events=tuple(_event(item) for item in answer["events"].items()),
        summary=_summary(answer["summary"]),
        domain=_domain(answer["domain"]),
    )


def drive_lines(answer: Node) -> list[Drive | FailedDrive]:
    """The answer of /v1/drives/batch as lines of JSON, in the order in which the drives were sent."""
    found: list[Drive | FailedDrive] = []
    for line in cast(bytes, answer.value).splitlines():
        try:
            document = Node(json.loads(line), f"answer[{len(found)}]")
        except ValueError as fault:
            raise UnexpectedAnswerError(f"line {len(found) + 1} of the answer is not JSON") from fault
        found.append(drive(document) if document.get("trajectory") else failed_drive(document))
    return found


def failed_drive(node: Node) -> FailedDrive:
    """One drive that was refused."""
    errors = node.get("errors")
    return FailedDrive(
        index=node["index"].whole(),
        detail=node["detail"].text(),
        faults=tuple(fault(item) for item in errors.items()) if errors else (),
    )


def fault(node: Node) -> FieldFault:
    """One fault of a problem."""
    allowed = node.get("allowed")
    value = node.get("value")
    return FieldFault(
        field=node["field"].text(),
        value=None if value is None else value.value,
        allowed=None if allowed is None else allowed.text(),
        message=node["message"].text(),
    )


def moment(node: Node) -> Moment:
    """One rover of an answer to a step."""
    domain = node["domain"]
    return Moment(
        id=node["id"].text(),
        state=node.optional("state", Node.text),
        time_s=node["time_s"].number(),
        x_m=node["x_m"].number(),
        y_m=node["y_m"].number(),
        speed_m_s=node["speed_m_s"].number(),
        rear_wheel_speed_rad_s=node["rear_wheel_speed_rad_s"].number(),
        front_wheel_speed_rad_s=node["front_wheel_speed_rad_s"].number(),
        slip_ratio=node["slip_ratio"].number(),
        x_half_width_m=node.optional("x_half_width_m", Node.number),
        moving=node["moving"].flag(),
        inside=domain["inside"].flag(),
        reasons=tuple(item.text() for item in domain["reasons"].items()),
    )


def _event(node: Node) -> DriveEvent:
    return DriveEvent(event=node["event"].text(), time_s=node["time_s"].number(), x_m=node["x_m"].number())


def _summary(node: Node) -> DriveSummary:
    return DriveSummary(
        outcome=node["outcome"].text(),
        probabilities=node.optional(
            "probabilities", lambda found: MappingProxyType({key: each.number() for key, each in found.members()})
        ),
        arrival_time_s=node.optional("arrival_time_s", Node.number),
        arrival_earliest_s=node.optional("arrival_earliest_s", Node.number),
        arrival_latest_s=node.optional("arrival_latest_s", Node.number),
        motor_energy_j=node["motor_energy_j"].number(),
        steepest_slope_deg=node["steepest_slope_deg"].number(),
        steepest_at_m=node["steepest_at_m"].number(),
        final_x_m=node["final_x_m"].number(),
        final_y_m=node["final_y_m"].number(),
        distance_m=node["distance_m"].number(),
        mean_speed_m_s=node["mean_speed_m_s"].number(),
        duration_s=node["duration_s"].number(),
    )


def _domain(node: Node) -> DriveDomain:
    return DriveDomain(
        inside=node["inside"].flag(), stretches=tuple(_stretch(item) for item in node["stretches"].items())
    )


def _stretch(node: Node) -> Stretch:
    return Stretch(
        from_m=node["from_m"].number(),
        to_m=node["to_m"].number(),
        from_s=node["from_s"].number(),
        to_s=node["to_s"].number(),
        inside=node["inside"].flag(),
        reasons=tuple(reason(item) for item in node["reasons"].items()),
    )
