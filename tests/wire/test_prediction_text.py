"""The JSON of one prediction is put together from texts: it is what orjson would write, and what the schema says."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import orjson
import pytest

from model_store import ModelStore
from service.learning.domain import DomainReason, DomainVerdict
from service.settings import load_settings
from service.twin import Frame, Loaded, NonFiniteError, Scenario, sample_times
from service.twin.load import load_twin
from service.wire.forms.json import encode_json
from service.wire.forms.subject import Subject, domain_document
from service.wire.prediction_answer import PredictionAnswer

ALIASES = (None, "champion")
SCENARIOS = (Scenario(12, 430, 60, 4), Scenario(-44.5, 1000.0, 1e-7, 2.5), Scenario(0.0, 310.25, 0, 600))


@pytest.fixture(scope="module")
def shipped():
    store = ModelStore.open(load_settings().store_url)
    found = store.resolve("viper-lunar")
    return load_twin(store, found.name, found.version)


def asked(twin, scenario, frame=Frame.SLOPE, alias=None, **parts):
    times = sample_times(scenario.horizon_s, scenario.horizon_s / 7)
    return Subject(Loaded(twin, alias), twin.predict(scenario, times, frame, **parts))


def orjsons(subject, lists):
    """The answer with these columns, by its dataclasses; `lists` are groups of columns."""
    found, twin = subject.prediction, subject.loaded.twin
    named = {"prior": {"name": found.prior_name}, "band": {"level": found.band and found.band.level}}
    groups = {group: named.get(group, {}) | columns for group, columns in lists.items()}
    return orjson.dumps(
        {
            "model": {"name": twin.name, "version": twin.version, "alias": subject.loaded.alias},
            "scenario": found.scenario,
            "frame": found.frame,
            **groups,
            "domain": domain_document(found.domain),
            "summary": found.summary,
        }
    )


def lists_of(text):
    """The columns as they were written, each as a text that orjson leaves as it is."""
    answer = orjson.loads(text)
    found, at = {}, 0
    for group in ("trajectory", "prior", "band"):
        for name, values in answer.get(group, {}).items():
            if isinstance(values, list):
                at = text.index(b'"%b":[' % name.encode(), at) + len(name) + 3
                written = text[at : text.index(b"]", at) + 1]
                found.setdefault(group, {})[name] = orjson.Fragment(written)
    return found


@pytest.mark.parametrize("alias", ALIASES)
@pytest.mark.parametrize("scenario", SCENARIOS, ids=str)
@pytest.mark.parametrize(
    "parts",
    [
        {},
        {"frame": Frame.WORLD, "with_speed": True},
        {"with_prior": True, "band_level": 0.9, "with_wheel_speed": True},
    ],
    ids=["alone", "in the world", "with all"],
)
def test_it_is_what_orjson_writes(shipped, scenario, alias, parts):
    subject = asked(shipped, scenario, alias=alias, **parts)
    text = encode_json(subject)

    assert text == orjsons(subject, lists_of(text))
    PredictionAnswer.model_validate_json(text, strict=False)
    for name, column in orjson.loads(text)["trajectory"].items():
        np.testing.assert_allclose(column, subject.prediction.trajectory[name], atol=0.51e-7, rtol=0)


@pytest.mark.parametrize(
    "verdict",
    [
        DomainVerdict(True, ()),
        DomainVerdict(False, (DomainReason("mass_kg", 900.0, 300.0, 600.0), DomainReason("joint", 3.0, 0.0, 0.5)), 3.0),
    ],
    ids=["of a version without its runs", "outside"],
)
def test_so_is_a_verdict_of_another_kind(shipped, verdict):
    subject = asked(shipped, SCENARIOS[0])
    subject = replace(subject, prediction=replace(subject.prediction, domain=verdict))
    text = encode_json(subject)
    assert text == orjsons(subject, lists_of(text))


def test_a_run_may_have_any_name(shipped):
    subject = asked(shipped, SCENARIOS[0])
    verdict = subject.prediction.domain
    runs = tuple(replace(run, run='a", [%b] ü') for run in verdict.nearest_runs)
    subject = replace(subject, prediction=replace(subject.prediction, domain=replace(verdict, nearest_runs=runs)))
    assert [run["run"] for run in orjson.loads(encode_json(subject))["domain"]["nearest_runs"]] == ['a", [%b] ü'] * 3


@pytest.mark.parametrize("name", ["final_x_m", "final_y_m", "distance_m", "mean_speed_m_s", "slip_ratio"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_no_number_of_the_summary_is_none(shipped, name, value):
    subject = asked(shipped, SCENARIOS[0])
    summary = replace(subject.prediction.summary, **{name: float(value)})
    assert asdict(summary)[name] is not None
    with pytest.raises(NonFiniteError, match=name):
        encode_json(replace(subject, prediction=replace(subject.prediction, summary=summary)))
