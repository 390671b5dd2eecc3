"""What is in an FMU, and what validators say of it."""

from __future__ import annotations

import io
import json
import zipfile
from xml.etree import ElementTree

import fmpy
import pytest
from fmpy.validation import validate_fmu

from service.errors import InvalidValueError
from service.fmu import Fmi, FmuCache, fmu_bytes, tag_of
from service.fmu.variables import VARIABLES
from service.twin.load import load_twin

LIBRARIES = {
    "2.0": {
        "linux64/viper_lunar.so",
        "aarch64-linux/viper_lunar.so",
        "win64/viper_lunar.dll",
        "darwin64/viper_lunar.dylib",
    },
    "3.0": {
        "x86_64-linux/viper_lunar.so",
        "aarch64-linux/viper_lunar.so",
        "x86_64-windows/viper_lunar.dll",
        "x86_64-darwin/viper_lunar.dylib",
        "aarch64-darwin/viper_lunar.dylib",
    },
}


def test_validators_find_nothing(made):
    assert validate_fmu(str(made.archive)) == []


def test_libraries_lie_where_the_standard_wants_them(made):
    with zipfile.ZipFile(made.archive) as archive:
        names = set(archive.namelist())
    assert {name.removeprefix("binaries/") for name in names if name.startswith("binaries/")} == LIBRARIES[made.fmi]
    assert names - {name for name in names if name.startswith("binaries/")} == {
        "modelDescription.xml",
        "resources/law.bin",
        "documentation/index.html",
        "documentation/manifest.json",
        "documentation/licenses/license.txt",
    }


def test_it_is_small(made):
    assert made.archive.stat().st_size < 1_000_000


def test_the_same_version_gives_the_same_bytes(made, twin):
    assert fmu_bytes(twin, Fmi(made.fmi)) == made.archive.read_bytes()


def test_the_lineage_comes_along(made, twin):
    with zipfile.ZipFile(made.archive) as archive:
        told = json.loads(archive.read("documentation/manifest.json"))
        page = archive.read("documentation/index.html").decode()
    assert told == twin.manifest.model_dump(mode="json")
    for word in (f"{twin.name}@{twin.version}", *twin.manifest.lineage.datasets, twin.manifest.lineage.code_version):
        assert word in page


def test_what_importers_ask_of_the_description(made, twin):
    described = fmpy.read_model_description(str(made.archive))
    assert described.fmiVersion == made.fmi
    assert described.modelName == f"{twin.name}@{twin.version}"
    simulation = described.coSimulation
    assert simulation.canHandleVariableCommunicationStepSize
    assert simulation.canGetAndSetFMUstate
    assert simulation.canSerializeFMUstate
    assert not simulation.canBeInstantiatedOnlyOncePerProcess
    assert not simulation.providesDirectionalDerivative
    units = {unit.name for unit in described.unitDefinitions}
    for variable, declared in zip(described.modelVariables, VARIABLES, strict=True):
        assert (variable.name, variable.causality) == (declared.name, declared.role)
        assert variable.unit is None or variable.unit in units
        assert (variable.start is None) == (declared.start is None)
    assert all(unknown.dependencies == [] for unknown in described.outputs)


def test_tokens_differ_by_version_of_the_standard(twin):
    def token(fmi):
        with zipfile.ZipFile(io.BytesIO(fmu_bytes(twin, fmi))) as archive:
            root = ElementTree.fromstring(archive.read("modelDescription.xml"))
        return root.get("guid") or root.get("instantiationToken")

    assert token(Fmi.TWO) != token(Fmi.THREE)


def test_only_versions_that_can_be_stepped(store):
    with pytest.raises(InvalidValueError, match=r"viper-lunar-paper@1.*drive model"):
        fmu_bytes(load_twin(store, "viper-lunar-paper", 1), Fmi.TWO)


def test_the_cache_makes_each_once_and_keeps_few():
    asked = []

    def make():
        asked.append(1)
        return b"fmu"

    cache = FmuCache(kept=2)
    assert [cache.get(tag, make) for tag in "aabab"] == [b"fmu"] * 5
    assert len(asked) == 2
    cache.get("c", make)
    assert cache.known("a") is None
    assert cache.known("b") == b"fmu"


def test_tags_tell_versions_and_standards_apart(store):
    manifests = [store.manifest("viper-lunar", version) for version in store.versions("viper-lunar")]
    tags = {tag_of(manifest, fmi) for manifest in manifests for fmi in Fmi}
    assert len(tags) == 2 * len(manifests)
