"""What `kubectl apply --kustomize` sends is valid by the schemas; its numbers fit each other and our settings."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

from service.jobs import worker
from service.settings import PREFIX, Settings

pytestmark = pytest.mark.processes

MANIFESTS = Path(__file__).parents[2] / "docker" / "kubernetes"
PLACES = ("base", "overlays/example")
VERSIONS = ("1.29", "1.32", "1.37")
_SECRETS = ("ADMIN_TOKEN", "JOBS_DATABASE_URL")
_KNOWN = {name.upper() for name in Settings.model_fields} | {f"{name}_FILE" for name in _SECRETS}
_OF_OPERATOR = "monitoring.coreos.com/"  # its schema is not Kubernetes' own
_PARTING_S = 5  # app.py: live connections hand back what they keep
_LAST_PIECE_S = 20  # worker.py: the piece of the fit that runs


@pytest.fixture(scope="module", params=PLACES)
def rendered(request: pytest.FixtureRequest) -> list[dict[str, Any]]:
    """The objects of the base, and of the example."""
    if shutil.which("kubectl") is None:
        pytest.skip("kubectl, which has kustomize in it, is not installed")
    command = ["kubectl", "kustomize", str(MANIFESTS / request.param)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    return list(yaml.safe_load_all(done.stdout))


def one(rendered: list[dict[str, Any]], kind: str, name: str) -> dict[str, Any]:
    (found,) = [each for each in rendered if each["kind"] == kind and each["metadata"]["name"] == name]
    return found


def pods(rendered: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """The pod of each deployment, by component."""
    found = [each["spec"]["template"] for each in rendered if each["kind"] == "Deployment"]
    return {pod["metadata"]["labels"]["app.kubernetes.io/component"]: pod["spec"] for pod in found}


def settings_of(rendered: list[dict[str, Any]], component: str) -> dict[str, str]:
    """The environment of a container, without what secrets give."""
    (container,) = pods(rendered)[component]["containers"]
    maps = {each["metadata"]["name"]: each["data"] for each in rendered if each["kind"] == "ConfigMap"}
    given: dict[str, str] = {}
    for source in container["envFrom"]:
        if "configMapRef" in source:
            given |= maps[source["configMapRef"]["name"]]
    return given | {each["name"]: each["value"] for each in container.get("env", ())}


@pytest.mark.parametrize("version", VERSIONS)
def test_every_object_is_valid_by_the_strict_schema(rendered, version):
    schemas = pytest.importorskip("kubernetes_validate", reason="the schemas are not installed")
    for each in rendered:
        if not each["apiVersion"].startswith(_OF_OPERATOR):
            schemas.validate(each, version, strict=True)


def test_the_schema_refuses_a_misspelt_field(rendered):
    schemas = pytest.importorskip("kubernetes_validate", reason="the schemas are not installed")
    broken = one(rendered, "Deployment", "rover-twin-api")
    broken = broken | {"spec": broken["spec"] | {"replica": 2}}
    with pytest.raises(schemas.ValidationError):
        schemas.validate(broken, VERSIONS[-1], strict=True)


@pytest.mark.parametrize("component", ["api", "worker"])
def test_every_variable_is_a_setting_and_its_value_is_allowed(rendered, component):
    given = {name: value for name, value in settings_of(rendered, component).items() if name.startswith(PREFIX)}
    names = {name.removeprefix(PREFIX) for name in given}
    assert names <= _KNOWN
    plain = {name.removeprefix(PREFIX).lower(): value for name, value in given.items() if not name.endswith("_FILE")}
    Settings.model_validate(plain)


def test_draining_outlasts_the_readiness_probe_and_the_pod_outlasts_draining(rendered):
    pod = pods(rendered)["api"]
    given = settings_of(rendered, "api")
    drain, grace = float(given["ROVER_TWIN_DRAIN_S"]), float(given["ROVER_TWIN_SHUTDOWN_GRACE_S"])
    probe = pod["containers"][0]["readinessProbe"]
    assert drain > probe["periodSeconds"] * probe["failureThreshold"]
    assert pod["terminationGracePeriodSeconds"] > drain + grace + _PARTING_S
    assert probe["timeoutSeconds"] > 3  # the service itself gives up after 3 s, and says why
    assert probe["timeoutSeconds"] <= probe["periodSeconds"]


def test_a_worker_has_time_to_hand_its_job_back(rendered):
    assert pods(rendered)["worker"]["terminationGracePeriodSeconds"] > worker._HAND_BACK_S + _LAST_PIECE_S


def test_probes_ask_addresses_of_the_service(rendered):
    from service.app import openapi_document

    known = openapi_document()["paths"]
    (container,) = pods(rendered)["api"]["containers"]
    ports = {port["name"]: port["containerPort"] for port in container["ports"]}
    for probe in ("startupProbe", "livenessProbe", "readinessProbe"):
        asked = container[probe]["httpGet"]
        assert asked["path"] in known
        assert ports[asked["port"]] == Settings.model_fields["port"].default
    # a store that is down must not have the pod restarted
    assert container["livenessProbe"]["httpGet"]["path"] == container["startupProbe"]["httpGet"]["path"]
    assert container["livenessProbe"]["httpGet"]["path"] == "/health/live"


def test_selectors_find_exactly_what_they_are_for(rendered):
    """kustomize writes its labels into selectors, also into those that are about others."""
    labels = {
        each["metadata"]["name"]: each["spec"]["template"]["metadata"]["labels"]
        for each in rendered
        if each["kind"] == "Deployment"
    }

    def found(selector: dict[str, str]) -> set[str]:
        return {name for name, has in labels.items() if selector.items() <= has.items()}

    api = {"rover-twin-api"}
    assert found(one(rendered, "Service", "rover-twin")["spec"]["selector"]) == api
    assert found(one(rendered, "PodDisruptionBudget", "rover-twin-api")["spec"]["selector"]["matchLabels"]) == api
    assert found(one(rendered, "NetworkPolicy", "rover-twin-api")["spec"]["podSelector"]["matchLabels"]) == api
    everyone = one(rendered, "NetworkPolicy", "rover-twin")["spec"]
    assert found(everyone["podSelector"]["matchLabels"]) == set(labels)
    for rule in everyone["egress"]:
        assert all("podSelector" not in peer for peer in rule.get("to", ()))


def test_the_network_is_closed_but_for_what_is_needed(rendered):
    everyone = one(rendered, "NetworkPolicy", "rover-twin")["spec"]
    assert set(everyone["policyTypes"]) == {"Ingress", "Egress"}
    assert "ingress" not in everyone
    assert {port["port"] for rule in everyone["egress"] for port in rule["ports"]} == {53, 5432, 443}
    (rule,) = one(rendered, "NetworkPolicy", "rover-twin-api")["spec"]["ingress"]
    assert [port["port"] for port in rule["ports"]] == ["http"]


@pytest.mark.parametrize("component", ["api", "worker"])
def test_pods_have_no_rights(rendered, component):
    pod = pods(rendered)[component]
    account = one(rendered, "ServiceAccount", pod["serviceAccountName"])
    assert account["automountServiceAccountToken"] is pod["automountServiceAccountToken"] is False
    assert pod["enableServiceLinks"] is False  # they would set ROVER_TWIN_PORT
    assert pod["securityContext"]["runAsNonRoot"]
    assert pod["securityContext"]["seccompProfile"] == {"type": "RuntimeDefault"}
    assert not {"hostNetwork", "hostPID", "hostIPC"} & pod.keys()
    (container,) = pod["containers"]
    assert container["securityContext"] == {
        "allowPrivilegeEscalation": False,
        "readOnlyRootFilesystem": True,
        "capabilities": {"drop": ["ALL"]},
    }
    assert {"requests", "limits"} <= container["resources"].keys()


def test_the_user_is_the_one_of_the_image(rendered):
    (user,) = re.findall(r"^USER (\S+)$", (MANIFESTS.parent / "Dockerfile").read_text(), re.MULTILINE)
    for pod in pods(rendered).values():
        asked = pod["securityContext"]
        assert f"{asked['runAsUser']}:{asked['runAsGroup']}" == user


def test_secrets_are_named_and_never_written_down(rendered):
    assert not [each for each in rendered if each["kind"] == "Secret"]
    for component, pod in pods(rendered).items():
        (mounted,) = [each for each in pod["volumes"] if "secret" in each]
        keys = {item["key"] for item in mounted["secret"].get("items", ())}
        assert (keys == {"jobs-database-url"}) == (component == "worker")
        (place,) = [each for each in pod["containers"][0]["volumeMounts"] if each["name"] == mounted["name"]]
        for name, value in settings_of(rendered, component).items():
            assert not any(name == f"{PREFIX}{secret}" for secret in _SECRETS)
            if name.endswith("_FILE"):
                assert value.startswith(f"{place['mountPath']}/")


def test_workers_are_pods_of_their_own_and_a_pod_is_one_process(rendered):
    given = settings_of(rendered, "api")
    assert given["ROVER_TWIN_START_WORKER"] == "false"
    assert given["ROVER_TWIN_WORKERS"] == "1"
    images = {container["image"] for pod in pods(rendered).values() for container in pod["containers"]}
    assert len(images) == 1


def test_replicas_survive_a_disruption_and_a_rollout(rendered):
    api = one(rendered, "Deployment", "rover-twin-api")["spec"]
    scaler = one(rendered, "HorizontalPodAutoscaler", "rover-twin-api")["spec"]
    budget = one(rendered, "PodDisruptionBudget", "rover-twin-api")["spec"]
    assert "replicas" not in api  # they are the autoscaler's
    assert scaler["scaleTargetRef"]["name"] == "rover-twin-api"
    assert scaler["minReplicas"] > budget["maxUnavailable"]
    assert api["strategy"]["rollingUpdate"]["maxUnavailable"] == 0
