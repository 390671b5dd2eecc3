"""From a path to the template of its route, for requests that are answered before the router sees them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any

from starlette.routing import compile_path

NO_ROUTE = "no route"


class Templates:
    """The templates of an app's routes, once it has told them."""

    def __init__(self) -> None:
        self._plain: frozenset[str] = frozenset()
        self._patterns: list[tuple[re.Pattern[str], str]] = []

    def learn(self, routes: Iterable[Any]) -> None:
        """These are the routes."""
        paths = dict.fromkeys(_paths(routes))
        self._plain = frozenset(path for path in paths if "{" not in path)
        self._patterns = [(compile_path(path)[0], path) for path in paths if "{" in path]

    def of(self, path: str) -> str:
        """The template of the first route that has this path, whatever the method; `no route` where there is none."""
        if path in self._plain:
            return path
        return next((template for pattern, template in self._patterns if pattern.match(path)), NO_ROUTE)


def _paths(routes: Iterable[Any]) -> Iterator[str]:
    for route in routes:
        if path := getattr(route, "path", None):
            yield path
