"""The service's settings, and the only place that reads the environment (`ROVER_TWIN_...`).

Ranges of the public API (`LIMITS`) are no settings: a client may rely on them in every deployment.
"""

from __future__ import annotations

import difflib
import importlib.util
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import platformdirs
from pydantic import AfterValidator, Field, SecretStr, ValidationError
from pydantic_settings import BaseSettings, SettingsConfigDict
from pydantic_settings import SettingsError as UnreadableError

from model_store import parse_reference
from service.access.addresses import networks
from service.allowed import allowed_values
from service.errors import RoverTwinError

PREFIX = "ROVER_TWIN_"
SECRETS = ("admin_token", "jobs_database_url")
"""Settings that may also be read from a file, which a variable with _FILE at its end names, and are never printed."""

# Not ours, but often set beside them: of the client scripts, docker/compose.yaml, and what builds the image.
_OF_OTHERS = {
    f"{PREFIX}{name}" for name in ("URL", "TOKEN", "PUBLISHED_PORT", "SERVICE", "IMAGE", "IMAGE_BUILD", "IMAGE_RUN")
}
_EXPORTER = "OTEL_TRACES_EXPORTER"
_ENDPOINTS = ("OTEL_EXPORTER_OTLP_ENDPOINT", "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT")
_SERVICE_LINKS = "Kubernetes set this for a service named rover-twin: set enableServiceLinks: false in the pod"


class SettingsError(RoverTwinError, ValueError):
    """A setting has a value that is not allowed; the message names variable, value and what is allowed."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Ranges of what a client may ask, in the units of the API."""

    slope_deg: float = 45.0  # either way; steeper is beyond the repose of any regolith
    mass_kg: tuple[float, float] = (1.0, 10_000.0)
    torque_nm: tuple[float, float] = (0.0, 10_000.0)
    horizon_s: tuple[float, float] = (0.0001, 600.0)  # nothing is shorter than the finest step
    dt_s: tuple[float, float] = (0.0001, 60.0)


LIMITS = Limits()


def _packaged_store() -> str:
    """The models that ship with the service lie beside the modules of `model_store`."""
    found = importlib.util.find_spec("model_store")
    assert found is not None
    assert found.origin is not None
    return str(Path(found.origin).parent)


def _reference(text: str) -> str:
    parse_reference(text)
    return text


def _networks(texts: tuple[str, ...]) -> tuple[str, ...]:
    networks(texts)
    return texts


_ORIGIN = re.compile(r"[a-z][a-z0-9+.-]*://([a-z0-9._-]+|\[[0-9a-f:.]+\])(:[0-9]{1,5})?")


def _origins(texts: tuple[str, ...]) -> tuple[str, ...]:
    """A page's scheme, host and port are compared as text, so what is written otherwise would never match."""
    for text in texts:
        if text != "*" and not _ORIGIN.fullmatch(text):
            raise ValueError(f"{text!r} is no origin")
    return texts


