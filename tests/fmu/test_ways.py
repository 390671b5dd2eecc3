"""Ways to an FMU: the route and the command give the same bytes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from service.cli.failures import ExitCode
from service.fmu import Fmi, fmu_bytes
from service.settings import Settings
from tests.api.conftest import serving
from tests.cli.conftest import call

SHIPPED = Path(Settings.model_fields["store_url"].get_default(call_default_factory=True))


@pytest.fixture(scope="module")
def running():
    with serving(SHIPPED) as found:
        yield found


@pytest.mark.slow
@pytest.mark.parametrize("fmi", list(Fmi))
def test_the_route_sends_the_archive(running, twin, fmi):
    answer = running.get(f"/v1/models/{twin.name}/versions/{twin.version}/fmu", fmi=fmi)
    assert answer.content == fmu_bytes(twin, fmi)
    assert answer.headers["content-type"] == "application/zip"
    assert answer.headers["content-disposition"] == f'attachment; filename="{twin.name}-{twin.version}.fmu"'
    assert "immutable" in answer.headers["cache-control"]


@pytest.mark.slow
def test_the_default_is_fmi_2_and_etags_save_the_way(running, twin):
    address = f"/v1/models/{twin.name}/versions/{twin.version}/fmu"
    first, other = running.get(address), running.get(address, fmi="3.0")
    assert first.content == fmu_bytes(twin, Fmi.TWO)
    assert first.headers["etag"] != other.headers["etag"]
    again = running.client.get(address, headers={"If-None-Match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "query", "status", "told"),
    [
        ("viper-lunar-paper/versions/1", {}, 422, "a version with the drive model"),
        ("viper-lunar/versions/5", {"fmi": "1.0"}, 422, "fmi"),
        ("viper-lunar/versions/5", {"fmi": "2.0", "format": "zip"}, 422, "format"),
        ("viper-lunar/versions/99", {}, 404, "no version 99"),
        ("nobody/versions/1", {}, 404, "nobody"),
    ],
)
def test_the_route_says_what_cannot_be(running, path, query, status, told):
    answer = running.get(f"/v1/models/{path}/fmu", **query)
    assert answer.status_code == status
    assert told in answer.json()["error"]


def test_the_command_writes_it(twin, tmp_path):
    output = tmp_path / "viper.fmu"
    for fmi in Fmi:
        said = call("models", "export-fmu", twin.name, "--output", output, "--fmi", fmi, "--store", SHIPPED)
        assert said.code == ExitCode.DONE, said.err
        assert output.read_bytes() == fmu_bytes(twin, fmi)
    said = call("models", "export-fmu", f"{twin.name}@{twin.version}", "--output", output, "--json")
    assert json.loads(said.out)["bytes"] == output.stat().st_size
    assert [each.name for each in tmp_path.iterdir()] == ["viper.fmu"]


def test_the_command_says_what_cannot_be(tmp_path):
    output = tmp_path / "x.fmu"
    paper = call("models", "export-fmu", "viper-lunar-paper", "--output", output)
    assert (paper.code, "drive model" in paper.error) == (ExitCode.USAGE, True)
    assert call("models", "export-fmu", "viper-lunar@99", "--output", output).code == ExitCode.NOT_FOUND
    for nowhere in (tmp_path / "no" / "x.fmu", tmp_path, tmp_path / ("x" * 300)):
        said = call("models", "export-fmu", "viper-lunar", "--output", nowhere)
        assert (said.code, said.error.startswith(f"{nowhere} ")) == (ExitCode.FAILED, True), said.error
    said = call("models", "export-fmu", "viper-lunar", "--fmi", "4", "--output", output)
    assert said.error.startswith("Invalid value for '--fmi': '4' is not one of '2.0', '3.0'.")
    assert not list(tmp_path.iterdir())
