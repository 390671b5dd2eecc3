"""Lines of a batch without a server: each is, to the byte, what the single route writes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from model_store import ModelStore
from service.settings import load_settings
from service.twin import Frame, Loaded, NonFiniteError, Scenario, sample_grid
from service.twin.drives import require_driver
from service.twin.load import load_twin
from service.wire.batch_forms import BatchSubject
from service.wire.batch_forms.ndjson import batch_lines
from service.wire.drives.ask import driven
from service.wire.drives.batch import read_drives
from service.wire.drives.batch_subject import DriveBatchSubject
from service.wire.forms.json import encode_json
from tests.twin.published import publish_banded

INSIDE = Scenario(20, 430, 60, 4)
OUTSIDE = Scenario(-45, 9_000, 250, 3)
ODD = Scenario(12, 500, 0, 0.55)


@pytest.fixture(scope="module")
def loaded(tmp_path_factory):
    store = ModelStore.open(tmp_path_factory.mktemp("store"))
    return Loaded(load_twin(store, "unit", publish_banded(store).version), alias=None)


@pytest.fixture(scope="module")
def shipped():
    store = ModelStore.open(load_settings().store_url)
    found = store.resolve("viper-lunar")
    return Loaded(load_twin(store, found.name, found.version), found.alias)


def batch_of(loaded, scenarios, *, frame=Frame.SLOPE, indices=None, failures=(), everything=True, dt_s=0.25):
    grid = sample_grid([each.horizon_s for each in scenarios], dt_s)
    banded = everything and frame is Frame.SLOPE
    batch = loaded.twin.predict_many(scenarios, grid, frame, 0.9 if banded else None, with_prior=everything)
    places = np.arange(len(scenarios)) if indices is None else np.array(indices)
    return BatchSubject(loaded, frame, batch, places, failures, with_prior=everything, with_band=banded)


def lines_in(subject):
    return b"".join(batch_lines(subject)).splitlines()


def line_of(index, one):
    return b'{"index":%d,' % index + encode_json(one)[1:]


@pytest.mark.parametrize("frame", Frame)
@pytest.mark.parametrize("everything", [False, True])
@pytest.mark.parametrize("scenarios", [[INSIDE], [INSIDE, OUTSIDE] * 30, [INSIDE, ODD, OUTSIDE]])
@pytest.mark.parametrize("model", ["loaded", "shipped"])
def test_each_line_is_the_single_answer(request, model, scenarios, everything, frame):
    subject = batch_of(request.getfixturevalue(model), scenarios, frame=frame, everything=everything)

    assert lines_in(subject) == [line_of(row, subject.one(row)) for row in range(len(scenarios))]


def test_lines_of_drives_are_the_single_answers(shipped):
    track = {"distance_m": [0, 3, 6], "slope_deg": [10, 22, 18]}
    asked = [{"mass_kg": mass, "track": track, "controls": 60, "horizon_s": mass / 50} for mass in (300, 430)]
    question = read_drives({"drives": asked, "include": ["band"]}, 10_000)
    require_driver(shipped.twin, question.wanted)
    drives = [driven(each, question.wanted, False, shipped, lambda *_: None).drive for each in question.drives.values()]
    subject = DriveBatchSubject(shipped, question.wanted.frame, drives, np.arange(2), (), question.wanted.band_level)

    assert lines_in(subject) == [line_of(row, subject.one(row)) for row in range(2)]


def test_problems_stand_in_the_order_sent(loaded):
    failures = [{"index": index, "detail": "no\nnumber"} for index in (7, 0, 3, 9)]
    subject = batch_of(loaded, [INSIDE] * 4, indices=[1, 2, 4, 8], failures=failures, dt_s=0.0001)
    lines = lines_in(subject)

    assert [line[: line.index(b",")] for line in lines] == [b'{"index":%d' % at for at in (0, 1, 2, 3, 4, 7, 8, 9)]
    assert lines[2] == line_of(2, subject.one(1))


def test_nothing_but_problems(loaded):
    subject = BatchSubject(loaded, Frame.SLOPE, None, np.arange(0), [{"index": 0}], with_prior=True, with_band=True)

    assert lines_in(subject) == [b'{"index":0}']


def test_numbers_too_large_have_all_digits_and_others_keep_theirs(loaded):
    subject = batch_of(loaded, [INSIDE] * 3, everything=False)
    x = subject.batch.trajectory["x_m"].copy()
    x[1, 2] = 1e300
    spoilt = replace(subject, batch=replace(subject.batch, trajectory={**subject.batch.trajectory, "x_m": x}))

    assert lines_in(spoilt) == [line_of(row, spoilt.one(row)) for row in range(3)]


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_no_line_lets_a_number_through_that_is_none(loaded, value):
    subject = batch_of(loaded, [INSIDE] * 3, everything=False)
    x = subject.batch.trajectory["x_m"].copy()
    x[1, 2] = value
    spoilt = replace(subject, batch=replace(subject.batch, trajectory={**subject.batch.trajectory, "x_m": x}))

    with pytest.raises(NonFiniteError):
        lines_in(spoilt)
