"""What compose starts: targets that exist, settings that exist, and no rights that are not needed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from service.settings import PREFIX, Settings

DOCKER = Path(__file__).parents[2] / "docker"
TEXT = (DOCKER / "compose.yaml").read_text(encoding="utf-8")
COMMENTED = re.compile(r"^( *)# (?=ROVER_TWIN_TOKENS_FILE:|secrets:|  tokens:|    file:)", re.MULTILINE)
WITH_TOKENS = re.sub(r"^ *ROVER_TWIN_ADMIN_TOKEN:.*\n", "", COMMENTED.sub(r"\1", TEXT), flags=re.MULTILINE)
_DEFAULT = re.compile(r"\$\{\w+:-(\w+)\}")


@pytest.fixture(params=[TEXT, WITH_TOKENS], ids=["as it is", "with a file of tokens"])
def compose(request: pytest.FixtureRequest) -> dict[str, Any]:
    """The file, and what its comments make of it."""
    document = yaml.safe_load(request.param)
    assert isinstance(document, dict)
    return document


def ours(compose: dict[str, Any]) -> Iterator[dict[str, Any]]:
    return (each for each in compose["services"].values() if "build" in each)


def test_nothing_can_write_to_its_root_or_has_rights(compose):
    for name, each in compose["services"].items():
        assert each["read_only"], name
        assert each["cap_drop"] == ["ALL"], name
        assert "no-new-privileges:true" in each["security_opt"], name


def test_every_setting_and_every_target_exists(compose):
    known = {f"{PREFIX}{name.upper()}" for name in Settings.model_fields}
    targets = re.findall(r"^FROM .* AS (\S+)$", (DOCKER / "Dockerfile").read_text(encoding="utf-8"), re.MULTILINE)
    for each in ours(compose):
        assert set(each["environment"]) <= known
        assert _DEFAULT.sub(r"\1", each["build"]["target"]) in targets


def test_volumes_and_secrets_are_declared(compose):
    for each in compose["services"].values():
        assert {volume.partition(":")[0] for volume in each["volumes"]} <= compose["volumes"].keys()
        assert set(each.get("secrets", ())) <= compose.get("secrets", {}).keys()


def test_no_secret_is_written_in_the_file():
    values = re.findall(r"^\s*\w*(?:PASSWORD|TOKEN): *(.*)$", TEXT, re.MULTILINE)
    assert values
    assert all(value.startswith("${") and ":?" in value for value in values)


def test_the_file_of_tokens_is_where_the_service_looks():
    compose = yaml.safe_load(WITH_TOKENS)
    service = compose["services"]["service"]

    assert "ROVER_TWIN_ADMIN_TOKEN" not in service["environment"]
    assert service["environment"]["ROVER_TWIN_TOKENS_FILE"] == f"/run/secrets/{service['secrets'][0]}"
    assert compose["secrets"] == {"tokens": {"file": "./tokens"}}


def test_a_stop_outlasts_the_drain(compose):
    longest_s = Settings.model_fields["drain_s"].default + Settings.model_fields["shutdown_grace_s"].default
    assert all(int(each["stop_grace_period"].rstrip("s")) > longest_s for each in ours(compose))
