"""The datasets that ship with the repository are what they say."""

from __future__ import annotations

import numpy as np
import pytest

import model_store
from model_store import ModelStore
from service.datasets import dataset_id, read_parquet
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.training.data import load_training_data, regolith_of, rover_of
from service.training.dataset_import import RUNS_FILE

SHIPPED = ModelStore.open(next(iter(model_store.__path__)))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "runs", "rows"), [("paper", 13, 20_001), ("mass", 3, 20_001), ("space", 64, 10_001)])
def test_every_sample_is_there_and_the_id_is_its_content(name, runs, rows):
    record = SHIPPED.dataset(name)
    dataset = read_parquet(SHIPPED.read_dataset_file(record.id, RUNS_FILE))
    assert dataset_id(dataset) == record.id
    assert [len(run) for run in dataset.runs] == [rows] * runs


NEW = {"long": (10, 60_010), "stall": (12, 24_012), "threshold": (10, 20_010), "edge": (14, 28_014)}
DRIVES = {"steps": (20, 73_020), "drive": (18, 72_018), "kink": (3, 12_003)}


@pytest.mark.slow
@pytest.mark.parametrize("name", [*NEW, *DRIVES])
def test_the_later_sets_have_a_row_every_5_ms_and_the_id_is_their_content(name):
    record = SHIPPED.dataset(name)
    dataset = read_parquet(SHIPPED.read_dataset_file(record.id, RUNS_FILE))
    assert dataset_id(dataset) == record.id
    assert (len(dataset.runs), sum(map(len, dataset.runs))) == (NEW | DRIVES)[name]
    for run in dataset.runs:
        np.testing.assert_allclose(np.diff(run.time_s), 0.005, atol=1e-9)
        assert bool(run.varies) == (name in DRIVES)
    assert set(record.summary["varying_runs"]) == {run.name for run in dataset.runs if run.varies}


@pytest.mark.slow
def test_all_shipped_runs_are_one_simulation():
    runs = load_training_data(SHIPPED, ["paper", "mass", "space", *NEW, *DRIVES]).runs
    assert len(runs) == 80 + 46 + 41
    assert sum(run.varies for run in runs) == 41
    assert any(run.brakes.any() for run in runs)
    assert min(run.torques_nm.min() for run in runs) == 0.0


def test_a_number_of_the_original_output_is_kept_to_a_tenth_of_a_micrometre():
    # the last row that Chrono wrote for 28 deg: 10,1.24746444,0.222892914,...
    record = SHIPPED.dataset("paper")
    (run,) = [run for run in read_parquet(SHIPPED.read_dataset_file(record.id, RUNS_FILE)).runs if run.slope_deg == 28]
    assert (run.x_m[-1], run.y_m[-1]) == pytest.approx((1.24746444, 0.222892914), abs=5.01e-8)


@pytest.mark.slow
def test_the_parameters_in_the_code_are_those_of_the_passport():
    data = load_training_data(SHIPPED, ["paper", "mass", "space"])
    assert data.rover == VIPER
    assert data.regolith == LUNAR_REGOLITH
    assert len(data.runs) == 80
    assert all(run.mean_wheel_speed_rad_s is not None for run in data.runs)
    assert np.ptp([run.mass_kg for run in data.runs]) > 500


def test_a_bare_passport_means_the_stock_rover_on_lunar_regolith():
    passport = read_parquet(SHIPPED.read_dataset_file(SHIPPED.dataset("mass").id, RUNS_FILE)).passport
    bare = passport.model_copy(update={"soil": None, "drive": None})
    assert rover_of(bare) == VIPER
    assert regolith_of(bare) == LUNAR_REGOLITH
