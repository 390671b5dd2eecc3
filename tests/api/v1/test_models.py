"""What is published, as the routes tell it."""

from __future__ import annotations

import pytest

NONE_RETIRED = {"archived": [], "deleted": [], "unreadable": None}


def test_the_list_names_versions_and_aliases(service):
    assert service.get("/v1/models").json() == {
        "models": [{"name": "viper-lunar", "versions": [1, 2], "aliases": {"champion": 1}} | NONE_RETIRED]
    }


def test_a_model_says_what_its_champion_is(service):
    answer = service.get("/v1/models/viper-lunar").json()

    assert answer["description"] == "a small model with coefficient 0.1"
    assert answer["versions"] == [1, 2]


def test_the_manifest_is_the_one_in_the_store(service):
    answer = service.get("/v1/models/viper-lunar/versions/2").json()

    assert answer == service.store.manifest("viper-lunar", 2).model_dump(mode="json")


@pytest.mark.slow
def test_the_history_is_newest_first(serve, store, publish, move):
    for version in (publish(store), publish(store)):
        move(store, version)
    service = serve()

    history = service.get("/v1/models/viper-lunar/aliases/champion/history").json()["history"]
    aliases = service.get("/v1/models/viper-lunar/aliases").json()["aliases"]
    alias = service.get("/v1/models/viper-lunar/aliases/champion").json()

    assert [(record["seq"], record["version"]) for record in history] == [(2, 2), (1, 1)]
    assert history[0] == alias == aliases["champion"]
    assert alias["actor"] == "tests"
    assert alias["reason"] == "for a test"


@pytest.mark.slow
def test_an_empty_store_has_no_models(serve):
    assert serve().get("/v1/models").json() == {"models": []}
