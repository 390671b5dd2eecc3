"""The address of the service, as people copy it from a browser, a page or a colleague."""

from __future__ import annotations

import re

import httpx

# Below a prefix that a gateway made, such as /teams/v1/twin, the service may well stand.
_CALL = re.compile(r"/v1/(predictions|drives|steps|live|mobility|models|admin)(/|$)")
_OTHER_PROTOCOL = re.compile(r"/v2(/(models|health|repository)(/.*)?)?$")
_BROKEN_SCHEME = re.compile(r"(https?)(?::/?|//)([^/].*)?$", re.IGNORECASE)
_PAGES = ("docs", "redoc", "openapi.json", "metrics", "health", "health/ready", "health/live")


def checked_url(base_url: str) -> httpx.URL:
    """The base address, without a `/v1` or a slash at its end.

    Raises ValueError unless it is http(s)://host, with an optional port and prefix of a proxy. The message names the
    address that was probably meant.
    """
    url = _parsed(base_url)
    path = url.path.rstrip("/").removesuffix("/v1")
    if found := _CALL.search(path):
        raise _refused(base_url, "which is that of one call", url, path[: found.start()])
    if found := _OTHER_PROTOCOL.search(path):
        raise _refused(base_url, "which is that of the Open Inference Protocol", url, path[: found.start()])
    page = next((page for page in _PAGES if path.endswith(f"/{page}")), None)
    if page is not None:
        raise _refused(base_url, f"which is that of the page /{page}", url, path.removesuffix(f"/{page}"))
    return url.copy_with(path=path or "/")


def _parsed(base_url: str) -> httpx.URL:
    if isinstance(base_url, str) and base_url and "://" not in base_url:
        if (broken := _BROKEN_SCHEME.match(base_url)) and broken[2]:
            meant = f"{broken[1].lower()}://{broken[2]}"
            raise ValueError(f"base_url is {base_url!r}, which lacks a part of its scheme: did you mean {meant!r}?")
        if not broken:
            raise ValueError(f"base_url is {base_url!r}, which lacks its scheme: did you mean 'http://{base_url}'?")
    try:
        url = httpx.URL(base_url)
    except (httpx.InvalidURL, TypeError) as fault:
        raise ValueError(f"base_url is {base_url!r}, which is not an address: {fault}") from fault
    if url.scheme not in ("http", "https") or not url.host or url.query or url.fragment:
        raise ValueError(f"base_url is {base_url!r}, allowed is http://host:port or https://host/path")
    return url


def _refused(base_url: str, what: str, url: httpx.URL, path: str) -> ValueError:
    meant = str(url.copy_with(path=path or "/")).rstrip("/")
    return ValueError(f"base_url is {base_url!r}, {what}; allowed is the address of the service: {meant!r}")
