"""Suggested runs over HTTP: the same rows as JSON and as `runs.csv`."""

from __future__ import annotations

import csv

import pytest

from model_store import WEIGHTS, Lineage, ManifestDraft, ModelStore
from service.learning.checkpoint import describe_model, weights_bytes
from service.learning.domain import Domain
from service.learning.suggest import suggest_runs
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.wire.suggested_runs import SuggestedRunsAnswer
from tests.api.conftest import serving
from tests.learning.synthetic import synthetic_runs
from tests.twin.published import zero_model

ADDRESS = "/v1/models/known/versions/1/suggested-runs"


def domain_of(errors):
    return Domain.of_runs(synthetic_runs(), VIPER, LUNAR_REGOLITH, errors)


def publish(store, domain, **checkpoint):
    model = zero_model()
    draft = ManifestDraft(
        created_by="tests",
        checkpoint=describe_model(model) | checkpoint,
        domain=domain,
        metrics={},
        lineage=Lineage(),
    )
    return store.publish("known", {WEIGHTS: weights_bytes(model)}, draft)


@pytest.fixture(scope="module")
def knowing(tmp_path_factory):
    """A service whose model `known` lists its runs: version 1 with left-out errors, version 2 without."""
    folder = tmp_path_factory.mktemp("store")
    store = ModelStore.open(str(folder), create=True)
    publish(store, domain_of({run.name: 0.001 * (1 + run.slope_deg) for run in synthetic_runs()}).describe())
    publish(store, domain_of({}).describe())
    with serving(folder) as running:
        yield running


@pytest.mark.slow
def test_rows_are_those_of_the_batch_with_reasons(knowing):
    answer = knowing.get(ADDRESS, n=5)
    document = answer.json()
    domain = domain_of({run.name: 0.001 * (1 + run.slope_deg) for run in synthetic_runs()})
    expected = suggest_runs(domain.neighbourhood, domain.spans, 5)

    assert answer.status_code == 200, answer.text
    assert SuggestedRunsAnswer.model_validate(document).model_dump(mode="json") == document
    assert document["model"] == {"name": "known", "version": 1}
    assert [(row["slope_deg"], row["mass_kg"], row["torque_nm"]) for row in document["runs"]] == [
        (each.slope_deg, each.mass_kg, each.torque_nm) for each in expected
    ]
    for row, each in zip(document["runs"], expected, strict=True):
        assert row["reason"] == {
            "expected_error_m": each.expected_error_m,
            "distance": each.distance,
            "nearest_run": each.nearest_run,
        }
        assert row["file"] == f"runs/viper_s{each.slope_deg}_m{each.mass_kg}_t{each.torque_nm}_h4.csv.gz"
        assert (row["set"], row["horizon_s"], row["step_s"]) == ("suggested", 4.0, 0.001)


def test_csv_is_a_table_of_runs(knowing):
    document, table = knowing.get(ADDRESS).json(), knowing.get(ADDRESS, format="csv")
    rows = list(csv.DictReader(table.text.splitlines()))

    assert table.text.splitlines()[0] == "file,set,slope_deg,mass_kg,torque_nm,horizon_s,step_s"
    assert table.headers["content-type"].startswith("text/csv")
    assert table.headers["rover-twin-model"] == "known@1"
    assert len(rows) == 8
    assert rows == [{k: str(v) for k, v in row.items() if k != "reason"} for row in document["runs"]]


def test_without_left_out_errors_it_fills_gaps(knowing):
    document = knowing.get("/v1/models/known/versions/2/suggested-runs", n=3).json()

    assert [row["reason"]["expected_error_m"] for row in document["runs"]] == [None] * 3


def test_a_version_that_lists_no_runs_says_what_is_missing(service):
    answer = service.get("/v1/models/viper-lunar/versions/1/suggested-runs")
    (fault,) = answer.json()["errors"]

    assert answer.status_code == 422
    assert (fault["field"], fault["value"]) == ("version", "viper-lunar@1")
    assert "training runs" in fault["allowed"]


@pytest.mark.parametrize("n", ["0", "65", "-1", "2.5", "08", "", "many", "1" * 5000])
def test_counts_that_are_not_allowed(knowing, n):
    answer = knowing.get(ADDRESS, n=n)

    assert answer.status_code == 422
    (fault,) = answer.json()["errors"]
    assert (fault["field"], fault["allowed"]) == ("n", "a whole number from 1 to 64")


def test_what_is_not_there_is_not_found(knowing):
    for path, kind in (
        ("/v1/models/absent/versions/1/suggested-runs", "model-not-found"),
        ("/v1/models/No!/versions/1/suggested-runs", "model-not-found"),
        ("/v1/models/known/versions/9/suggested-runs", "version-not-found"),
    ):
        answer = knowing.get(path)
        assert answer.status_code == 404
        assert answer.json()["type"].endswith(kind)


@pytest.mark.slow
@pytest.mark.parametrize("damage", [{"runs": [{"run": "a"}]}, {"slope_deg": [3.0, 1.0]}, {"mass_kg": None}])
def test_a_manifest_that_does_not_fit_is_a_damaged_artefact(serve, store, damage):
    publish(store, domain_of({}).describe() | damage)
    answer = serve().get(ADDRESS)

    assert answer.status_code == 503
    assert answer.json()["type"].endswith("artefact-corrupt")


def test_a_form_that_nobody_has_is_not_acceptable(knowing):
    assert knowing.client.get(ADDRESS, headers={"accept": "image/png"}).status_code == 406
    assert knowing.client.get(ADDRESS, headers={"accept": "text/csv"}).text.startswith("file,set,")
