"""`rover-twin openapi`: the API's own description."""

from __future__ import annotations

from service.cli.output import print_json


def openapi() -> None:
    """Print the OpenAPI document of the HTTP API as JSON, without starting a server.

    Example, for a client generator:
      rover-twin openapi > openapi.json
    """
    from service.app import openapi_document

    print_json(openapi_document())
