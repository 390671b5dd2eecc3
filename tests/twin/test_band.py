"""Predictions with a band, and what a version with a damaged one does."""

from __future__ import annotations

import numpy as np
import pytest
import safetensors.numpy
from hypothesis import given
from hypothesis import strategies as st

from model_store import WEIGHTS, ModelStore
from service.errors import CheckpointError, InvalidValueError
from service.learning.band import BAND_FILE
from service.learning.checkpoint import weights_bytes
from service.settings import Settings
from service.twin import Frame, NonFiniteError, Scenario, Twin, sample_times
from service.twin.load import load_twin
from tests.learning.left_out import domain_of, synthetic_band
from tests.learning.synthetic import synthetic_runs
from tests.twin.published import draft, publish, publish_banded, zero_model

scenarios = st.builds(Scenario, st.floats(-45, 45), st.floats(50, 2000), st.floats(0, 300), st.floats(0.1, 30))


@pytest.fixture(scope="module")
def twin(tmp_path_factory: pytest.TempPathFactory) -> Twin:
    store = ModelStore.open(tmp_path_factory.mktemp("store"))
    return load_twin(store, "unit", publish_banded(store).version)


@pytest.mark.slow
@given(scenario=scenarios, level=st.floats(0.5, 0.99))
def test_the_band_holds_the_trajectory_and_opens_with_time(twin, scenario, level):
    prediction = twin.predict(scenario, sample_times(scenario.horizon_s, 0.5), band_level=level)

    band = prediction.band
    assert band.level == level
    for name in ("x", "y"):
        centre = prediction.trajectory[f"{name}_m"]
        lower, upper = getattr(band, f"{name}_lower_m"), getattr(band, f"{name}_upper_m")
        assert lower.shape == upper.shape == centre.shape
        assert (lower <= centre).all()
        assert (centre <= upper).all()
        np.testing.assert_allclose(upper - centre, centre - lower, atol=1e-9 * (1 + np.abs(upper).max()))
        assert (np.diff(upper - lower) >= -1e-9 * (1 + np.abs(upper).max())).all()


@pytest.mark.slow
@given(scenario=scenarios)
def test_asking_for_a_band_changes_nothing_else(twin, scenario):
    times = sample_times(scenario.horizon_s, 0.5)
    plain, banded = twin.predict(scenario, times), twin.predict(scenario, times, band_level=0.9)

    assert plain.band is None
    assert plain.summary == banded.summary
    assert plain.domain == banded.domain
    np.testing.assert_array_equal(plain.trajectory["x_m"], banded.trajectory["x_m"])


def test_the_band_does_not_depend_on_the_sampling_or_the_horizon(twin):
    long = twin.predict(Scenario(12, 500, 60, 8), sample_times(8, 0.1), band_level=0.9).band
    short = twin.predict(Scenario(12, 500, 60, 4), sample_times(4, 0.5), band_level=0.9).band

    np.testing.assert_allclose(long.x_upper_m[:41:5], short.x_upper_m)


def test_a_band_in_the_world_frame_is_refused(twin):
    with pytest.raises(InvalidValueError, match="frame is 'world', allowed is slope where a band is asked for"):
        twin.predict(Scenario(12, 500, 60, 4), sample_times(4, 1), Frame.WORLD, band_level=0.9)


def test_a_version_without_a_band_says_so(store):
    bare = load_twin(store, "unit", publish(store).version)

    assert bare.band is None
    with pytest.raises(
        InvalidValueError, match="include is 'band', allowed is prior or speed; unit@1 was published without a"
    ):
        bare.predict(Scenario(12, 500, 60, 4), sample_times(4, 1), band_level=0.9)


def test_a_band_that_is_not_finite_is_never_answered(twin):
    with pytest.raises(NonFiniteError, match="unit@1 has no finite answer"):
        twin.predict(Scenario(10, 430, 60, 1e308), np.array([0.0, 1e308]), band_level=0.99)


def _publish_damaged(store: ModelStore, *, content: bytes | None, **description: object) -> int:
    band = synthetic_band()
    files = {WEIGHTS: weights_bytes(zero_model())} | ({} if content is None else {BAND_FILE: content})
    described = {"domain": domain_of(synthetic_runs()).describe(), "band": band.describe() | description}
    return store.publish("unit", files, draft(zero_model()).model_copy(update=described)).version


def _with_nan() -> bytes:
    tensors = synthetic_band().tensors()
    tensors["places"][0, 0] = np.nan
    return safetensors.numpy.save(tensors)


WHOLE = safetensors.numpy.save(synthetic_band().tensors())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("content", "description", "reason"),
    [
        (None, {}, "the version has no report/band.safetensors"),
        (b"", {}, "cannot be read"),
        (WHOLE[:-1], {}, "cannot be read"),
        (_with_nan(), {}, "places is float64"),
        (WHOLE, {"levels": []}, "levels are"),
        (WHOLE, {"spacing": -1}, "must be finite"),
    ],
    ids=["absent", "empty", "truncated", "nan", "levels", "spacing"],
)
def test_a_damaged_band_is_a_checkpoint_error_that_names_the_version(store, content, description, reason):
    version = _publish_damaged(store, content=content, **description)

    with pytest.raises(CheckpointError, match=rf"unit@1: .*{reason}"):
        load_twin(store, "unit", version)


def test_the_shipped_first_version_has_no_band_and_knows_no_runs():
    twin = load_twin(ModelStore.open(Settings().store_url), "viper-lunar", 1)
    verdict = twin.predict(Scenario(28, 430, 60, 10), sample_times(10, 1)).domain

    assert twin.band is None
    assert verdict.inside
    assert verdict.distance is None
    assert verdict.nearest_runs == ()
