"""Parts of answers, as Polars, DuckDB and fsspec ask for them when they read a table from an address."""

from __future__ import annotations

import io

import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.api.http.answers.ranges import Range
from tests.api.conftest import QUESTION

PLAIN = {"accept-encoding": "identity"}


def ask(service, form="parquet", method="GET", **headers):
    named = PLAIN | {name.replace("_", "-"): value for name, value in headers.items()}
    return service.client.request(method, "/v1/predictions", params=QUESTION | {"format": form}, headers=named)


@given(st.integers(0, 50), st.integers(0, 60), st.integers(0, 60))
def test_a_part_is_what_rfc_9110_says(size, first, last):
    body, whole = bytes(range(size)), slice(None)

    def taken(text):
        return body[Range(text).part(size, '"tag"') or whole]

    assert taken(f"bytes={first}-{last}") == (body[first : last + 1] if first < size and first <= last else body)
    assert taken(f"bytes={first}-") == (body[first:] if first < size else body)
    assert taken(f"bytes=-{last}") == (body[-last:] if last else body)


@pytest.mark.parametrize(
    "text",
    ["", "bytes=", "bytes=-", "bytes=a-b", "bytes=1-2,4-5", "lines=0-1", "bytes=5-2", "bytes=\uff19-"],
)
def test_what_is_no_single_range_is_ignored(text):
    assert Range(text).part(10, '"tag"') is None


def test_a_table_is_read_in_parts(service):
    """As Polars does: the length by HEAD, then the footer, then the columns."""
    head = ask(service, method="HEAD", range="bytes=0-3")
    assert (head.status_code, head.headers["accept-ranges"]) == (200, "bytes")
    whole = ask(service).content
    size = int(head.headers["content-length"])
    assert size == len(whole)

    end = ask(service, range="bytes=-8")
    assert end.status_code == 206
    assert end.headers["content-range"] == f"bytes {size - 8}-{size - 1}/{size}"
    assert end.headers["etag"] == head.headers["etag"]
    assert end.content[4:] == b"PAR1"
    halves = [ask(service, range=each) for each in (f"bytes=0-{size // 2 - 1}", f"bytes={size // 2}-")]
    body = b"".join(each.content for each in halves)
    assert body == whole
    assert pq.read_table(io.BytesIO(body)).column_names == ["time_s", "x_m", "y_m"]


def test_whoever_has_another_version_gets_all_of_this_one(service):
    tag = ask(service).headers["etag"]

    assert ask(service, range="bytes=0-3", if_range=tag).status_code == 206
    for other in ('"other"', f"W/{tag}", "Sat, 28 Nov 2026 12:00:00 GMT"):
        assert ask(service, range="bytes=0-3", if_range=other).status_code == 200


def test_who_has_it_all_is_told_so_whatever_part_is_wanted(service):
    tag = ask(service).headers["etag"]

    assert ask(service, range="bytes=0-3", if_none_match=tag).status_code == 304


def test_a_part_of_a_compressed_answer_is_a_part_of_the_compressed_bytes(service):
    def raw(**headers):
        with service.client.stream(
            "GET", "/v1/predictions", params=QUESTION, headers={"accept-encoding": "gzip", **headers}
        ) as answer:
            return answer.status_code, b"".join(answer.iter_raw())

    assert raw(range="bytes=10-99") == (206, raw()[1][10:100])


def test_what_changes_with_each_request_comes_whole(service):
    answer = service.client.post("/v1/predictions", json=QUESTION, headers={"range": "bytes=0-3"})

    assert answer.status_code == 200
    assert "accept-ranges" not in answer.headers
