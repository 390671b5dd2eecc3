"""What is easily forgotten when a form or a field is added: lists in tests and options, a batch, the entity tag."""

from __future__ import annotations

from typing import Any, get_args

import pytest

from service.cli.commands.predict import FormatName
from service.wire.batch import BatchBody
from service.wire.forms import ENCODERS, Format
from service.wire.prediction import PredictionInputs
from tests.api.conftest import QUESTION
from tests.api.http.test_delivery import OTHER_FORMS, TEXT_FORMS
from tests.api.readings import DATA_FORMS
from tests.api.v1.test_formats import MEDIA_TYPES

PICTURES = ("svg", "png", "html")
# another value of each field, and what else must be asked for so that it matters
CHANGES: dict[str, dict[str, Any]] = {
    "slope_deg": {"slope_deg": 27},
    "mass_kg": {"mass_kg": 431},
    "torque_nm": {"torque_nm": 61},
    "horizon_s": {"horizon_s": 9},
    "dt_s": {"dt_s": 0.5},
    "times_s": {"times_s": [0.0, 3.0, 10.0]},
    "frame": {"frame": "world"},
    "include": {"include": ["prior"]},
    "band_level": {"band_level": 0.5, "include": ["band"]},
    "strict": {"strict": True, "slope_deg": 45},
    "model": {"model": "viper-lunar@2"},
}
SHARED = [name for name in CHANGES if name in BatchBody.model_fields]


def test_every_form_is_an_option_and_is_read_back_or_looked_at():
    forms = [form.value for form in Format]
    assert get_args(FormatName) == ("table", *forms)
    assert sorted([*DATA_FORMS, *PICTURES]) == sorted([*TEXT_FORMS, *OTHER_FORMS]) == sorted(forms)
    assert {form.value: encoder.media_type for form, encoder in ENCODERS.items()} == MEDIA_TYPES


def test_every_field_has_another_value_here():
    assert set(CHANGES) == set(PredictionInputs.model_fields)


@pytest.mark.parametrize("field", [name for name in CHANGES if name != "model"])
def test_every_field_changes_what_the_entity_tag_is_made_of(field):
    usual = {name: value for name, value in CHANGES[field].items() if name != field}
    one, other = (PredictionInputs.model_validate(QUESTION | asked) for asked in (usual, CHANGES[field]))

    assert one.question() != other.question()


@pytest.mark.parametrize("field", CHANGES)
def test_a_batch_of_one_answers_as_the_single_route_does(banded, field):
    asked = QUESTION | CHANGES[field]
    shared = {name: value for name, value in asked.items() if name in SHARED}
    scenario = {name: value for name, value in asked.items() if name not in SHARED}
    one = banded.client.post("/v1/predictions", json=asked).json()
    many = banded.client.post("/v1/predictions/batch", json={"scenarios": [scenario], **shared}).json()
    usual = banded.client.post("/v1/predictions", json=QUESTION).json()

    assert one != usual
    if "trajectory" not in one:
        assert [each["type"] for each in many["errors"]] == [one["type"]]
        return
    for part in ("trajectory", "prior", "band"):
        for name, values in (one.get(part) or {}).items():
            if name in ("name", "level"):
                continue
            found = many[part][name]
            assert (found[0] if isinstance(found[0], list) else found) == pytest.approx(values, abs=1e-9), (part, name)
    assert many["model"] == one["model"]
    assert many["frame"] == one["frame"]
