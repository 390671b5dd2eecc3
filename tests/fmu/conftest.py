"""The shipped champion as an FMU of both versions of the standard. `--fmu-library` tries another library of ours."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

import fmpy
import pytest

from model_store import ModelStore
from service.fmu import Fmi, fmu_bytes
from service.settings import Settings
from service.twin import Twin
from service.twin.load import load_twin


@dataclass(frozen=True)
class Made:
    """An exported FMU, and where it lies unpacked: in a folder whose name has blanks and letters that are not ASCII."""

    fmi: str
    archive: Path
    folder: Path


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--fmu-library", help="another library than the installed one, see `make sanitize`")


@pytest.fixture(scope="session")
def store() -> ModelStore:
    return ModelStore.open(Settings.model_fields["store_url"].get_default(call_default_factory=True))


@pytest.fixture(scope="session")
def twin(store) -> Twin:
    resolved = store.resolve("viper-lunar")
    return load_twin(store, resolved.name, resolved.version)


@pytest.fixture(scope="session")
def engine(twin):
    return twin.model.engine


@pytest.fixture(scope="session", params=list(Fmi), ids=["fmi2", "fmi3"])
def made(request, twin, tmp_path_factory) -> Made:
    root = tmp_path_factory.mktemp("fmu")
    archive, folder = root / "viper.fmu", root / "Mond & Größe 月 100% #1"
    archive.write_bytes(fmu_bytes(twin, request.param))
    fmpy.extract(str(archive), unzipdir=str(folder))
    if library := request.config.getoption("--fmu-library", None):
        place = "linux64" if request.param == "2.0" else "x86_64-linux"
        shutil.copy(library, folder / "binaries" / place / "viper_lunar.so")
    return Made(request.param, archive, folder)
