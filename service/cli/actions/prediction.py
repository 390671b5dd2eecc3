"""What `rover-twin predict` does: the API's own input model and encoders around a twin that is loaded here."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel, ValidationError
from rich.console import Console

from model_store import ModelStore
from service.allowed import Words
from service.cli.failures import RefusedError, UsageError
from service.cli.output import make_table
from service.cli.threads import use_threads
from service.settings import load_settings
from service.twin import OutsideDomainError, TwinRegistry
from service.wire.faults import faults_of, summary_of
from service.wire.forms import ENCODERS, Format, Subject, written
from service.wire.prediction import ALLOWED, PredictionInputs, predict, require_few_points
from service.wire.stage_inputs import StageInputs

_SHOWN_ROWS = 11
_STAGE_WORDS = Words.of(StageInputs)
Inputs = TypeVar("Inputs", bound=BaseModel)


def is_text(form: str) -> bool:
    """Whether this form can be read on a terminal."""
    return form == "table" or ENCODERS[Format(form)].text


def answer(store: ModelStore, inputs: Mapping[str, Any], form: str, layout: Sequence[str] = ()) -> bytes:
    """The answer to the fields that the user gave, as a table or a `Format`. Text is UTF-8 and ends with a line feed.
    `layout` has the parameters of a USD layer, each as name=value.

    Raises UsageError or InvalidValueError for inputs that the API would refuse too, RefusedError for a strict
    question outside the domain, and what loading a twin raises.
    """
    stage = _checked(StageInputs, dict(_name_and_value(each) for each in layout), _STAGE_WORDS)
    stage.require_usd(form)
    subject = _predict(store, _checked(PredictionInputs, inputs, ALLOWED))
    if form == "table":
        return _table(subject).encode()
    content = written(Format(form), subject, stage.placement())
    return content.rstrip(b"\n") + b"\n" if is_text(form) else content


def _name_and_value(option: str) -> tuple[str, str]:
    name, separator, value = option.partition("=")
    if not separator:
        raise UsageError(f"--usd is {option!r}, allowed is name=value with a name of {', '.join(_STAGE_WORDS)}")
    return name, value


def _checked(model: type[Inputs], inputs: Mapping[str, Any], words: Mapping[str, str]) -> Inputs:
    try:
        return model.model_validate(inputs)
    except ValidationError as error:
        # the API's words expect to hear first where a field was (query, body)
        errors = [{**each, "loc": ("option", *each["loc"])} for each in error.errors(include_url=False)]
        faults = faults_of(errors, words)
        raise UsageError(summary_of(faults)) from error


def _predict(store: ModelStore, inputs: PredictionInputs) -> Subject:
    settings = load_settings()
    require_few_points(inputs, settings.max_points)
    use_threads()
    loaded = TwinRegistry(store, settings.default_model).get(inputs.model)
    try:
        return predict(inputs, loaded)
    except OutsideDomainError as error:
        raise RefusedError(str(error)) from error


def _table(subject: Subject) -> str:
    """Summary and about eleven points, evenly spread over time."""
    prediction, twin = subject.prediction, subject.loaded.twin
    scenario, summary = prediction.scenario, prediction.summary
    slip = "unknown" if summary.slip_ratio is None else f"{summary.slip_ratio:.2f}"
    alias = f" ({subject.loaded.alias})" if subject.loaded.alias else ""
    lines = [
        f"model     {twin.name}@{twin.version}{alias}, prior {prediction.prior_name}",
        f"scenario  slope {scenario.slope_deg:g} deg, mass {scenario.mass_kg:g} kg, "
        f"torque {scenario.torque_nm:g} N m, horizon {scenario.horizon_s:g} s",
        f"outcome   {summary.outcome}: x {summary.final_x_m:.3f} m, y {summary.final_y_m:.3f} m in the slope frame",
        f"motion    distance {summary.distance_m:.3f} m, mean speed {summary.mean_speed_m_s:.3f} m/s, "
        f"slip ratio {slip}",
        "domain    inside" if prediction.domain.inside else "domain    OUTSIDE: the answer is extrapolated",
        *(f"          {reason.detail}" for reason in prediction.domain.reasons),
    ]
    return "\n".join(lines) + f"\n\n{prediction.frame} frame\n" + _points(subject)


def _points(subject: Subject) -> str:
    columns = subject.columns()
    table = make_table(*columns, left=0)
    count = len(columns["time_s"])
    for index in np.unique(np.linspace(0, count - 1, min(count, _SHOWN_ROWS)).round().astype(int)):
        time, *positions = (float(values[index]) for values in columns.values())
        table.add_row(f"{time:g}", *(f"{value:.4f}" for value in positions))
    text = io.StringIO()
    Console(file=text, width=120).print(table)
    shown = min(count, _SHOWN_ROWS)
    more = f"({shown} of {count} points; --format csv or --json gives all)\n" if shown < count else ""
    return "\n".join(line.rstrip() for line in text.getvalue().splitlines()) + "\n" + more
