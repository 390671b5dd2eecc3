"""One fit for all tests: the paper's thirteen slopes, as shipped, every tenth sample. `--engine` tries another one."""

from __future__ import annotations

from pathlib import Path

import pytest

import model_store
from model_store import ModelStore
from service.learning.observed import ObservedRun
from service.learning.resistance import library as library_module
from service.learning.resistance.fit import FittedProcess, fit_resistance_process
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.priors import make_prior
from service.training.data import load_training_data


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--engine", help="a compiled engine to try instead of the installed one, see `make sanitize`")


def pytest_configure(config: pytest.Config) -> None:
    if engine := config.getoption("--engine", None):
        library_module.PATH = Path(engine)


SHIPPED = str(Path(model_store.__file__).parent)


@pytest.fixture(scope="session")
def paper_runs() -> list[ObservedRun]:
    """430 kg and 60 N m per wheel on 20..32 degrees; one sample each 5 ms."""
    data = load_training_data(ModelStore.open(SHIPPED), ["paper"])
    return [run.samples(slice(None, None, 10)) for run in data.runs]


@pytest.fixture(scope="session")
def fitted(paper_runs: list[ObservedRun]) -> FittedProcess:
    """The process of all of them, with what it predicts of each without it."""
    return fit_resistance_process(paper_runs, VIPER, LUNAR_REGOLITH, make_prior("motor_slope", 0.2))
