"""The AsyncAPI document of `/v1/live`, made of the wire models: `docs/asyncapi.yaml` is its text."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel

import service
from service.api.v1.live import GOING_AWAY, IDLE, MAX_MESSAGE_BYTES, PATH, REVOKED, SLOW
from service.wire.steps.answer import MessageError, Parting, StepsAnswer
from service.wire.steps.question import LiveBody

_SCHEMAS = "#/components/schemas/"
_MESSAGES: dict[str, tuple[type[BaseModel], str]] = {
    "step": (LiveBody, "Rovers that begin, go on from a state, or go on from where they are."),
    "moved": (StepsAnswer, "Where they are then, in the order sent, and which were refused and why."),
    "refused": (MessageError, "The message as a whole is wrong; the connection goes on."),
    "parting": (Parting, "Before the server closes: every rover's state."),
}
_ABOUT = f"""\
A connection keeps rovers and moves them on: for control loops and simulators of up to a thousand steps a second. A
message is JSON, as text or as bytes, and is answered in kind, one answer for each message and in order. A rover begins
with `start` or goes on from a `state`, of this or another server, or of `POST /v1/steps`; after that its id is enough.
Rovers end with the connection, so ask for states (`include: [state]`) as often as you can afford to lose steps.

Bounded: {MAX_MESSAGE_BYTES >> 20} MiB for a message; and, unless the operator set other limits, 1000 rovers for a
connection and 256 connections for a server process; the next one is refused with a 503 and `Retry-After`. A client may
send on before it has its answer; at most two messages are read ahead. A service that requires tokens answers the
handshake with 401 unless it has `Authorization: Bearer <token>`.

Close codes: {GOING_AWAY} the server ends (after `parting`); {IDLE} no message came for 300 s (after `parting`);
{SLOW} an answer was not taken for 5 s (full buffers may swallow this code); 1009 the message was too long; 1011 no
answer to a ping, or a fault of the service; {REVOKED} a service that requires tokens found that this connection's is
not in force any more, within about two seconds and without `parting`."""


def asyncapi_document() -> dict[str, Any]:
    """The whole document, AsyncAPI 3.0."""
    schemas: dict[str, Any] = {}
    for model, _ in _MESSAGES.values():
        schema = model.model_json_schema(ref_template=_SCHEMAS + "{model}", mode="validation")
        schemas |= {**schema.pop("$defs", {}), model.__name__: schema}
    messages = {
        name: {
            "summary": summary,
            "contentType": "application/json",
            "payload": {"$ref": _SCHEMAS + model.__name__},
        }
        for name, (model, summary) in _MESSAGES.items()
    }
    answers = [name for name in _MESSAGES if name not in ("step", "parting")]
    channel = {"$ref": "#/channels/live"}

    def of_channel(*names: str) -> list[dict[str, str]]:
        return [{"$ref": f"#/channels/live/messages/{name}"} for name in names]

    return {
        "asyncapi": "3.0.0",
        "info": {"title": "Rover Twin, live", "version": service.__version__, "description": _ABOUT},
        "defaultContentType": "application/json",
        "servers": {"local": {"host": "127.0.0.1:8000", "protocol": "ws"}},
        "channels": {
            "live": {
                "address": PATH,
                "messages": {name: {"$ref": f"#/components/messages/{name}"} for name in _MESSAGES},
                "bindings": {"ws": {"method": "GET", "bindingVersion": "0.1.0"}},
            }
        },
        "operations": {
            "step": {
                "action": "receive",
                "summary": "Move rovers on.",
                "channel": channel,
                "messages": of_channel("step"),
                "reply": {"channel": channel, "messages": of_channel(*answers)},
            },
            "part": {
                "action": "send",
                "summary": "Hand the rovers back before the connection is closed.",
                "channel": channel,
                "messages": of_channel("parting"),
            },
        },
        "components": {"messages": messages, "schemas": dict(sorted(schemas.items()))},
    }
