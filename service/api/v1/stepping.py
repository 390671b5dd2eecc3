"""What `/v1/steps` and `/v1/live` have in common: finding the versions, stepping, and what went wrong."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from model_store import StoreError
from service.api.http.errors import problem_members, told
from service.api.services import Services
from service.errors import RoverTwinError
from service.twin import Loaded
from service.wire.faults import MAX_SHOWN
from service.wire.steps.fleet import Fleet, Stepped, Travelled, travelled
from service.wire.steps.question import StepsQuestion

# On the event loop, for handing them to a thread takes longer: so many rovers, and seconds of all of them together
_ROVERS_AT_ONCE, _SECONDS_AT_ONCE = 16, 2.0


async def stepped(question: StepsQuestion, fleet: Fleet, services: Services, path: str) -> Stepped:
    """Moves rovers on. Raises what `Services.twin` raises of a model that the question names, and OverloadedError."""
    if is_small(question):
        came = travelled(question)
        return _counted(question, fleet, came, await _loaded(question, came, services), services, path)
    came = await services.predictions.run(lambda: travelled(question))
    loaded = await _loaded(question, came, services)
    return await services.predictions.run(lambda: _counted(question, fleet, came, loaded, services, path))


def is_small(question: StepsQuestion) -> bool:
    """Whether it is answered in well under a millisecond."""
    return len(question) <= _ROVERS_AT_ONCE and float(question.dt_s.sum()) <= _SECONDS_AT_ONCE


async def _loaded(question: StepsQuestion, came: Travelled, services: Services) -> dict[str, Loaded | Exception]:
    found: dict[str, Loaded | Exception] = {}
    for reference in came.references:
        try:
            found[reference] = await services.twin(reference or None)
        except (RoverTwinError, StoreError) as error:
            if reference and reference == question.model:
                raise
            found[reference] = error
    return found


def _counted(
    question: StepsQuestion,
    fleet: Fleet,
    came: Travelled,
    loaded: Mapping[str, Loaded | Exception],
    services: Services,
    path: str,
) -> Stepped:
    began = time.perf_counter()
    found = fleet.step(question, came, loaded)
    services.instruments.stepped(path, len(found), len(found.failures), time.perf_counter() - began)
    return found


def problems(question: StepsQuestion, found: Stepped, path: str) -> list[dict[str, Any]]:
    """The problems of rovers that were not moved on, in order, without what only a whole answer has."""
    return [_problem(at, question.sent_ids[at], found.failures[at], path) for at in sorted(found.failures)]


def _problem(index: int, name: object, error: Exception, path: str) -> dict[str, Any]:
    described = told(error, path)
    sent = name[:MAX_SHOWN] if isinstance(name, str) else None
    return {"index": index, "id": sent, **problem_members(described), **described.members}
