"""Archived and deleted versions over HTTP: they predict no more, anywhere, and what they were can still be read."""

from __future__ import annotations

import time

import pytest

from tests.api.conftest import serving

ALIAS = "/v1/models/viper-lunar/aliases/champion"
PREDICTIONS = (
    "/v1/predictions?slope_deg=28&mass_kg=430&torque_nm=60",
    "/v1/mobility?mass_kg=430&torque_min_nm=60&torque_max_nm=70&torque_steps=2&slope_steps=2",
)


def place(version, of="/v1/admin/models"):
    return f"{of}/viper-lunar/versions/{version}"


def change(running, version, what="archive", reason="", **headers):
    sent = {name.replace("_", "-"): value for name, value in headers.items()}
    if what == "delete":
        return running.client.delete(place(version), params={"reason": reason}, headers=sent)
    return running.client.post(f"{place(version)}/{what}", json={"reason": reason}, headers=sent)


def problem(answer):
    return answer.status_code, answer.json()["type"].removeprefix("urn:rover-twin:problem:")


@pytest.fixture
def three(admin, store, publish, move):
    """Versions 1 to 3, champion on 3; the first two are in memory."""
    for coefficient in (0.1, 0.2, 0.3):
        publish(store, coefficient=coefficient)
    move(store, 3)
    admin.wait_ready()
    for version in (1, 2):
        assert admin.predict(model=f"viper-lunar@{version}").status_code == 200
    return admin


def wait_until_refused(running, version, timeout_s=20.0):
    """A version in memory goes with the next look at the store."""
    deadline = time.monotonic() + timeout_s
    while (answer := running.predict(model=f"viper-lunar@{version}")).status_code == 200:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    return answer


@pytest.mark.slow
@pytest.mark.parametrize(
    ("what", "refusal"), [("archive", (409, "version-archived")), ("delete", (410, "version-deleted"))]
)
def test_a_retired_version_predicts_no_more_and_is_still_known(three, what, refusal):
    manifest = three.get(place(1, "/v1/models")).json()
    changed = change(three, 1, what, reason="slides")
    assert changed.status_code == 200
    assert changed.json() == three.get(f"{place(1, '/v1/models')}/state").json()
    assert (changed.json()["actor"], changed.json()["reason"]) == ("admin", "slides")

    assert problem(wait_until_refused(three, 1)) == refusal
    for address in PREDICTIONS:
        assert problem(three.client.get(f"{address}&model=viper-lunar@1")) == refusal
    assert problem(three.get(f"{place(1, '/v1/models')}/fmu")) == refusal
    ready = three.get("/v2/models/viper-lunar/versions/1/ready")
    assert (ready.status_code, "viper-lunar@1" in ready.json()["error"]) == (404, True)
    index = three.client.post("/v2/repository/index", json={}).json()
    assert [each["version"] for each in index] == ["2", "3"]
    moved = three.client.put(ALIAS, json={"version": 1, "reason": "x"}, headers={"If-Match": "*"})
    assert problem(moved) == refusal

    assert three.get(place(1, "/v1/models")).json() == manifest
    listed = three.get("/v1/models").json()["models"][0]
    assert (listed["versions"], listed[{"archive": "archived", "delete": "deleted"}[what]]) == ([2, 3], [1])
    assert three.get("/v1/models/viper-lunar").json()["versions"] == [2, 3]


@pytest.mark.slow
def test_what_is_restored_predicts_as_before(three):
    before = three.predict(model="viper-lunar@1").json()
    change(three, 1)
    wait_until_refused(three, 1)
    restored = change(three, 1, "restore")
    assert (restored.status_code, restored.json()["state"]) == (200, "published")
    after = three.predict(model="viper-lunar@1").json()
    assert after["trajectory"] == before["trajectory"]
    change(three, 1, "delete")
    assert problem(change(three, 1, "restore")) == (410, "version-deleted")
    assert problem(change(three, 1, "archive")) == (410, "version-deleted")


