"""Spin and pitch that belong to another unit, sign or wheel are refused; those of every shipped run are not."""

from __future__ import annotations

import numpy as np
import pytest

from model_store import ModelStore
from service.datasets import read_parquet
from service.datasets.checks import wheels
from service.datasets.checks.candidate import Candidate
from service.datasets.run_table import RunEntry
from service.training.stored_dataset import RUNS_FILE


def candidates():
    store = ModelStore.open("model_store", create=False)
    for identity in store.dataset_ids():
        dataset = read_parquet(store.read_dataset_file(identity, RUNS_FILE))
        for run in dataset.runs:
            entry = RunEntry(run.name, run.set_name, run.slope_deg, run.mass_kg, run.torque_nm, run.horizon_s, None, 1)
            yield Candidate(entry, dict(run.columns), np.arange(len(run)), dataset.passport)


@pytest.fixture(scope="module")
def shipped():
    return list(candidates())


def found(run, **changed):
    other = Candidate(run.entry, {**run.columns, **changed}, run.lines, run.passport)
    return [*wheels.spin(other), *wheels.pitch(other)]


def test_nothing_is_said_of_shipped_runs(shipped):
    assert len(shipped) > 150
    assert [finding for run in shipped for finding in found(run)] == []


@pytest.mark.parametrize("name", wheels.SPINS)
@pytest.mark.parametrize("factor", [60 / (2 * np.pi), 180 / np.pi])
def test_spin_in_another_unit_is_refused(name, factor, shipped):
    driven = [run for run in shipped if name in run.columns and np.ptp(run.columns[name]) > 1.0]
    assert len(driven) > 100
    for run in driven:
        findings = found(run, **{name: run.columns[name] * factor})
        assert [(str(each.code), each.column) for each in findings] == [("units", name)], run.entry.file


@pytest.mark.parametrize("name", wheels.SPINS)
def test_spin_of_the_other_sign_is_refused_where_the_rover_goes_forward(name, shipped):
    forward = [run for run in shipped if run.columns["rear_x_m"][-1] > 0.3 and "brake" not in run.columns]
    assert len(forward) > 80
    for run in forward:
        findings = found(run, **{name: -run.columns[name]})
        assert [(str(each.code), each.column) for each in findings] == [("speed-mismatch", name)], run.entry.file


def test_pitch_in_degrees_is_refused_and_its_sign_is_not_looked_at(shipped):
    for run in shipped:
        if np.sqrt(np.mean(run.columns["pitch_rad"] ** 2)) < 0.002:
            continue
        assert found(run, pitch_rad=-run.columns["pitch_rad"]) == []
        findings = found(run, pitch_rad=np.degrees(run.columns["pitch_rad"]))
        assert [(str(each.code), each.column) for each in findings] == [("units", "pitch_rad")], run.entry.file
