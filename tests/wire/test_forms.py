"""The encoders without a server: what they refuse, what they draw, what they cost to import."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from model_store import ModelStore
from service.twin import Frame, Loaded, NonFiniteError, Scenario, sample_times
from service.twin.load import load_twin
from service.wire.forms import ENCODERS, Format, Subject
from service.wire.forms.plot import MOST_LINE_POINTS, figure_of
from service.wire.forms.usda import time_codes
from tests.twin.published import publish_banded

SCENARIO = Scenario(12, 500, 60, 4)


@pytest.fixture(scope="module")
def loaded(tmp_path_factory):
    store = ModelStore.open(tmp_path_factory.mktemp("store"))
    return Loaded(load_twin(store, "unit", publish_banded(store).version), alias=None)


def subject_of(loaded, dt_s=0.5, frame=Frame.SLOPE, band_level=None):
    times = sample_times(SCENARIO.horizon_s, dt_s)
    prediction = loaded.twin.predict(SCENARIO, times, frame, band_level, with_prior=True)
    return Subject(loaded, prediction)


@pytest.mark.parametrize("form", Format)
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_no_form_lets_a_number_through_that_is_none(loaded, form, value):
    subject = subject_of(loaded)
    spoilt = {name: values.copy() for name, values in subject.prediction.trajectory.items()}
    spoilt["x_m"][3] = value

    with pytest.raises(NonFiniteError):
        ENCODERS[form].encode(replace(subject, prediction=replace(subject.prediction, trajectory=spoilt)))


@pytest.mark.slow
@pytest.mark.parametrize("form", Format)
def test_text_is_what_can_be_read_as_text(loaded, form):
    body = ENCODERS[form].encode(subject_of(loaded))

    assert (b"\0" not in body) is ENCODERS[form].text
    if ENCODERS[form].text:
        body.decode()


@pytest.mark.parametrize("frame", Frame)
@pytest.mark.parametrize("dt_s", [4.0, 0.5, 0.001])
def test_a_plot_draws_points_of_the_columns_from_the_first_to_the_last(loaded, frame, dt_s):
    subject = subject_of(loaded, dt_s, frame, 0.9 if frame is Frame.SLOPE else None)
    columns = subject.columns()
    positions = [name for name in subject.prediction.trajectory if name != "time_s"]

    for axes, name in zip(figure_of(subject).axes, positions, strict=True):
        lines = {line.get_label(): line.get_xydata() for line in axes.get_lines()}
        assert set(lines) == {"prediction", "prior alone"}
        for label, column in (("prediction", name), ("prior alone", f"prior_{name}")):
            points = set(zip(columns["time_s"].tolist(), columns[column].tolist(), strict=True))
            drawn = list(map(tuple, lines[label].tolist()))
            assert set(drawn) <= points
            assert (drawn[0][0], drawn[-1][0]) == (0, SCENARIO.horizon_s)
            assert len(drawn) == min(len(points), MOST_LINE_POINTS)
        assert len(axes.collections) == (frame is Frame.SLOPE)  # the band


rising = st.lists(st.floats(0, 600), min_size=1, max_size=50, unique=True).map(sorted).map(np.array)
grids = st.builds(sample_times, st.floats(0.01, 60), st.sampled_from([0.05, 0.02, 0.3, 0.125, 1 / 3, 0.01, 7.0]))


@given(time_s=st.one_of(rising, grids))
def test_time_codes_over_their_rate_are_the_times_to_the_last_bit(time_s):
    rate, codes = time_codes(time_s)

    assert (codes / rate).tobytes() == time_s.tobytes()
    assert (np.diff(codes) > 0).all()


@pytest.mark.parametrize(("horizon_s", "dt_s", "rate"), [(10, 0.05, 20), (10, 0.0005, 2000), (1, 0.3, 10), (9, 3, 10)])
def test_decimal_steps_have_whole_time_codes(horizon_s, dt_s, rate):
    found, codes = time_codes(sample_times(horizon_s, dt_s))

    assert found == rate
    assert (codes == np.rint(codes)).all()


@pytest.mark.processes
def test_forms_cost_their_libraries_only_when_asked_for():
    program = """
import sys
import service.wire.forms, service.api.http.answers.delivery
heavy = {"pyarrow", "matplotlib", "zstandard", "pxr"} & set(sys.modules)
assert not heavy, heavy
"""
    subprocess.run([sys.executable, "-c", program], check=True)
