"""Asks the twin service over HTTP with the standard library, since Kit's Python has nothing else for sure."""

from __future__ import annotations

import http.client
import json
import os
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from rover_twin_usd.failures import ServiceError

USUAL_ADDRESS = "http://127.0.0.1:8000"
TOKEN_VARIABLE = "ROVER_TWIN_TOKEN"  # noqa: S105 - its name, not a secret
_LONGEST_S = 130.0  # a batch may wait two minutes for its turn
Question = Mapping[str, Any]


@dataclass(frozen=True)
class Service:
    """Where the service is, with or without `/v1`. The token, if it wants one, comes from ROVER_TWIN_TOKEN."""

    address: str = USUAL_ADDRESS

    def answers(self, question: Question) -> Iterator[dict[str, Any]]:
        """The JSON answer of each rover, in the order asked; one that is refused has `status` and `detail`.

        Positions are in the world frame. A band exists in the slope frame alone, so it is asked for apart. Raises
        ServiceError.
        """
        path, include = _route(question), list(question.get("include", []))
        plain = {**question, "frame": "world", "include": [each for each in include if each != "band"]}
        found = self._lines(path, plain)
        if "band" not in include:
            yield from found
            return
        for answer, banded in zip(found, self._lines(path, {**question, "frame": "slope"}), strict=True):
            yield {**answer, "band": banded["band"]} if "band" in banded else answer

    def layer(self, question: Question, **stage: object) -> str:
        """The service's own USD layer, with the parameters of `format=usda`. Raises ServiceError."""
        return self._post(_route(question), question, {"format": "usda", **stage}).decode()

    def _lines(self, path: str, question: Question) -> list[dict[str, Any]]:
        if path.endswith("/batch"):
            lines = self._post(path, question, {"format": "ndjson"}).splitlines()
            return [self._read(line) for line in lines if line]
        return [self._read(self._post(path, question, {"format": "json"}))]

    def _read(self, text: bytes) -> dict[str, Any]:
        try:
            answer = json.loads(text)
        except ValueError:
            answer = None
        if not isinstance(answer, dict):
            raise ServiceError(f"what answers at {self.address} is not the twin's service")
        return answer

    def _post(self, path: str, question: Question, query: Mapping[str, object]) -> bytes:
        base = self.address.rstrip("/").removesuffix("/v1")
        if not base.startswith(("http://", "https://")):
            raise ServiceError(f"the service's address is {self.address!r}; it begins with http:// or https://")
        headers = {"Content-Type": "application/json"}
        if token := os.environ.get(TOKEN_VARIABLE, "").strip():
            if not (token.isascii() and token.isprintable()):
                raise ServiceError(f"{TOKEN_VARIABLE} has a line end or another sign in it that no token has")
            headers["Authorization"] = f"Bearer {token}"
        address = f"{base}{path}?{urllib.parse.urlencode(query)}"
        body = json.dumps(question).encode()
        try:
            request = urllib.request.Request(address, body, headers)  # noqa: S310 - the scheme was looked at
            with urllib.request.urlopen(request, timeout=_LONGEST_S) as answer:  # noqa: S310
                content: bytes = answer.read()
        except urllib.error.HTTPError as error:
            raise ServiceError(f"the service refuses: {_detail(error)}") from error
        except (OSError, ValueError, http.client.HTTPException) as error:
            raise ServiceError(f"no answer from {base}: {error}. Does the service run there?") from error
        return content


def _route(question: Question) -> str:
    """Which address takes such a question: by what only that one has."""
    if "drives" in question:
        return "/v1/drives/batch"
    if "scenarios" in question:
        return "/v1/predictions/batch"
    return "/v1/drives" if "track" in question else "/v1/predictions"


def _detail(error: urllib.error.HTTPError) -> str:
    try:
        return str(json.loads(error.read())["detail"])
    except (ValueError, KeyError, TypeError):
        return f"{error.code} {error.reason}"
