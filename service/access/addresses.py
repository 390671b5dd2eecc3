"""The address of a client, behind proxies too. `X-Forwarded-For` is believed as far as trusted proxies wrote it."""

from __future__ import annotations

import ipaddress
from collections.abc import Iterable, Sequence

Network = ipaddress.IPv4Network | ipaddress.IPv6Network
UNKNOWN = "unknown"
_MOST_HOPS = 32
_SUBSCRIBER_BITS = 64  # of an IPv6 address: whoever has one has all that share these


def networks(texts: Iterable[str]) -> tuple[Network, ...]:
    """Addresses and networks such as 10.0.0.0/8. Raises ValueError."""
    return tuple(ipaddress.ip_network(text) for text in texts)


def client_address(peer: str | None, forwarded: Sequence[str], trusted: Sequence[Network]) -> str:
    """The nearest address that no trusted proxy has: `peer` itself, or an entry of the X-Forwarded-For headers.

    Each proxy appends the address that it was called from, so the list is read from its right end, and only as long as
    a trusted proxy has written the entry: what is left of that may be anything. An entry that is no address ends the
    search at the proxy that wrote it.
    """
    if peer is None:
        return UNKNOWN
    if not trusted or not forwarded:
        return peer
    found = peer
    entries = ",".join(forwarded).split(",")
    for entry in reversed(entries[-_MOST_HOPS:]):
        if not _is_in(found, trusted) or (before := _plain(entry)) is None:
            break
        found = before
    return found


def subscriber(address: str) -> str:
    """What an address counts as where tries are counted: itself, or of IPv6 the /64 that one subscriber has."""
    parsed = _parsed(address)
    if isinstance(parsed, ipaddress.IPv6Address):
        return str(ipaddress.ip_network((parsed, _SUBSCRIBER_BITS), strict=False))
    return address if parsed is None else str(parsed)


def _is_in(address: str, trusted: Sequence[Network]) -> bool:
    parsed = _parsed(address)
    return parsed is not None and any(parsed in each for each in trusted)


def _plain(entry: str) -> str | None:
    """An entry without the port that some proxies add: 192.0.2.1:80, [2001:db8::1]:80."""
    text = entry.strip()
    if text.startswith("["):
        text = text[1:].partition("]")[0]
    elif text.count(":") == 1:
        text = text.partition(":")[0]
    parsed = _parsed(text)
    return None if parsed is None else str(parsed)


def _parsed(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """An address; one of IPv4 that is written as IPv6 (::ffff:192.0.2.1) is one of IPv4."""
    if len(text) > 64 or "%" in text:  # a zone means nothing to anybody else
        text = text.partition("%")[0][:64]
    try:
        parsed = ipaddress.ip_address(text)
    except ValueError:
        return None
    mapped = parsed.ipv4_mapped if isinstance(parsed, ipaddress.IPv6Address) else None
    return mapped or parsed
