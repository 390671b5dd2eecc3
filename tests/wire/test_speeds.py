"""How forms of one and of many predictions write wheel speeds: of a model that knows them."""

from __future__ import annotations

import io

import numpy as np
import pyarrow as pa
import pytest

from model_store import ModelStore
from service.twin import SPEED_NAMES, Frame, Loaded, Scenario, sample_times
from service.twin.load import load_twin
from service.wire.batch_answer import BatchAnswer
from service.wire.batch_forms import BATCH_ENCODERS, BatchFormat, BatchSubject
from service.wire.forms import ENCODERS, Format, Subject
from service.wire.prediction_answer import PredictionAnswer
from tests.api.readings import DATA_FORMS, about_in, columns_in
from tests.digits import TEXT_FORMS, in_text
from tests.twin.published import publish
from tests.twin.rolling import rolling

SCENARIO, TIMES = Scenario(3, 430, 60, 4), sample_times(4, 0.5)


@pytest.fixture(scope="module")
def loaded() -> Loaded:
    store = ModelStore.open("memory://")
    return Loaded(rolling(load_twin(store, "unit", publish(store).version)), alias=None)


@pytest.mark.parametrize("form", DATA_FORMS)
@pytest.mark.parametrize("frame", Frame)
def test_every_data_form_has_the_wheels(loaded, form, frame):
    prediction = loaded.twin.predict(SCENARIO, TIMES, frame, with_speed=True, with_wheel_speed=True)
    body = ENCODERS[Format(form)].encode(Subject(loaded, prediction))
    columns = columns_in(form, body)
    expected = in_text(prediction.trajectory) if form in TEXT_FORMS else prediction.trajectory

    for name in SPEED_NAMES:
        np.testing.assert_array_equal(columns[name], expected[name])
    if form == "json":
        PredictionAnswer.model_validate_json(body)
    if form in ("npz", "arrow", "parquet", "usda"):
        units = about_in(form, body)["units"]
        assert [units[name] for name in ("time_s", "x_m", *SPEED_NAMES)] == ["s", "m", "m/s", "rad/s", "rad/s"]


@pytest.mark.parametrize("asked", [(), ("speed",), ("wheel_speed",), ("speed", "wheel_speed")])
def test_every_form_of_a_batch_has_what_was_asked_for(loaded, asked):
    wanted = {f"with_{part}": part in asked for part in ("speed", "wheel_speed")}
    batch = loaded.twin.predict_many([SCENARIO] * 2, TIMES, **wanted)
    for some, rows in ((batch, np.arange(2)), (None, np.arange(0))):
        subject = BatchSubject(loaded, Frame.SLOPE, some, rows, [], with_prior=False, with_band=False, **wanted)
        document = BATCH_ENCODERS[BatchFormat.JSON].encode(subject)
        BatchAnswer.model_validate_json(document)
        with np.load(io.BytesIO(BATCH_ENCODERS[BatchFormat.NPZ].encode(subject))) as archive:
            names = [name for name in archive.files if name in SPEED_NAMES]
        table = pa.ipc.open_stream(BATCH_ENCODERS[BatchFormat.ARROW].encode(subject)).read_all()

        assert names == list(subject.speeds)
        assert set(names) == {
            name
            for name in SPEED_NAMES
            if ("wheel" in name and "wheel_speed" in asked) or (name == "speed_m_s" and "speed" in asked)
        }
        assert table.column_names == ["scenario", "time_s", "x_m", "y_m", *names]
