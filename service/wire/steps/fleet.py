"""Rovers by id, each with the version that moves it: what a connection keeps, or one request makes and forgets."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from model_store import InvalidReferenceError, parse_reference
from service.errors import InvalidValueError
from service.physics.scenario import Array
from service.twin import Loaded, Twin
from service.twin.steps import Live, Moment, Moments, StoredStates, read_states
from service.wire.faults import InvalidInputError, fault
from service.wire.steps.question import RoverStep, StepsQuestion, state_text, wrong_state

MOST_VERSIONS = 4
"""Versions that the states of one request may name."""

DEFAULT = ""
"""The reference for rovers that begin, where the request names no model."""

_NO_ROVER = "its numbers are not those of a rover"


@dataclass(frozen=True, slots=True, eq=False)
class Travelled:
    """The states that came with a question: those of each version by reference, with rows of the question's rovers.

    `references` are the versions that are needed to answer, `failures` what is wrong, by row.
    """

    stored: Mapping[str, StoredStates]
    references: Sequence[str]
    failures: Mapping[int, Exception]


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Rovers that one version moved on: their places among those that were sent, and columns (rover, ...)."""

    loaded: Loaded
    places: Sequence[int]
    ids: Sequence[str]
    moments: Moments
    states: Array


@dataclass(frozen=True, slots=True, eq=False)
class Stepped:
    """What one question did, and by their place among those that were sent what went wrong with other rovers."""

    groups: Sequence[Group]
    failures: Mapping[int, Exception]

    def __len__(self) -> int:
        return sum(len(each.ids) for each in self.groups)

    def identity(self) -> dict[str, Any] | None:
        """Who answered; None where several versions did, or none."""
        if len(self.groups) != 1:
            return None
        loaded = self.groups[0].loaded
        return {"name": loaded.twin.name, "version": loaded.twin.version, "alias": loaded.alias}


def travelled(question: StepsQuestion) -> Travelled:
    """Reads the states that came with a question."""
    rows = [row for row, state in enumerate(question.states) if state is not None]
    stored, wrong = read_states([question.states[row] or b"" for row in rows]) if rows else ([], {})
    failures: dict[int, Exception] = {rows[at]: _wrong_state(question, rows[at], str(why)) for at, why in wrong.items()}
    by_reference: dict[str, StoredStates] = {}
    for each in stored:
        own = np.array(rows, dtype=np.intp)[each.rows]
        reference = f"{each.name}@{each.version}"
        if not _may_be(reference):
            failures |= {row: _wrong_state(question, row, "it names no model") for row in own.tolist()}
        elif len(by_reference) < MOST_VERSIONS:
            by_reference[reference] = replace(each, rows=own)
        else:
            many = f"the states name more than {MOST_VERSIONS} versions: send them in several requests"
            failures |= {row: _wrong_state(question, row, many) for row in own.tolist()}
    references = list(by_reference)
    if question.model or (len(rows) < len(question) and not np.isnan(question.mass_kg).all()):
        references.insert(0, question.model or DEFAULT)
    return Travelled(by_reference, references, failures)


