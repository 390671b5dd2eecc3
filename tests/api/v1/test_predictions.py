"""One scenario over HTTP: the same numbers by every way in and in every form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.settings import LIMITS
from service.twin.scenario import sample_count
from service.wire.points import smallest_step_s


def test_the_answer_has_the_promised_members(service):
    answer = service.predict().json()

    assert list(answer) == ["model", "scenario", "frame", "trajectory", "domain", "summary"]
    assert answer["model"] == {"name": "viper-lunar", "version": 1, "alias": "champion"}
    assert answer["scenario"] == {"slope_deg": 28, "mass_kg": 430, "torque_nm": 60, "horizon_s": 10}
    assert answer["frame"] == "slope"
    assert list(answer["trajectory"]) == ["time_s", "x_m", "y_m"]
    assert {len(column) for column in answer["trajectory"].values()} == {201}
    assert answer["domain"] == {"inside": True, "reasons": [], "distance": None, "nearest_runs": []}
    assert round(answer["summary"]["final_x_m"], 7) == answer["trajectory"]["x_m"][-1]  # which has fewer digits


def test_a_post_answers_what_a_get_answers(service, question):
    for more in ({}, {"dt_s": 0.3, "horizon_s": 1}, {"frame": "world", "strict": True, "model": "viper-lunar@2"}):
        sent = question | more
        assert (
            service.client.post("/v1/predictions", json=sent).content == service.get("/v1/predictions", **sent).content
        )


@pytest.mark.parametrize("frame", ["slope", "world"])
@pytest.mark.parametrize("include", ["", "prior"])
def test_csv_holds_the_very_numbers_of_json(service, frame, include):
    asked = {"frame": frame, "dt_s": 0.7} | ({"include": include} if include else {})
    document = service.predict(**asked).json()
    table = service.predict(format="csv", **asked)

    header, *rows = table.text.splitlines()
    columns = dict(zip(header.split(","), np.array([row.split(",") for row in rows], dtype=float).T, strict=True))
    across = "y_m" if frame == "slope" else "z_m"
    expected = dict(document["trajectory"])
    if include:
        expected |= {"prior_x_m": document["prior"]["x_m"], f"prior_{across}": document["prior"][across]}
    assert list(columns) == list(expected)
    for name, values in expected.items():
        assert columns[name].tolist() == values
    assert table.headers["content-type"].startswith("text/csv")
    assert table.headers["rover-twin-model"] == "viper-lunar@1"
    assert table.headers["rover-twin-frame"] == frame
    assert table.headers["rover-twin-domain"] == "inside"
    assert table.headers["rover-twin-outcome"] == document["summary"]["outcome"]


def test_the_horizon_is_always_the_last_time(service):
    time_s = service.predict(horizon_s=1, dt_s=0.3).json()["trajectory"]["time_s"]

    assert time_s == pytest.approx([0, 0.3, 0.6, 0.9, 1.0])
    assert time_s[-1] == 1.0


def test_outside_the_domain_is_a_verdict_or_when_strict_a_refusal(service):
    verdict = service.predict(slope_deg=-40, mass_kg=9000).json()["domain"]
    refusal = service.predict(slope_deg=-40, mass_kg=9000, strict="true")

    assert not verdict["inside"]
    assert refusal.status_code == 422
    problem = refusal.json()
    assert problem["type"] == "urn:rover-twin:problem:outside-domain"
    assert problem["domain"] == verdict
    reasons = {reason["field"] for reason in verdict["reasons"]}
    assert {"slope_deg", "mass_kg"} <= reasons
    assert {fault["field"] for fault in problem["errors"]} == reasons


@pytest.mark.slow
@pytest.mark.parametrize(
    ("accept", "kind"),
    [
        (None, "application/json"),
        ("*/*", "application/json"),
        ("application/*", "application/json"),
        ("text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8", "text/html"),  # a browser's address bar
        ("text/csv", "text/csv"),
        ("text/*", "text/csv"),
        ("application/json;q=0.5, text/csv", "text/csv"),
        ("application/json, text/csv;q=0.9", "application/json"),
        ("TEXT/CSV", "text/csv"),
        ("image/*", "image/svg+xml"),
        ("image/avif,image/webp,image/png,image/*;q=0.8", "image/png"),
        ("model/vnd.usda, */*;q=0.1", "model/vnd.usda"),
    ],
)
def test_the_accept_header_chooses_the_form(service, question, accept, kind):
    headers = {} if accept is None else {"accept": accept}
    request = service.client.build_request("GET", "/v1/predictions", params=question, headers=headers)
    if accept is None:
        del request.headers["accept"]

    answer = service.client.send(request)

    assert answer.status_code == 200
    assert answer.headers["content-type"].partition(";")[0] == kind
    assert answer.headers["vary"] == "Accept, Accept-Encoding"


@pytest.mark.parametrize("accept", ["image/webp", "application/json;q=0", "nonsense"])
def test_a_form_that_nobody_has_is_not_acceptable(service, question, accept):
    answer = service.client.get("/v1/predictions", params=question, headers={"accept": accept})

    assert answer.status_code == 406
    assert answer.headers["content-type"] == "application/problem+json"
    assert "text/csv" in answer.json()["detail"]


def test_the_format_wins_over_the_accept_header(service, question):
    answer = service.client.post(
        "/v1/predictions", params={"format": "csv"}, json=question, headers={"accept": "image/png"}
    )

    assert answer.headers["content-type"].startswith("text/csv")


def test_include_may_be_repeated_or_separated_by_commas(service, question):
    once = service.predict(include="prior").content

    assert service.client.get("/v1/predictions", params=[*question.items(), ("include", "prior")]).content == once


def test_too_many_points_are_refused_with_the_finest_step_that_is_not(service):
    refused = service.predict(horizon_s=600, dt_s=0.001)

    (fault,) = refused.json()["errors"]
    assert refused.status_code == 422
    assert fault["field"] == "dt_s"
    finest = float(fault["allowed"].split(" ")[0])
    accepted = service.predict(horizon_s=600, dt_s=finest, format="csv")
    assert accepted.status_code == 200
    assert 99_000 < len(accepted.text.splitlines()) - 1 <= 100_000


@pytest.mark.slow
@given(st.floats(1e-3, LIMITS.horizon_s[1]), st.sampled_from([2, 10, 1000, 100_000]))
@settings(max_examples=300, deadline=None)
def test_the_step_that_is_offered_is_always_accepted(horizon_s, max_points):
    finest = smallest_step_s(horizon_s, max_points)

    assert sample_count(horizon_s, finest) <= max_points
    assert finest <= max(1.011 * horizon_s / (max_points - 1), LIMITS.dt_s[0] * 1.001)


def test_a_request_id_is_echoed_when_it_is_safe_and_made_when_not(service):
    kept = service.client.get("/health/live", headers={"x-request-id": "abc-123"})
    replaced = service.client.get("/health/live", headers={"x-request-id": "a b\tc"})

    assert kept.headers["x-request-id"] == "abc-123"
    assert replaced.headers["x-request-id"] not in ("a b\tc", "")
    assert "server" not in kept.headers
