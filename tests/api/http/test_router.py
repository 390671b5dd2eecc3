"""Routes are made when the first request for their address comes, and say before what there is."""

from __future__ import annotations

import asyncio

import httpx
import pytest
from fastapi import FastAPI, Response

from service.api.http.lanes import LaneRoute
from service.api.http.reading import Route
from service.api.http.router import LateRoute, Router
from service.app import openapi_document


async def answer(name: str = "") -> Response:
    """Says who was asked for."""
    return Response(name)


async def unreadable(first: int, second: int) -> Response:
    """Has what `reading` does not read: two fields of the query."""
    return Response(str(first + second))


@pytest.fixture
def router():
    made = Router(prefix="/made", tags=["made"])
    made.add_api_route("/{name}", answer, methods=["GET"])
    made.add_api_route("/{name}", answer, methods=["PUT"], name="put_answer")
    made.add_api_route("/{name}/more", answer)
    return made


@pytest.fixture
def ask(router):
    app = FastAPI()
    app.router.routes += router.routes

    async def asked(method, path):
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://here") as client:
            return await client.request(method, path)

    return lambda method, path: asyncio.run(asked(method, path))


def is_made(router):
    return ["made" in vars(each) for each in router.routes]


def test_a_route_is_made_for_the_first_who_asks_for_its_address(router, ask):
    assert is_made(router) == [False] * 3
    assert ask("GET", "/other").status_code == 404
    assert ask("GET", "/made/ann/more").text == "ann"
    assert is_made(router) == [False, False, True]
    first = router.routes[2].made
    assert ask("GET", "/made/bob/more").text == "bob"
    assert router.routes[2].made is first


def test_it_is_the_route_that_fastapi_makes(router):
    made = router.routes[0].made
    assert (made.path, made.methods, made.tags, made.unique_id) == ("/made/{name}", {"GET"}, ["made"], "answer")
    assert len(router.routes) == 3


def test_methods_are_compared_as_ever(ask):
    assert ask("PUT", "/made/ann").text == "ann"
    assert ask("DELETE", "/made/ann").status_code == 405


def test_what_is_declared_wrongly_is_refused_when_it_is_made():
    router = Router(route_class=Route)
    router.add_api_route("/sum", unreadable)
    with pytest.raises(TypeError, match="declare one model"):
        _ = router.routes[0].made


def test_lanes_are_made_at_once():
    router = Router()
    router.add_api_route("/quick/{name}", answer, route_class_override=LaneRoute)
    assert [type(each) for each in router.routes] == [LaneRoute]


def test_the_document_has_every_route_of_the_service():
    from service import app

    late = [each for router in app._ROUTERS for each in router.routes if isinstance(each, LateRoute)]
    shown = {(path, method.upper()) for path, item in openapi_document()["paths"].items() for method in item}
    wanted = {(each.path, method) for each in late for method in each.methods if each.made.include_in_schema}
    assert len(late) > 50
    assert wanted <= shown
