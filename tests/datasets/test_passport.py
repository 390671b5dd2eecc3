from __future__ import annotations

import json

import pytest

from service.datasets.passport import Passport, parse_passport
from service.errors import DatasetError


def test_unknown_fields_are_kept_and_known_ones_typed(passport_content):
    passport_content["weather"] = {"dust": [1, 2]}
    passport = parse_passport(json.dumps(passport_content).encode())
    assert passport.rover.wheel_radius_m == 0.25
    kept = json.loads(passport.canonical_json())
    assert kept["weather"] == {"dust": [1, 2]}
    assert kept["rover"]["mass_change"] == "kept though unknown"


def test_canonical_text_does_not_depend_on_order_or_number_spelling(passport_content):
    reordered = dict(reversed(passport_content.items())) | {"rover": dict(reversed(passport_content["rover"].items()))}
    one, two = (Passport.model_validate(c).canonical_json() for c in (passport_content, reordered))
    assert one == two
    assert parse_passport(one.encode()).canonical_json() == one


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "rover-twin-passport/2"}, "major 2.*update the service"),
        ({"format": "something"}, "expected 'rover-twin-passport/1'"),
        ({"gravity_m_s2": "strong"}, "gravity_m_s2.*strong"),
        ({"gravity_m_s2": -1}, "gravity_m_s2.*-1"),
        ({"rover": {}}, r"rover\.wheel_radius_m: Field required"),
        ({"frame": ""}, "frame"),
    ],
)
def test_what_is_wrong_is_named(passport_content, change, message):
    with pytest.raises(DatasetError, match=message):
        parse_passport(json.dumps(passport_content | change).encode())


@pytest.mark.parametrize("data", [b"", b"{", b"[1]", b'{"gravity_m_s2": NaN}', b"\xff\xfe", b"[" * 100_000, b"1e999"])
def test_what_is_no_passport_at_all_is_refused(data):
    with pytest.raises(DatasetError):
        parse_passport(data)


def test_a_minor_of_the_known_major_is_read(passport_content):
    passport_content["format"] = "rover-twin-passport/1.7"
    assert parse_passport(json.dumps(passport_content).encode()).format.endswith("1.7")
