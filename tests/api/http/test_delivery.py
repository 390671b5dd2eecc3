"""How answers travel: caches are told the truth, who has an answer is not sent it again, text is compressed."""

from __future__ import annotations

import gzip
from itertools import combinations

import pytest
import zstandard

from service.api.http.answers.compression import SMALLEST_BYTES, Coding, choose_coding
from service.twin import Twin
from tests.api.conftest import QUESTION, move_alias, publish_version

PLAIN = {"accept-encoding": "identity"}
MAP = {"mass_kg": 430, "torque_min_nm": 30, "slope_steps": 3}
ADDRESSES = {
    "prediction": ("/v1/predictions", QUESTION),
    "mobility": ("/v1/mobility", MAP),
    "manifest": ("/v1/models/viper-lunar/versions/1", {}),
}
TEXT_FORMS, OTHER_FORMS = ("json", "csv", "usda", "svg", "html"), ("npz", "arrow", "parquet", "png")
DECODERS = {
    "gzip": gzip.decompress,
    "zstd": lambda body: zstandard.ZstdDecompressor().decompressobj().decompress(body),
    None: bytes,
}


def raw(service, path="/v1/predictions", query=QUESTION, **headers):
    """Status, headers and the body as it came over the wire."""
    named = PLAIN | {name.replace("_", "-"): value for name, value in headers.items()}
    with service.client.stream("GET", path, params=query, headers=named) as answer:
        return answer.status_code, answer.headers, b"".join(answer.iter_raw())


@pytest.mark.parametrize("address", ADDRESSES)
def test_who_has_the_answer_is_not_sent_it_again(service, address):
    _, headers, body = raw(service, *ADDRESSES[address])
    tag = headers["etag"]
    assert tag.startswith('"')  # strong

    for known in (tag, f"W/{tag}", f'"other", {tag}'):
        status, again, nothing = raw(service, *ADDRESSES[address], if_none_match=known)
        assert (status, nothing) == (304, b"")
        for name in ("etag", "cache-control", "vary"):
            assert again[name] == headers[name]
    for unknown in ('"other"', tag.strip('"'), tag[:-2] + '"', '""', "*garbage"):
        assert raw(service, *ADDRESSES[address], if_none_match=unknown)[::2] == (200, body)


def test_not_modified_is_said_without_arithmetic(service, monkeypatch):
    tags = {address: raw(service, *ADDRESSES[address])[1]["etag"] for address in ("prediction", "mobility")}
    for arithmetic in ("predict_many", "predict", "likely_outcomes", "slip_ratios"):
        monkeypatch.delattr(Twin, arithmetic)

    for address, tag in tags.items():
        assert raw(service, *ADDRESSES[address], if_none_match=tag)[0] == 304


def test_the_tag_is_that_of_the_question_however_it_is_put(service):
    tags = {
        raw(service, query=query)[1]["etag"]
        for query in (
            QUESTION,
            {name: f"{value:.3f}" for name, value in reversed(QUESTION.items())},
            QUESTION | {"horizon_s": 10, "dt_s": 0.05, "band_level": 0.7, "strict": "no", "format": "json"},
            QUESTION | {"model": "viper-lunar"},
        )
    }

    assert len(tags) == 1
    both = [raw(service, query=QUESTION | {"include": each})[1]["etag"] for each in ("prior", "prior,prior")]
    assert both[0] == both[1]


CHANGES = (
    {}, {"slope_deg": 27}, {"mass_kg": 431}, {"torque_nm": 61}, {"horizon_s": 9}, {"dt_s": 0.1},
    {"times_s": "0,10"}, {"frame": "world"}, {"include": "prior"}, {"strict": "true"}, {"model": "viper-lunar@1"},
    {"model": "viper-lunar@2"}, *({"format": form} for form in (*TEXT_FORMS[1:], *OTHER_FORMS)),
)  # fmt: skip


@pytest.mark.slow
def test_other_answers_have_other_tags(service):
    tags = [raw(service, query=QUESTION | change)[1]["etag"] for change in CHANGES]
    tags += [raw(service, accept_encoding=coding)[1]["etag"] for coding in ("gzip", "zstd")]

    assert all(one != other for one, other in combinations(tags, 2))


