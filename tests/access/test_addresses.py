"""The client's address: a header counts as far as trusted proxies wrote it, and no further."""

from __future__ import annotations

import ipaddress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.access.addresses import client_address, networks, subscriber

PROXIES = networks(["10.0.0.0/8", "2001:db8:ffff::/48"])
ADDRESSES = st.ip_addresses().map(str)


@pytest.mark.parametrize(
    ("peer", "forwarded", "found"),
    [
        ("192.0.2.1", [], "192.0.2.1"),
        ("192.0.2.1", ["198.51.100.7"], "192.0.2.1"),  # not a proxy: it may say anything
        ("10.0.0.1", ["198.51.100.7"], "198.51.100.7"),
        ("10.0.0.1", ["203.0.113.9, 198.51.100.7"], "198.51.100.7"),  # the left one was sent by the client
        ("10.0.0.1", ["203.0.113.9", "198.51.100.7"], "198.51.100.7"),
        ("10.0.0.1", ["198.51.100.7, 10.2.3.4"], "198.51.100.7"),
        ("10.0.0.1", ["10.9.9.9"], "10.9.9.9"),
        ("10.0.0.1", ["198.51.100.7:4711"], "198.51.100.7"),
        ("10.0.0.1", ["[2001:db8::7]:4711"], "2001:db8::7"),
        ("10.0.0.1", ["2001:db8::7"], "2001:db8::7"),
        ("10.0.0.1", ["198.51.100.7, unknown"], "10.0.0.1"),
        ("10.0.0.1", ["198.51.100.7, "], "10.0.0.1"),
        ("10.0.0.1", ["' OR 1=1, 10.0.0.2"], "10.0.0.2"),
        ("::ffff:10.0.0.1", ["198.51.100.7"], "198.51.100.7"),
        ("2001:db8:ffff::1", ["2001:db8::7"], "2001:db8::7"),
        (None, ["198.51.100.7"], "unknown"),
    ],
)
def test_from_the_right_and_past_trusted_proxies_only(peer, forwarded, found):
    assert client_address(peer, forwarded, PROXIES) == found


@given(st.lists(st.text(max_size=30), max_size=5), ADDRESSES)
def test_whatever_a_stranger_sends_his_address_is_his(header, peer):
    if any(ipaddress.ip_address(peer) in each for each in PROXIES):
        return
    assert client_address(peer, header, PROXIES) == peer
    assert client_address(peer, header, ()) == peer


@given(st.lists(st.text(max_size=30), max_size=3), ADDRESSES)
def test_what_a_client_writes_left_of_the_proxys_entry_counts_for_nothing(invented, client):
    parsed = ipaddress.ip_address(client)
    mapped = getattr(parsed, "ipv4_mapped", None)
    if "%" in client or mapped or any(parsed in each for each in PROXIES):
        return
    assert client_address("10.0.0.1", [*invented, client], PROXIES) == str(parsed)


@given(st.text(max_size=100))
def test_any_header_gives_an_address(text):
    found = client_address("10.0.0.1", [text], PROXIES)

    assert len(found) <= 45
    ipaddress.ip_address(found)


def test_a_subscriber_of_ipv6_is_his_64_bits():
    assert subscriber("2001:db8::1") == subscriber("2001:db8::ffff:1") == "2001:db8::/64"
    assert subscriber("2001:db8:0:1::1") != subscriber("2001:db8::1")
    assert subscriber("192.0.2.1") == subscriber("::ffff:192.0.2.1") == "192.0.2.1"
    assert subscriber("192.0.2.1") != subscriber("192.0.2.2")
    assert subscriber("unknown") == "unknown"