class Fleet:
    """Up to `most` rovers. Not to be used by several threads at once."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._home: dict[str, Live] = {}
        self._lives: dict[int, Live] = {}  # by twin

    def __len__(self) -> int:
        return len(self._home)

    def step(self, question: StepsQuestion, came: Travelled, loaded: Mapping[str, Loaded | Exception]) -> Stepped:
        """Moves the rovers of a question on. `loaded` has each of the references that `came` needs, or why not."""
        failures: dict[int, Exception] = dict(came.failures)
        asked = loaded[question.model] if question.model else None
        for reference, stored in came.stored.items():
            failures |= self._put(question, stored, loaded[reference], asked)
        begin = loaded.get(question.model or DEFAULT)
        if begin is not None:
            self._begin(question, begin, failures)
        aliases = {id(each.twin): each for each in loaded.values() if isinstance(each, Loaded)}
        groups = []
        for live, rows in self._homes(question, asked, failures):
            who = aliases.get(id(live.twin)) or Loaded(live.twin, None)
            groups.append(self._advance(live, who, question, rows, failures))
        self.remove(question.remove)
        by_place = {**question.failures} | {question.places[row]: error for row, error in failures.items()}
        return Stepped([each for each in groups if len(each.ids)], by_place)

    def step_one(self, rover: RoverStep) -> tuple[Twin, Moment] | Exception | None:
        """Moves one that is kept here on: the version that did and where it is, or what went wrong; None if there is
        none. The same as `step` of a question that has only this one, in plain numbers.
        """
        live = self._home.get(rover.id)
        if live is None:
            return None
        moment = live.advance_one(rover.id, rover.slope_deg, rover.torque_nm or 0.0, rover.brake, rover.dt_s)
        if moment.finite:
            return live.twin, moment
        self.remove([rover.id])
        return wrong_state("", _NO_ROVER)

    def remove(self, ids: Iterable[str]) -> None:
        """Forgets rovers, those there are."""
        for name in ids:
            live = self._home.pop(name, None)
            if live is not None:
                live.remove(name)
                if not len(live):
                    self._lives.pop(id(live.twin), None)

    def states(self) -> dict[str, str]:
        """The state of each rover as text, to go on from elsewhere."""
        found = {name: state for live in self._lives.values() for name, state in live.states().items()}
        return {name: state_text(found[name]) for name in self._home}

    def _homes(
        self, question: StepsQuestion, asked: Loaded | Exception | None, failures: dict[int, Exception]
    ) -> list[tuple[Live, list[int]]]:
        """The rows of each version's rovers."""
        if len(self._lives) == 1 and not failures and all(map(self._home.__contains__, question.ids)):
            (only,) = self._lives.values()
            if not isinstance(asked, Loaded) or only.twin is asked.twin:
                return [(only, list(range(len(question))))]
        groups: dict[int, tuple[Live, list[int]]] = {}
        for row, name in enumerate(question.ids):
            if row in failures:
                continue
            live = self._home.get(name)
            if live is None:
                allowed = "that of a rover that is kept here; others need a state or a start"
                failures[row] = InvalidInputError(fault("id", name, allowed))
            elif isinstance(asked, Loaded) and live.twin is not asked.twin:
                own, said = (f"{twin.name}@{twin.version}" for twin in (live.twin, asked.twin))
                failures[row] = InvalidInputError(
                    fault("model", said, f"{own}, which the rover belongs to, or a start")
                )
            else:
                groups.setdefault(id(live.twin), (live, []))[1].append(row)
        return list(groups.values())

    def _put(
        self,
        question: StepsQuestion,
        stored: StoredStates,
        loaded: Loaded | Exception,
        asked: Loaded | Exception | None,
    ) -> dict[int, Exception]:
        """Takes states in; by row, what is wrong with some of them."""
        rows = stored.rows.tolist()
        live = self._live(loaded)
        if isinstance(live, Exception):
            return dict.fromkeys(rows, live)
        if isinstance(asked, Loaded) and asked.twin is not live.twin:
            why = f"it is of {stored.name}@{stored.version}, asked for is {asked.twin.name}@{asked.twin.version}"
            return {row: _wrong_state(question, row, why) for row in rows}
        wrong = live.stepper.wrong(stored.numbers)
        names = [question.ids[row] for row in rows]
        if not self._home and len(rows) <= self._most and not wrong and np.isnan(question.mass_kg[stored.rows]).all():
            self._home = dict.fromkeys(names, live)
            live.put(names, stored.numbers)
            return {}
        failures: dict[int, Exception] = {rows[at]: _wrong_state(question, rows[at], str(wrong[at])) for at in wrong}
        begins, good = (~np.isnan(question.mass_kg[stored.rows])).tolist(), []
        for at, row in enumerate(rows):
            if row in failures:
                continue
            if begins[at]:
                own = float(live.stepper.masses_kg(stored.numbers[at : at + 1])[0])
                failures[row] = _both(float(question.mass_kg[row]), own)
            elif self._take(question.ids[row], live):
                good.append(at)
            else:
                failures[row] = self._full(question.ids[row])
        if good:
            numbers = stored.numbers if len(good) == len(rows) else stored.numbers[good]
            live.put([names[at] for at in good], numbers)
        return failures

    def _begin(self, question: StepsQuestion, loaded: Loaded | Exception, failures: dict[int, Exception]) -> None:
        """Puts rovers to the start."""
        rows = [row for row in np.flatnonzero(~np.isnan(question.mass_kg)).tolist() if question.states[row] is None]
        live = self._live(loaded) if rows else None
        if live is None:
            return
        if isinstance(live, Exception):
            failures |= dict.fromkeys(rows, live)
            return
        good = [row for row in rows if self._take(question.ids[row], live)]
        failures |= {row: self._full(question.ids[row]) for row in set(rows).difference(good)}
        if good:
            states = live.stepper.start(
                question.mass_kg[good], question.slope_deg[good], question.start_speed_m_s[good]
            )
            live.put([question.ids[row] for row in good], states)

    def _advance(
        self, live: Live, who: Loaded, question: StepsQuestion, rows: list[int], failures: dict[int, Exception]
    ) -> Group:
        """Moves rovers of one version on."""
        slope, torque, brake, dt = question.slope_deg, question.torque_nm, question.brake, question.dt_s
        ids, places = question.ids, question.places
        if len(rows) < len(question):
            ids, places = [ids[row] for row in rows], [places[row] for row in rows]
            slope, torque, brake, dt = slope[rows], torque[rows], brake[rows], dt[rows]
        states, moments = live.advance(ids, slope, torque, brake, dt)
        finite = moments.finite
        if finite is not None:
            for at in np.flatnonzero(~finite).tolist():
                failures[rows[at]] = _wrong_state(question, rows[at], _NO_ROVER)
                self.remove([ids[at]])
            kept = np.flatnonzero(finite)
            ids, places = [ids[at] for at in kept.tolist()], [places[at] for at in kept.tolist()]
            states, moments = states[kept], moments.only(kept)
        return Group(who, places, ids, moments, states)

    def _live(self, loaded: Loaded | Exception) -> Live | Exception:
        if isinstance(loaded, Exception):
            return loaded
        live = self._lives.get(id(loaded.twin))
        if live is None:
            try:
                live = self._lives[id(loaded.twin)] = Live(loaded.twin)
            except InvalidValueError as error:
                return error
        return live

    def _take(self, name: str, live: Live) -> bool:
        """Gives a rover a home; its numbers are put there next. False where there is no room."""
        before = self._home.get(name)
        if before is None and len(self._home) >= self._most:
            return False
        if before is not None and before is not live:
            self.remove([name])
        self._home[name] = live
        return True

    def _full(self, name: str) -> Exception:
        return InvalidInputError(fault("id", name, f"that of a rover that is kept here: {self._most} are the most"))


def _may_be(reference: str) -> bool:
    try:
        return parse_reference(reference).version is not None
    except InvalidReferenceError:
        return False


def _wrong_state(question: StepsQuestion, row: int, why: str) -> Exception:
    return wrong_state(state_text(question.states[row] or b""), why)


def _both(started_kg: float, kept_kg: float) -> Exception:
    if started_kg != kept_kg:
        allowed = f"{kept_kg:.12g}, the mass of the state's rover; send a state or a start"
        return InvalidInputError(fault("start.mass_kg", started_kg, allowed))
    return InvalidInputError(fault("start", {}, "nothing beside a state: a rover begins or goes on"))
