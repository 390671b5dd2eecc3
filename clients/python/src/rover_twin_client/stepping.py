"""What both live clients keep of their rovers: the last state of each. Their messages and answers. No I/O."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any

from rover_twin_client import drive_parsing as parsing
from rover_twin_client.calls import Call, finite, refused, said
from rover_twin_client.document import Node
from rover_twin_client.drives import Moment
from rover_twin_client.errors import InvalidInputError, Problem, UnexpectedAnswerError

PATH = "/v1/steps"
LIVE_PATH = "/v1/live"
USUAL_DT_S = 0.1
LONGEST_ID = 100


@dataclass(frozen=True, slots=True)
class RoverStep:
    """One rover's next step: the slope under its middle, stall torque per wheel or brake, and how long they act.

    Without `brake` it needs a torque: 0 where the wheels are to turn freely.
    """

    id: str
    slope_deg: float
    torque_nm: float | None = None
    brake: bool = False
    dt_s: float = USUAL_DT_S


class Rovers:
    """The rovers of one live client. A rover is new, or has the state that its last step ended with."""

    def __init__(self, model: str | None) -> None:
        self._model = model
        self._starts: dict[str, dict[str, float]] = {}
        self._states: dict[str, str] = {}

    @property
    def states(self) -> dict[str, str]:
        """The last state of each rover that has moved: enough to go on elsewhere, at any time."""
        return dict(self._states)

    def start(self, name: str, mass_kg: float, start_speed_m_s: float | None) -> None:
        """A rover that begins to move with its next step; one of the same name is forgotten."""
        checked_id(name)
        numbers = {"mass_kg": mass_kg, **said(start_speed_m_s=start_speed_m_s)}
        self._starts[name] = {field: finite(field, value) for field, value in numbers.items()}
        self._states.pop(name, None)

    def resume(self, states: Mapping[str, str]) -> None:
        """Rovers that go on from states, which another client or service may have answered."""
        for name, state in states.items():
            if not isinstance(state, str):
                raise refused("state", state, "the text of a state")
            self._starts.pop(checked_id(name), None)
            self._states[name] = state

    def forget(self, name: str) -> None:
        """Drops a rover; one that is not known is no error."""
        self._starts.pop(name, None)
        self._states.pop(name, None)

    def message(self, steps: Iterable[RoverStep], known: Iterable[str] = ()) -> dict[str, Any]:
        """The message that asks for the steps. The service has the state of those that it `known` from before."""
        there = set(known)
        rovers = [self._asked(step, there) for step in steps]
        # Rovers that are on their way stay with their version, whatever an alias names by now.
        begins = any("start" in each for each in rovers)
        return {"rovers": rovers, "include": ["state"], **(said(model=self._model) if begins else {})}

    def call(self, steps: Iterable[RoverStep]) -> Call[list[Moment]]:
        """POST /v1/steps. Harmless to repeat: a state is sent along, and nothing is kept at the service."""
        message = {name: value for name, value in self.message(steps).items() if name != "include"}
        return Call(PATH, self.read, method="POST", json=message)

    def read(self, answer: Node) -> list[Moment]:
        """The moments of an answer, in its order. Raises InvalidInputError for the first rover that was refused."""
        moments = [parsing.moment(item) for item in answer["rovers"].items()]
        for each in moments:
            if each.state is not None:
                self._states[each.id] = each.state
                self._starts.pop(each.id, None)
        errors = answer.get("errors")
        if errors and (failures := list(errors.items())):
            raise refusal(failures[0])
        return moments

    def _asked(self, step: RoverStep, known: set[str]) -> dict[str, Any]:
        origin: dict[str, Any] = {}
        if step.id in self._starts:
            origin = {"start": self._starts[step.id]}
        elif step.id not in self._states:
            raise refused("id", step.id, "the id of a rover that was started or resumed")
        elif step.id not in known:
            origin = {"state": self._states[step.id]}
        if step.torque_nm is None and not step.brake:
            raise refused("torque_nm", None, "a number unless the brake is on; 0 lets the wheels turn freely")
        acts = {"brake": True} if step.brake else {"torque_nm": finite("torque_nm", step.torque_nm)}
        numbers = {"slope_deg": finite("slope_deg", step.slope_deg), "dt_s": finite("dt_s", step.dt_s)}
        return {"id": step.id, **origin, **numbers, **acts}


def checked_id(name: object) -> str:
    """The id of a rover; raises InvalidInputError unless it is a text that can be sent."""
    if isinstance(name, str) and 1 <= len(name) <= LONGEST_ID:
        try:
            name.encode()
        except UnicodeEncodeError:  # half of a surrogate pair
            pass
        else:
            return name
    raise refused("id", name, f"text of 1 to {LONGEST_ID} characters that UTF-8 can hold")


def refusal(node: Node) -> InvalidInputError:
    """The error for a rover that was refused, or for a whole message."""
    errors = node.get("errors")
    faults = tuple(parsing.fault(item) for item in errors.items()) if errors else ()
    status = node.get("status")
    problem = Problem(
        type=node["type"].text(),
        title=node["title"].text(),
        status=status.whole() if status else HTTPStatus.UNPROCESSABLE_ENTITY,
        detail=node["detail"].text(),
        faults=faults,
        members=node.value,
    )
    rover = node.get("id")
    who = f"rover {rover.value!r}: " if rover else ""
    return InvalidInputError(f"{who}{problem.detail}", problem)


def only(moments: list[Moment], name: str) -> Moment:
    """The moment of one rover; raises UnexpectedAnswerError when there is another number of them."""
    if len(moments) != 1 or moments[0].id != name:
        raise UnexpectedAnswerError(f"asked for a step of {name!r}, got {[each.id for each in moments]}")
    return moments[0]
