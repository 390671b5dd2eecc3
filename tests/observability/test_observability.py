"""Alert rules and dashboard ask for metrics that the service has, in a language that Prometheus reads."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.api.conftest import QUESTION
from tests.api.training import admin_client, job_store
from tests.jobs.nursery import until
from tests.test_links import anchors_of

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docker" / "observability"
RULES = FOLDER / "prometheus" / "alerts.yaml"
DASHBOARD = FOLDER / "grafana" / "rover-twin.json"
_METRIC = re.compile(r"\b((?:rover_twin|process|python)_\w+|up)\b(?!=)")
_OF_PROMETHEUS = {"up"}
_UNITS = {"reqps", "percentunit", "short", "s", "cps", "ops", "bytes"}
# what Grafana puts in place of its variables
_VARIABLES = {"$__rate_interval": "5m", "$job": "rover-twin", "$instance": ".*"}


def rules() -> list[dict[str, Any]]:
    return [rule for group in yaml.safe_load(RULES.read_text())["groups"] for rule in group["rules"]]


def dashboard() -> dict[str, Any]:
    return json.loads(DASHBOARD.read_text())


def panels() -> list[dict[str, Any]]:
    return [panel for panel in dashboard()["panels"] if panel["type"] != "row"]


def queries() -> list[str]:
    """Every query of the dashboard as Grafana would send it."""
    found = [target["expr"] for panel in panels() for target in panel["targets"]]
    for name, value in _VARIABLES.items():
        found = [query.replace(name, value) for query in found]
    return found


def promtool(*arguments: str) -> str:
    if shutil.which("promtool") is None:
        pytest.skip("promtool is not installed (Debian: package prometheus)")
    done = subprocess.run(["promtool", *arguments], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def exposed(tmp_path_factory: pytest.TempPathFactory) -> set[str]:
    """The names that /metrics of a service gives which has answered requests."""
    with admin_client(job_store(tmp_path_factory.mktemp("observed"))) as client:
        assert client.get("/v1/predictions", params=QUESTION).status_code == 200

        def scrape() -> str:
            # it waits three seconds for the jobs database, which the first one opens: on a busy machine that is slower
            text = client.get("/metrics").text
            return text if "training_jobs" in text else ""

        text = until(scrape, 60)
    names = set(re.findall(r"^# TYPE (\S+) ", text, re.MULTILINE))
    return names | {f"{name}{end}" for name in names for end in ("_bucket", "_sum", "_count")}


@pytest.mark.slow
def test_every_metric_that_is_asked_for_is_one_of_the_service(exposed):
    asked = {name for text in [*queries(), *(rule["expr"] for rule in rules())] for name in _METRIC.findall(text)}
    assert len(asked) > 15
    assert asked - exposed - _OF_PROMETHEUS == set()


def test_every_metric_of_the_service_is_on_the_dashboard():
    documented = set(re.findall(r"^\| `(rover_twin_\w+)`", (ROOT / "docs" / "metrics.md").read_text(), re.MULTILINE))
    shown = {name.removesuffix("_bucket") for query in queries() for name in _METRIC.findall(query)}
    assert documented - shown == set()


@pytest.mark.processes
def test_promtool_reads_the_rules():
    assert f"{len(rules())} rules found" in promtool("check", "rules", str(RULES))


@pytest.mark.processes
def test_the_rules_fire_when_they_should_and_only_then():
    promtool("test", "rules", str(RULES.with_name("alerts_test.yaml")))


def test_every_rule_has_a_test_in_which_it_fires():
    tests = yaml.safe_load(RULES.with_name("alerts_test.yaml").read_text())["tests"]
    fires = {each["alertname"] for test in tests for each in test["alert_rule_test"] if each.get("exp_alerts")}
    assert fires == {rule["alert"] for rule in rules()}


@pytest.mark.processes
def test_promtool_reads_every_query_of_the_dashboard(tmp_path):
    file = tmp_path / "queries.yaml"
    recorded = [{"record": f"query:{number}", "expr": query} for number, query in enumerate(queries())]
    file.write_text(yaml.safe_dump({"groups": [{"name": "queries", "rules": recorded}]}))
    promtool("check", "rules", str(file))


def test_every_runbook_is_a_section_of_the_page_and_has_its_alert():
    anchors = set(anchors_of((ROOT / "docs" / "operating.md").read_text()))
    for rule in rules():
        page, _, anchor = rule["annotations"]["runbook"].partition("#")
        assert page == "docs/operating.md"
        assert anchor in anchors
        assert anchor == rule["alert"].lower()
        assert rule["labels"]["severity"] in ("page", "ticket")


def test_every_panel_has_a_title_a_unit_and_the_chosen_datasource():
    names = {each["name"] for each in dashboard()["templating"]["list"]}
    assert names == {"datasource", "job", "instance"}
    for panel in panels():
        assert panel["title"]
        assert panel["description"]
        assert panel["fieldConfig"]["defaults"]["unit"] in _UNITS
        assert {target["datasource"]["uid"] for target in panel["targets"]} == {"${datasource}"}
        assert panel["datasource"]["uid"] == "${datasource}"
        assert all(target["legendFormat"] for target in panel["targets"])


def test_panels_have_numbers_of_their_own_and_do_not_overlap():
    everything = dashboard()["panels"]
    assert len({panel["id"] for panel in everything}) == len(everything)
    taken: set[tuple[int, int]] = set()
    for panel in everything:
        place = panel["gridPos"]
        cells = {
            (x, y)
            for x in range(place["x"], place["x"] + place["w"])
            for y in range(place["y"], place["y"] + place["h"])
        }
        assert max(x for x, _ in cells) < 24
        assert not cells & taken
        taken |= cells