@pytest.mark.parametrize(
    ("model", "cached"),
    [
        ("viper-lunar@1", "max-age=86400, immutable"),
        ("viper-lunar@champion", "no-cache"),
        ("viper-lunar", "no-cache"),
        (None, "no-cache"),
    ],
)
@pytest.mark.parametrize("address", ["prediction", "mobility"])
def test_only_a_version_asked_for_by_number_is_immutable(service, address, model, cached):
    path, query = ADDRESSES[address]

    assert raw(service, path, query | ({"model": model} if model else {}))[1]["cache-control"] == cached


@pytest.mark.slow
def test_a_default_that_is_a_number_may_be_another_tomorrow(serve, store):
    publish_version(store)
    service = serve(default_model="viper-lunar@1")

    assert raw(service)[1]["cache-control"] == "no-cache"


def test_a_manifest_is_immutable_and_tells_no_cache_of_a_missing_one(service):
    assert raw(service, *ADDRESSES["manifest"])[1]["cache-control"] == "max-age=86400, immutable"
    assert "cache-control" not in raw(service, "/v1/models/viper-lunar/versions/99", {})[1]


@pytest.mark.slow
def test_when_the_alias_moves_the_tag_does(serve, store):
    move_alias(store, publish_version(store))
    service = serve(refresh_s=0.05)
    service.wait_ready()
    _, before, body = raw(service)
    move_alias(store, publish_version(store, coefficient=0.2))
    status, after, other = raw(service, if_none_match=before["etag"])
    for _ in range(200):
        if status == 200:
            break
        status, after, other = raw(service, if_none_match=before["etag"])

    assert status == 200
    assert after["etag"] != before["etag"]
    assert other != body


def test_a_post_is_nobodys_to_keep(service):
    answer = service.client.post("/v1/predictions", json=QUESTION, headers={"if-none-match": raw(service)[1]["etag"]})

    assert answer.status_code == 200
    assert not {"etag", "cache-control"} & set(answer.headers)


@pytest.mark.slow
@pytest.mark.parametrize("form", [*TEXT_FORMS, *OTHER_FORMS])
@pytest.mark.parametrize("coding", ["gzip", "zstd"])
def test_text_is_compressed_for_who_asks_and_nothing_else_is(service, form, coding):
    query = QUESTION | {"format": form}
    _, _, plain = raw(service, query=query)
    _, headers, body = raw(service, query=query, accept_encoding=coding)

    assert headers.get("content-encoding") == (coding if form in TEXT_FORMS else None)
    assert DECODERS[headers.get("content-encoding")](body) == plain
    assert len(body) == int(headers["content-length"])
    assert len(body) < 0.7 * len(plain) or form in OTHER_FORMS
    assert headers["vary"] == "Accept, Accept-Encoding"


@pytest.mark.parametrize("address", ADDRESSES)
def test_every_cached_answer_can_be_compressed(banded, address):
    path, query = ADDRESSES[address]
    _, headers, body = raw(banded, path, query | ({"slope_steps": 36} if query is MAP else {}), accept_encoding="zstd")

    assert headers["content-encoding"] == "zstd"
    assert DECODERS["zstd"](body).startswith(b"{")


def test_what_fits_one_packet_is_left_alone(service):
    _, headers, body = raw(service, query=QUESTION | {"times_s": "1,10"}, accept_encoding="gzip, zstd")

    assert len(body) < SMALLEST_BYTES
    assert "content-encoding" not in headers


@pytest.mark.parametrize(
    ("accepted", "coding"),
    [
        (None, "identity"),
        ("", "identity"),
        ("identity", "identity"),
        ("br", "identity"),
        ("gzip", "gzip"),
        ("GZIP", "gzip"),
        ("gzip, deflate, br, zstd", "zstd"),
        ("gzip;q=1.0, zstd;q=0.5", "zstd"),
        ("gzip, zstd;q=0", "gzip"),
        ("gzip ; q = 0.000", "identity"),
        ("*", "zstd"),
        ("zstd;q=0, *", "gzip"),
        ("*;q=0", "identity"),
        ("gzip;q=nonsense", "identity"),
        (",;=,", "identity"),
    ],
)
def test_the_coding_is_one_that_the_client_accepts(accepted, coding):
    assert choose_coding(accepted) is Coding(coding)
