"""Operation ids are the method names of generated clients: verb and noun, unique, and they do not change unseen."""

from __future__ import annotations

import keyword
import re

import pytest

from service.app import openapi_document

VERBS = {
    *("get", "list", "create", "put", "delete", "download"),
    *("infer", "load", "unload", "cancel", "archive", "restore", "roll_back"),
}


@pytest.fixture(scope="module")
def operations():
    paths = openapi_document()["paths"]
    return {f"{method} {path}": each for path, methods in paths.items() for method, each in methods.items()}


def test_every_operation_has_an_id_of_its_own(operations):
    ids = [each["operationId"] for each in operations.values()]

    assert len(set(ids)) == len(ids) == len(operations)


def test_ids_are_names_of_methods_that_begin_with_a_known_verb(operations):
    for place, each in operations.items():
        name = each["operationId"]
        assert re.fullmatch(r"[a-z]+(_[a-z]+)+", name), place
        assert not keyword.iskeyword(name), place
        assert any(name.startswith(f"{verb}_") for verb in VERBS), place


def test_the_verb_fits_the_method(operations):
    """A GET changes nothing, and a client that reads its name must be able to believe that."""
    for place, each in operations.items():
        reads = each["operationId"].partition("_")[0] in ("get", "list", "download", "infer")
        method = place.partition(" ")[0]
        asks_with_a_body = each["operationId"] in ("list_repository", "infer_model", "infer_version")
        assert reads == (method == "get" or asks_with_a_body), place
        assert (method in ("put", "delete")) == each["operationId"].startswith(("put_", "delete_")), place


def test_every_operation_is_in_one_group_and_says_what_it_does(operations):
    for place, each in operations.items():
        assert len(each["tags"]) == 1, place
        assert each["summary"], place
        assert each["description"], place