class Settings(BaseSettings):
    """Everything an operator may choose; each field is read from `ROVER_TWIN_<FIELD>`."""

    model_config = SettingsConfigDict(env_prefix=PREFIX, frozen=True, extra="forbid", env_ignore_empty=True)

    store_url: Annotated[str, Field(min_length=1)] = Field(
        default_factory=_packaged_store,
        description="Where models and datasets live: a directory, or a file://, s3://, gs:// or az:// URL.",
    )
    host: Annotated[str, Field(min_length=1)] = Field(
        default="127.0.0.1", description="Address to listen on; the default is reachable from this machine only."
    )
    port: Annotated[int, Field(ge=0, le=65535)] = Field(
        default=8000, description="TCP port to listen on; 0 takes any free one."
    )
    default_model: Annotated[
        str,
        AfterValidator(_reference),
        Field(json_schema_extra={"x-allowed": "name, name@version or name@alias"}),
    ] = Field(default="viper-lunar@champion", description="Model that answers when a request names none.")
    max_resident_versions: Annotated[int, Field(ge=1, le=1000)] = Field(
        default=4, description="Model versions kept in memory; the least recently used one makes room."
    )
    refresh_s: Annotated[float, Field(gt=0, le=60)] | None = Field(
        default=None,
        description="Seconds between two looks at the store for moved aliases. The default is 0.5 for a directory and "
        "4 for a remote store, where a look is one request for each 1,000 objects.",
    )
    store_timeout_s: Annotated[float, Field(ge=0.2, le=600)] = Field(
        default=4.0,
        description="Seconds after which a request is answered with a 503 when the model store does not answer. "
        "What reads much, such as a version that is not in memory, may take four times as long.",
    )
    jobs_timeout_s: Annotated[float, Field(ge=0.2, le=600)] = Field(
        default=4.5,
        description="Seconds after which a request is answered with a 503 when the jobs database does not answer: for "
        "each call of the jobs and of the audit log, of which a request makes up to three. The first call of the jobs "
        "in a process, which loads what talks to the database and makes its tables, may take four times as long.",
    )
    max_points: Annotated[int, Field(ge=2, le=10_000_000)] = Field(
        default=100_000, description="Largest number of points of one trajectory."
    )
    max_body_bytes: Annotated[int, Field(ge=1024, le=1 << 30)] = Field(
        default=4 << 20, description="Largest request body in bytes; 100,000 sample times in JSON take up to 2.5 MB."
    )
    admin_token: Annotated[SecretStr, Field(min_length=16, max_length=1024)] | None = Field(
        default=None,
        description="Bearer token of the admin endpoints, at least 16 characters, of the identity `admin`. Without it "
        "and without a file of tokens they are off.",
    )
    tokens_file: Annotated[Path, Field(json_schema_extra={"x-allowed": "the path of a file"})] | None = Field(
        default=None,
        description="File of named tokens that `rover-twin tokens create` writes; read again within a second or two "
        "when it changes.",
    )
    require_token: bool = Field(
        default=False,
        description="Whether every address but health needs a token, of scope read at least: predictions, documents "
        "and metrics too.",
    )
    trusted_proxies: Annotated[
        tuple[str, ...],
        Field(max_length=100, json_schema_extra={"x-allowed": 'a JSON list of addresses and networks, ["10.0.0.0/8"]'}),
        AfterValidator(_networks),
    ] = Field(
        default=(),
        description="Proxies whose X-Forwarded-For is believed, as a JSON list of addresses and networks.",
    )
    audit_days: Annotated[int, Field(ge=1, le=36_500)] = Field(
        default=365, description="Days that the audit log of admin calls is kept."
    )
    failed_logins_free: Annotated[int, Field(ge=1, le=1000)] = Field(
        default=5, description="Wrong tokens a client may send before it has to wait."
    )
    failed_logins_wait_s: Annotated[float, Field(ge=1, le=3600)] = Field(
        default=60.0, description="Longest time in seconds that a client waits which goes on to send wrong tokens."
    )
    failed_logins_clients: Annotated[int, Field(ge=100, le=1_000_000)] = Field(
        default=10_000,
        description="Clients whose wrong tokens each server process counts, those that failed last; about 0.5 KB each.",
    )
    jobs_database_url: (
        Annotated[
            str,
            Field(
                pattern=r"^(sqlite:///|postgresql(\+psycopg)?://).+",
                json_schema_extra={"x-allowed": "sqlite:///FILE or postgresql://USER@HOST/DATABASE"},
            ),
        ]
        | None
    ) = Field(
        default=None,
        description="Database of the training jobs, sqlite:///file or postgresql://... "
        "The default is a file inside a local store, or in the user's state folder for other stores.",
    )
    max_upload_bytes: Annotated[int, Field(ge=1024, le=1 << 40)] = Field(
        default=1 << 30, description="Largest dataset upload in bytes, before it is unpacked."
    )
    max_queued_jobs: Annotated[int, Field(ge=1, le=10_000)] = Field(
        default=16, description="Training jobs that may wait; the next one is refused with a 429."
    )
    keep_jobs_days: Annotated[int, Field(ge=1, le=36_500)] = Field(
        default=90,
        description="Days that a training job is kept after its end, with its events, its log and its idempotency key.",
    )
    start_worker: bool = Field(
        default=True,
        description="Whether serve keeps a training worker running; it does so only with a token configured.",
    )
    worker_threads: Annotated[int, Field(ge=1, le=1024)] = Field(
        default=1, description="Threads of a training worker, which yields the processor to predictions."
    )
    workers: Annotated[int, Field(ge=1, le=256)] = Field(
        default=1,
        description="Server processes, which share the port, the metrics and the training worker. Each has its own "
        "limits of waiting predictions and of connections.",
    )
    threads: Annotated[int, Field(ge=1, le=1024)] | None = Field(
        default=None,
        description="Threads for predictions in each server process. By default all processes together have as many as "
        "the CPU quota allows.",
    )
    max_waiting: Annotated[int, Field(ge=0, le=100_000)] = Field(
        default=256, description="Predictions that may wait for a thread; the next one is refused with a 503."
    )
    refusals_per_s: Annotated[int, Field(ge=1, le=100_000)] = Field(
        default=100,
        description="Predictions in a second that are refused with a 503 when they come. If more come each waits for "
        "its turn, 4.5 seconds at most, so that clients that ask again at once slow themselves down.",
    )
    max_connections: Annotated[int, Field(ge=16, le=1_000_000)] = Field(
        default=2048,
        description="Connections of a server process. One more takes the place of the one that idled longest; if "
        "none is idle it is refused with a 503, but for health.",
    )
    max_head_bytes: Annotated[int, Field(ge=4096, le=1 << 20)] = Field(
        default=32 << 10, description="Largest head of a request (address and headers) in bytes; more is a 431."
    )
    max_headers: Annotated[int, Field(ge=16, le=10_000)] = Field(
        default=100, description="Most headers of a request; more is a 431."
    )
    head_timeout_s: Annotated[float, Field(gt=0, le=600)] = Field(
        default=10.0, description="Seconds in which the head of a request has to come before the connection is cut off."
    )
    keep_alive_s: Annotated[int, Field(ge=1, le=3600)] = Field(
        default=75,
        description="Seconds that a connection stays open without a request. Longer than clients and proxies keep "
        "theirs, so that it is they who close it: a request never meets a connection that is being closed.",
    )
    send_timeout_s: Annotated[float, Field(gt=0, le=600)] = Field(
        default=10.0, description="Seconds after which a client that takes nothing of its answer is cut off."
    )
    max_answer_bytes: Annotated[int, Field(ge=1 << 20, le=1 << 40)] = Field(
        default=128 << 20,
        description="Bytes of answers that may wait for slow clients; beyond that new requests are refused with a 503.",
    )
    root_path: Annotated[str, Field(pattern=r"^(/[A-Za-z0-9._~-]+)*$", max_length=200)] = Field(
        default="", description="Prefix under which a proxy shows the service, such as /twin; the proxy strips it."
    )
    cors_origins: Annotated[
        tuple[str, ...],
        Field(
            max_length=100,
            json_schema_extra={"x-allowed": 'a JSON list of origins as browsers send them, ["https://a.example"]'},
        ),
        AfterValidator(_origins),
    ] = Field(
        default=(),
        description="Origins whose pages may call this service from a browser, as a JSON list; `*` for all.",
    )
    max_live_connections: Annotated[int, Field(ge=0, le=100_000)] = Field(
        default=256, description="Connections to /v1/live in each server process; the next one is refused with a 503."
    )
    max_live_rovers: Annotated[int, Field(ge=1, le=10_000)] = Field(
        default=1000, description="Rovers that one connection to /v1/live may have."
    )
    live_idle_s: Annotated[float, Field(gt=0, le=86_400)] = Field(
        default=300.0, description="Seconds without a message after which a connection to /v1/live is closed."
    )
    live_slow_s: Annotated[float, Field(gt=0, le=600)] = Field(
        default=5.0, description="Seconds in which a client of /v1/live must take an answer, or be disconnected."
    )
    log_level: Literal["debug", "info", "warning", "error"] = Field(
        default="info", description="Least severe level of the messages that are logged."
    )
    log_format: Literal["console", "json"] = Field(
        default="console", description="Log lines for people (console), or one JSON object per line (json)."
    )
    tracing: bool | None = Field(
        default=None,
        description="Whether to send spans to an OpenTelemetry collector (docs/tracing.md). By default if "
        "OTEL_EXPORTER_OTLP_ENDPOINT or OTEL_EXPORTER_OTLP_TRACES_ENDPOINT is set.",
    )
    drain_s: Annotated[float, Field(ge=0, le=600)] = Field(
        default=1.0, description="Seconds after SIGTERM in which readiness answers 503 and requests are still accepted."
    )
    shutdown_grace_s: Annotated[int, Field(ge=1, le=3600)] = Field(
        default=30, description="Seconds in which running requests may finish before they are cut off."
    )

    @property
    def admin_is_on(self) -> bool:
        """Whether there can be a token that opens the admin endpoints."""
        return self.admin_token is not None or self.tokens_file is not None

    def traces(self) -> bool:
        """Whether spans are sent: as was set, else as the standard variables of OpenTelemetry say."""
        if self.tracing is not None:
            return self.tracing
        off = os.environ.get("OTEL_SDK_DISABLED", "").lower() == "true" or os.environ.get(_EXPORTER) == "none"
        return not off and any(os.environ.get(name) for name in _ENDPOINTS)

    def jobs_url(self) -> str:
        """The SQLAlchemy URL of the jobs' database: the one that was set, else a file beside what it is about."""
        if self.jobs_database_url:
            return self.jobs_database_url
        local = self.store_url.removeprefix("file://")
        folder = platformdirs.user_state_path("rover-twin") if "://" in local else Path(local).absolute() / "jobs"
        return f"sqlite:///{folder / 'jobs.sqlite'}"