@pytest.mark.slow
@pytest.mark.parametrize("what", ["archive", "delete"])
def test_a_version_that_an_alias_names_is_kept(three, what):
    refused = change(three, 3, what)
    assert problem(refused) == (409, "version-in-use")
    assert refused.json()["aliases"] == ["champion"]
    assert three.predict().json()["model"]["version"] == 3
    # it goes when the alias has moved, and a rollback to it is refused then
    three.client.put(ALIAS, json={"version": 2, "reason": "x"}, headers={"If-Match": "*"})
    assert change(three, 3, what).status_code == 200
    assert problem(three.client.post(f"{ALIAS}/rollback", headers={"If-Match": "*"}))[0] in (409, 410)


@pytest.mark.slow
def test_changes_are_safe_to_repeat_and_conditional(three):
    first = change(three, 1, reason="the first")
    assert change(three, 1, reason="again").json() == first.json()
    assert problem(change(three, 1, "delete", If_Match='"0"')) == (412, "precondition-failed")
    assert problem(change(three, 1, "delete", If_Match="0")) == (422, "invalid-input")
    deleted = change(three, 1, "delete", If_Match=first.headers["etag"])
    assert deleted.status_code == 200
    assert change(three, 1, "delete").json() == deleted.json()
    assert change(three, 2, If_Match="*").status_code == 200


@pytest.mark.slow
def test_the_tag_of_a_state_never_comes_back_and_a_restored_version_says_who_and_why(three):
    state = f"{place(1, '/v1/models')}/state"
    tags = [three.get(state).headers["etag"]]
    for what in ("archive", "restore", "archive", "restore"):
        tags.append(change(three, 1, what, reason=f"to {what}").headers["etag"])
        # moves of aliases, and what becomes of others, leave it alone
        three.client.put(ALIAS, json={"version": 2, "reason": "x"}, headers={"If-Match": "*"})
        change(three, 3, what)
        now = three.get(state)
        assert now.headers["etag"] == tags[-1]
        assert (now.json()["actor"], now.json()["reason"]) == ("admin", f"to {what}")
    assert len(set(tags)) == len(tags)
    for old in tags[:-1]:
        assert problem(change(three, 1, "delete", If_Match=old)) == (412, "precondition-failed")
    assert change(three, 1, "delete", If_Match=tags[-1]).status_code == 200


@pytest.mark.slow
def test_what_is_not_there_or_not_allowed(three):
    assert problem(change(three, 9)) == (404, "version-not-found")
    assert problem(three.client.post("/v1/admin/models/none/versions/1/archive")) == (404, "model-not-found")
    assert problem(change(three, 1, reason="x" * 4001)) == (422, "invalid-input")
    unknown = three.client.post(f"{place(1)}/archive", json={"why": "x"})
    assert problem(unknown) == (422, "invalid-input")
    assert three.client.post(f"{place(1)}/archive", headers={"Authorization": "no"}).status_code == 401
    assert three.get("/v1/models").json()["models"][0]["versions"] == [1, 2, 3]


@pytest.mark.slow
def test_the_default_model_by_number_is_kept(store, publish, serve):
    for coefficient in (0.1, 0.2):
        publish(store, coefficient=coefficient)
    running = serve(admin_token="a token of tests, long enough", start_worker=False, default_model="viper-lunar@1")
    running.client.headers["Authorization"] = "Bearer a token of tests, long enough"
    assert problem(change(running, 1, "delete")) == (409, "version-in-use")
    assert change(running, 2, "delete").status_code == 200


@pytest.mark.slow
def test_other_replicas_drop_it_too(three, tmp_path):
    with serving(tmp_path / "store") as other:
        other.wait_ready()
        assert other.predict(model="viper-lunar@2").status_code == 200
        change(three, 2, "delete")
        assert problem(wait_until_refused(other, 2)) == (410, "version-deleted")
