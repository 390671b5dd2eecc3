"""Runs recorded in another way, over HTTP: the report names the field, and the field makes the same dataset."""

from __future__ import annotations

import pytest

from tests.datasets.recordings import (
    PLAIN,
    archive,
    long_table,
    plain_file,
    run_columns,
    settling,
    shipped,
    world,
)

DATASETS = "/v1/admin/datasets"
RUN = "viper_s28_m430_t60_h10"
SAID = {"frame": "world", "start": "2.0"}


def recorded(change):
    """The run in each carrier."""
    run = next(each for each in shipped().values() if each.name.endswith(RUN))
    columns = change(run, run_columns(run, PLAIN, 20))
    return [make(run, columns) for make in (plain_file, long_table, archive)]


def send(admin, sent, **fields):
    form = sent.form | {"dry_run": "true"} | fields
    return admin.client.post(DATASETS, files={"file": (sent.name, sent.data)}, data=form)


@pytest.mark.processes
def test_what_was_said_in_a_form_or_a_query_makes_the_same_dataset(service_with_token):
    admin = service_with_token
    own = recorded(lambda run, columns: columns)
    others = recorded(lambda run, columns: settling(world(columns, run.slope_deg), 2.0, drop_m=0.0))
    for sent, canonical in zip(others, own, strict=True):
        answer = send(admin, sent, **SAID)
        assert answer.status_code == 200, answer.text
        assert answer.json()["report"]["summary"] == send(admin, canonical).json()["report"]["summary"]
    refused = send(admin, others[0])
    assert refused.status_code == 422
    told = {each["code"]: each["message"] for each in refused.json()["report"]["findings"]}
    assert "--frame world" in told["frame"]
    (plain, *_) = others
    raw = admin.client.post(DATASETS, params={"filename": "run.csv", "dry_run": "true"} | plain.form | SAID,
                            content=plain.data)  # fmt: skip
    assert raw.status_code == 200, raw.text
    assert raw.json()["id"] == send(admin, plain, **SAID).json()["id"]


@pytest.mark.parametrize("field", ["frame", "reference", "start"])
def test_words_that_are_none_are_refused_with_those_that_are_allowed(service_with_token, field):
    refused = service_with_token.client.post(DATASETS, params={field: "nonsense", "filename": "a.csv"}, content=b"a")
    assert refused.status_code == 422
    (fault,) = refused.json()["errors"]
    assert fault["field"] == field
    assert fault["value"] == "nonsense"