def load_settings(**overrides: Any) -> Settings:  # noqa: ANN401 - whatever the caller read from its command line
    """Settings from `overrides` (those that are not None), then the environment, then the defaults.

    Raises SettingsError with a one-line reason.
    """
    given = {name: value for name, value in overrides.items() if value is not None}
    _require_known_variables()
    given |= _from_files(given)
    try:
        return Settings(**given)
    except ValidationError as error:
        raise SettingsError(_reason(error, given)) from None
    except UnreadableError as error:  # a list that is no JSON
        field = re.search(r'field "(\w+)"', str(error))
        name = f"{PREFIX}{field[1].upper()}" if field else "a setting"
        raise SettingsError(f'{name} cannot be read, allowed is a JSON list such as ["a", "b"]') from None


def require_tokens(settings: Settings) -> None:
    """Raises SettingsError where nobody could ever be let in."""
    if settings.require_token and not settings.admin_is_on:
        raise SettingsError(f"{PREFIX}REQUIRE_TOKEN is true, and there is no token: set {PREFIX}TOKENS_FILE too")


def _from_files(known: Mapping[str, Any]) -> dict[str, str]:
    """Secrets that a file holds: the variable with _FILE at its end names it. Raises SettingsError."""
    found = {}
    for name in SECRETS:
        variable = f"{PREFIX}{name.upper()}"
        path = os.environ.get(f"{variable}_FILE")
        if not path or name in known:
            continue
        if os.environ.get(variable):
            raise SettingsError(f"both {variable} and {variable}_FILE are set; set one of them")
        try:
            found[name] = Path(path).read_text(encoding="utf-8").strip()
        except (OSError, UnicodeDecodeError) as error:
            raise SettingsError(f"{variable}_FILE names a file that cannot be read: {type(error).__name__}") from error
    return found


