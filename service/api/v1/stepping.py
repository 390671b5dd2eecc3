"""What `/v1/steps` and `/v1/live` have in common: reading, finding the versions, stepping, and what went wrong."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from model_store import StoreError
from service.api.http.many_problems import MOST_IN_FULL, problem_of
from service.api.services import Services
from service.datasets.file_names import printable
from service.errors import RoverTwinError
from service.tracing import span
from service.twin import Loaded
from service.wire.faults import MAX_SHOWN
from service.wire.steps.fleet import Fleet, Stepped, Travelled, travelled
from service.wire.steps.question import StepsQuestion

Result = TypeVar("Result")

# On the event loop, for handing them to a thread takes longer: bytes that are read, seconds of all rovers, rovers
BYTES_AT_ONCE, SECONDS_AT_ONCE, _ROVERS_AT_ONCE = 16_384, 2.0, 16


@dataclass(frozen=True, slots=True)
class Stepping(Generic[Result]):
    """How one request or message is read, which rovers it moves, and what is made of that."""

    services: Services
    path: str
    fleet: Fleet
    read: Callable[[], StepsQuestion]
    answer: Callable[[StepsQuestion, Stepped], Result]

    async def done(self, size_bytes: int) -> Result:
        """Raises what `read` raises, what `Services.twin` raises of a model that is named, and OverloadedError."""
        question = self.read() if size_bytes <= BYTES_AT_ONCE else None
        if question is not None and _is_small(question):
            came = travelled(question)
            loaded = self._resident(came)
            return self._finished(question, came, await self._loaded(question, came) if loaded is None else loaded)

        def in_one_go() -> tuple[StepsQuestion, Travelled, Result | None]:
            asked = self.read() if question is None else question
            came = travelled(asked)
            loaded = self._resident(came)
            return asked, came, None if loaded is None else self._finished(asked, came, loaded)

        asked, came, result = await self.services.predictions.run(in_one_go)
        if result is not None:
            return result
        late = await self._loaded(asked, came)
        return await self.services.predictions.run(lambda: self._finished(asked, came, late))

    def _resident(self, came: Travelled) -> dict[str, Loaded | Exception] | None:
        """The versions that are needed; None if one of them is not in memory."""
        found: dict[str, Loaded | Exception] = {}
        for reference in came.references:
            loaded = self.services.registry.resident(reference or None)
            if loaded is None:
                return None
            found[reference] = loaded
        return found

    async def _loaded(self, question: StepsQuestion, came: Travelled) -> dict[str, Loaded | Exception]:
        found: dict[str, Loaded | Exception] = {}
        for reference in came.references:
            try:
                found[reference] = await self.services.twin(reference or None)
            except (RoverTwinError, StoreError) as error:
                if reference and reference == question.model:
                    raise
                found[reference] = error
        return found

    def _finished(self, question: StepsQuestion, came: Travelled, loaded: Mapping[str, Loaded | Exception]) -> Result:
        began = time.perf_counter()
        with span("step", rovers=len(question)):
            found = self.fleet.step(question, came, loaded)
        took = time.perf_counter() - began
        self.services.instruments.stepped(self.path, len(found), len(found.failures), took)
        return self.answer(question, found)


def _is_small(question: StepsQuestion) -> bool:
    """Whether it is answered in well under a millisecond."""
    return len(question) <= _ROVERS_AT_ONCE and float(question.dt_s.sum()) <= SECONDS_AT_ONCE


def problems(question: StepsQuestion, found: Stepped) -> list[dict[str, Any]]:
    """The problems of rovers that were not moved on, in order, without what only a whole answer has."""
    return [
        rover_problem(at, question.sent_ids[at], found.failures[at], short=count >= MOST_IN_FULL)
        for count, at in enumerate(sorted(found.failures))
    ]


def rover_problem(index: int, name: object, error: Exception, *, short: bool = False) -> dict[str, Any]:
    """That of one rover, at its place among those that were sent."""
    sent = printable(name[:MAX_SHOWN]) if isinstance(name, str) else None
    return problem_of(index, error, short=short) | {"id": sent}
