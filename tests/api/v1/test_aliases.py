"""Moving aliases: nobody overwrites a move that he has not seen, every move is on record, rollback takes one back."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest

from tests.api.conftest import publish_version
from tests.fair_clock import fair_clock

CHAMPION = "/v1/models/viper-lunar/aliases/champion"


def move(admin, version, reason="for a test", path=CHAMPION, **headers):
    sent = {name.replace("_", "-"): value for name, value in headers.items()}
    return admin.client.put(path, json={"version": version, "reason": reason}, headers=sent)


def roll_back(admin, **headers):
    sent = {name.replace("_", "-"): value for name, value in headers.items()}
    return admin.client.post(f"{CHAMPION}/rollback", headers=sent)


@pytest.fixture
def three(store, publish):
    return [publish(store, coefficient=coefficient) for coefficient in (0.1, 0.2, 0.3)]


@pytest.fixture(scope="module")
def unmoved(service_with_token):
    """A service for all tests after which nothing has moved: three versions, no alias."""
    for coefficient in (0.1, 0.2, 0.3):
        publish_version(service_with_token.store, coefficient=coefficient)
    return service_with_token


@pytest.fixture
def own_champion(service_with_token):
    """The path of an alias that no other test moves, of a model with three versions; its service is that of all."""
    name = f"own-{len(service_with_token.store.model_names())}"
    for coefficient in (0.1, 0.2, 0.3):
        publish_version(service_with_token.store, name, coefficient=coefficient)
    return f"/v1/models/{name}/aliases/champion"


@pytest.mark.slow
def test_a_new_alias_is_created_and_an_old_one_moves_by_its_etag(admin, three):
    created = move(admin, 1, "the first")
    read = admin.get(CHAMPION)
    moved = move(admin, 2, "better", If_Match=read.headers["etag"])

    assert (created.status_code, moved.status_code) == (201, 200)
    assert created.headers["etag"] == read.headers["etag"] == '"1"'
    assert moved.headers["etag"] == admin.get(CHAMPION).headers["etag"] == '"2"'
    assert created.json() == read.json()
    assert moved.json() == admin.get(CHAMPION).json()
    history = admin.get(f"{CHAMPION}/history").json()["history"]
    assert [(each["version"], each["actor"], each["reason"]) for each in history] == [
        (2, "admin", "better"),
        (1, "admin", "the first"),
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("conditions", "status", "problem"),
    [
        ({}, 428, "precondition-required"),
        ({"If_Match": '"1"'}, 412, "precondition-failed"),
        ({"If_Match": 'W/"2"'}, 412, "precondition-failed"),
        ({"If_Match": '"02"'}, 412, "precondition-failed"),
        ({"If_Match": '"1", "3"'}, 412, "precondition-failed"),
        ({"If_None_Match": "*"}, 412, "precondition-failed"),
        ({"If_Match": '"2"', "If_None_Match": "*"}, 412, "precondition-failed"),
        ({"If_Match": "2"}, 422, "invalid-input"),
        ({"If_Match": ""}, 422, "invalid-input"),
        ({"If_None_Match": '"2"'}, 422, "invalid-input"),
        ({"If_Match": '"2"'}, 200, None),
        ({"If_Match": '"1", "2"'}, 200, None),
        ({"If_Match": "*"}, 200, None),
    ],
)
def test_preconditions_of_an_alias_that_is_there(service_with_token, own_champion, conditions, status, problem):
    move(service_with_token, 1, path=own_champion)
    move(service_with_token, 2, path=own_champion, If_Match='"1"')

    answer = move(service_with_token, 3, path=own_champion, **conditions)

    assert answer.status_code == status, answer.text
    assert service_with_token.get(own_champion).json()["version"] == (3 if status == 200 else 2)
    if problem:
        assert answer.json()["type"].endswith(problem)
    if conditions.get("If_Match", "").startswith("W/"):
        assert "If-Match is a weak tag, which never matches" in answer.json()["detail"]


@pytest.mark.parametrize(
    ("conditions", "status"),
    [({}, 201), ({"If_None_Match": "*"}, 201), ({"If_Match": "*"}, 412), ({"If_Match": '"1"'}, 412)],
)
def test_preconditions_of_an_alias_that_is_new(service_with_token, own_champion, conditions, status):
    answer = move(service_with_token, 1, path=own_champion, **conditions)

    assert answer.status_code == status, answer.text
    assert service_with_token.get(own_champion).status_code == (200 if status == 201 else 404)


@pytest.mark.slow
def test_of_many_who_move_the_alias_that_they_all_saw_one_wins(admin, store, three):
    move(admin, 1)

    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(lambda number: move(admin, 2, f"mover {number}", If_Match='"1"'), range(8)))

    statuses = sorted(answer.status_code for answer in answers)
    assert statuses == [200] + [412] * 7
    winner = next(answer.json()["reason"] for answer in answers if answer.is_success)
    assert [record.reason for record in store.alias_history("viper-lunar", "champion")] == ["for a test", winner]


@pytest.mark.slow
def test_of_many_who_create_an_alias_one_wins(admin, store, three):
    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(lambda number: move(admin, 2, f"mover {number}", If_None_Match="*"), range(8)))

    assert sorted(answer.status_code for answer in answers) == [201] + [412] * 7
    assert len(store.alias_history("viper-lunar", "champion")) == 1


@pytest.mark.parametrize(
    ("path", "body", "status", "problem"),
    [
        (CHAMPION, {"version": 9, "reason": "x"}, 404, "version-not-found"),
        ("/v1/models/no-such/aliases/champion", {"version": 1, "reason": "x"}, 404, "model-not-found"),
        ("/v1/models/UPPER/aliases/champion", {"version": 1, "reason": "x"}, 404, "model-not-found"),
        ("/v1/models/viper-lunar/aliases/3", {"version": 1, "reason": "x"}, 422, "invalid-input"),
        ("/v1/models/viper-lunar/aliases/Champion", {"version": 1, "reason": "x"}, 422, "invalid-input"),
        (CHAMPION, {"version": "1", "reason": "x"}, 422, "invalid-input"),
        (CHAMPION, {"version": 1.5, "reason": "x"}, 422, "invalid-input"),
        (CHAMPION, {"version": True, "reason": "x"}, 422, "invalid-input"),
        (CHAMPION, {"version": 0, "reason": "x"}, 422, "invalid-input"),
        (CHAMPION, {"version": 1}, 422, "invalid-input"),
        (CHAMPION, {"version": 1, "reason": ""}, 422, "invalid-input"),
        (CHAMPION, {"version": 1, "reason": "x" * 4001}, 422, "invalid-input"),
        (CHAMPION, {"version": 1, "reason": "x", "actor": "me"}, 422, "invalid-input"),
        (CHAMPION, [1], 422, "invalid-input"),
    ],
)
def test_what_cannot_be_moved(unmoved, path, body, status, problem):
    answer = unmoved.client.put(path, json=body)

    assert answer.status_code == status, answer.text
    assert answer.json()["type"].endswith(problem)
    assert unmoved.store.aliases("viper-lunar") == {}


@pytest.mark.parametrize(
    ("content", "kind", "status"),
    [
        (b'{"version": 1, "reason": "x"', "application/json", 400),
        (b"", "application/json", 400),
        (b'{"version": 1, "reason": "x"}', "text/plain", 415),
        (b'{"version": 1, "reason": "x"}', "application/x-www-form-urlencoded", 415),
        (b'{"version": 1, "version": 2, "reason": "x"}', "application/json", 422),
        (b'{"version": 1, "reason": "\\ud800"}', "application/json", 400),
        (b"[" * 30_000, "application/json", 400),
        (b'{"version": 1, "reason": "' + b"x" * 70_000 + b'"}', "application/json", 413),
    ],
)
def test_bodies_that_are_none(unmoved, content, kind, status):
    answer = unmoved.client.put(CHAMPION, content=content, headers={"Content-Type": kind})

    assert answer.status_code == status, answer.text
    assert unmoved.store.aliases("viper-lunar") == {}


@pytest.mark.slow
def test_rollback_undoes_one_version_change_after_the_other(admin, three):
    for version in three:
        move(admin, version, **({"If_Match": "*"} if version > 1 else {}))

    back = admin.client.post(
        f"{CHAMPION}/rollback", json={"reason": "slides at 30 degrees"}, headers={"If-Match": '"3"'}
    )
    again = roll_back(admin, If_Match='"4"')
    too_far = roll_back(admin, If_Match="*")

    assert (back.status_code, back.json()["version"], back.headers["etag"]) == (200, 2, '"4"')
    assert (back.json()["actor"], back.json()["reason"]) == ("admin", "slides at 30 degrees")
    assert (again.status_code, again.json()["version"]) == (200, 1)
    assert (too_far.status_code, too_far.json()["type"]) == (409, "urn:rover-twin:problem:conflict")
    assert "nothing to roll back to" in too_far.json()["detail"]


@pytest.mark.slow
def test_who_reads_an_alias_knows_where_a_rollback_goes(admin, three):
    for version in (*three, 1):
        move(admin, version, **({"If_Match": "*"} if admin.store.aliases("viper-lunar") else {}))

    goes_to = []
    while (now := admin.get(CHAMPION).json())["previous_seq"] is not None:
        history = {each["seq"]: each for each in admin.get(f"{CHAMPION}/history").json()["history"]}
        assert history[now["seq"]] == now
        goes_to.append(history[now["previous_seq"]]["version"])
        assert roll_back(admin, If_Match=f'"{now["seq"]}"').json()["version"] == goes_to[-1]
    assert goes_to == [3, 2, 1]
    assert roll_back(admin, If_Match="*").status_code == 409


@pytest.mark.slow
def test_a_rollback_has_the_preconditions_of_a_move(admin, three):
    move(admin, 1)
    move(admin, 2, If_Match='"1"')

    missing = roll_back(admin)
    assert (missing.status_code, missing.json()["type"]) == (428, "urn:rover-twin:problem:precondition-required")
    assert '"2"' in missing.json()["detail"]

    assert roll_back(admin, If_Match='"1"').status_code == 412
    assert roll_back(admin, If_Match="nonsense").status_code == 422
    assert roll_back(admin, If_Match='"2"').json()["version"] == 1
    assert roll_back(admin, If_Match='"2"').status_code == 412


@pytest.mark.slow
def test_of_many_who_roll_back_what_they_all_saw_one_does(admin, store, three):
    for version in three:
        move(admin, version, **({"If_Match": "*"} if version > 1 else {}))

    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(lambda _: roll_back(admin, If_Match='"3"'), range(8)))

    assert sorted(answer.status_code for answer in answers) == [200] + [412] * 7
    assert store.alias("viper-lunar", "champion").version == 2


@pytest.mark.parametrize("name", ["champion", "no-such", "3"])
def test_a_rollback_of_an_alias_that_is_not_there(unmoved, name):
    answer = unmoved.client.post(f"/v1/models/viper-lunar/aliases/{name}/rollback")

    assert answer.status_code == 404
    assert answer.json()["type"].endswith("alias-not-found")


@pytest.mark.slow
def test_an_alias_with_a_damaged_record_is_repaired_by_a_move_that_takes_it_as_it_is(admin, store, three, tmp_path):
    move(admin, 1)
    record = tmp_path / "store/models/viper-lunar/aliases/champion/00000001.json"
    record.write_text("{")

    assert move(admin, 2, If_Match='"1"').status_code == 503
    assert move(admin, 2, If_Match="*").json()["version"] == 2
    assert store.alias("viper-lunar", "champion").version == 2


@pytest.mark.slow
def test_predictions_follow_a_move_within_two_seconds(admin, three):
    move(admin, 1)
    admin.wait_ready()
    moved = move(admin, 2, If_Match='"1"')
    with fair_clock() as clock:
        clock.wait_until(lambda: admin.predict().json()["model"]["version"] == 2, 2)

    assert moved.is_success