def _require_known_variables() -> None:
    """Raises SettingsError for a variable that would be a setting if there were one of that name."""
    known = {f"{PREFIX}{name.upper()}" for name in Settings.model_fields}
    known |= {f"{PREFIX}{name.upper()}_FILE" for name in SECRETS}
    for variable in sorted(os.environ):
        if variable.startswith(PREFIX) and variable not in known | _OF_OTHERS:
            nearest = difflib.get_close_matches(variable, known, 1, 0.0)[0]
            raise SettingsError(f"there is no setting {variable}; the nearest is {nearest}" + _links(variable))


def _links(variable: str) -> str:
    injected = variable.endswith(("_SERVICE_HOST", "_SERVICE_PORT")) or "_PORT_" in variable
    return f"; {_SERVICE_LINKS}" if injected else ""


def _reason(error: ValidationError, given: dict[str, Any]) -> str:
    first = error.errors(include_url=False)[0]
    name = str(first["loc"][0])
    shown = name if name in given else f"{PREFIX}{name.upper()}"
    known = Settings.model_json_schema()["properties"]
    if name not in known:
        return f"there is no setting {shown}; there are {', '.join(sorted(known))}"
    # what may hold a password is never shown, not even to say that it is wrong
    value = "not shown here" if name in SECRETS else repr(str(first["input"])[:100])
    reason = f"{shown} is {value}, allowed is {allowed_values(known[name])}"
    if str(first["input"]).startswith("tcp://"):
        reason += f"; {_SERVICE_LINKS}"
    return reason
