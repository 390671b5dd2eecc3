"""Answers as files of every form, and questions in the client's own words, against the service in this process."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from rover_twin_client import InvalidInputError, RoverTwin
from tests.clients.served import served
from tests.digits import in_text

pytestmark = pytest.mark.processes

TRACK = {"distance_m": [0, 2, 2.3], "slope_deg": [10, 10, 20]}
BEGINNINGS = {
    "json": b"{",
    "csv": b"time_s,x_m",
    "npz": b"PK",
    "arrow": b"\xff\xff\xff\xff",
    "usda": b"#usda 1.0",
    "svg": b"<?xml",
    "png": b"\x89PNG",
}


@pytest.fixture(scope="module")
def twin(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RoverTwin]:
    with served(tmp_path_factory.mktemp("service") / "log.txt") as url, RoverTwin(url) as twin:
        yield twin


@pytest.mark.parametrize("form", BEGINNINGS)
def test_every_form_comes_as_bytes_and_as_a_file(twin: RoverTwin, form: str, tmp_path: Path) -> None:
    content = twin.predict(28, 430, 60, form=form)
    path = twin.predict(28, 430, 60, save_to=tmp_path / f"rover.{form}")
    drive = twin.drive(430, TRACK, 100, form=form)

    assert content.startswith(BEGINNINGS[form])
    assert drive.startswith(BEGINNINGS[form])
    assert path == tmp_path / f"rover.{form}"
    if form not in ("svg", "png"):
        assert path.read_bytes() == content


def test_a_form_has_the_numbers_of_the_values(twin: RoverTwin) -> None:
    values = twin.predict(28, 430, 60, include=["band"])
    archive = np.load(io.BytesIO(twin.predict(28, 430, 60, include=["band"], form="npz")))

    for name, column in values.to_pandas().items():
        np.testing.assert_array_equal(in_text(archive)[str(name)], column)
    assert json.loads(twin.predict(28, 430, 60, form="json"))["summary"]["outcome"] == values.summary.outcome


def test_the_name_of_a_file_decides_unless_the_form_is_said(twin: RoverTwin, tmp_path: Path) -> None:
    assert twin.predict(28, 430, 60, form="csv", save_to=tmp_path / "table.txt").read_bytes().startswith(b"time_s")
    with pytest.raises(InvalidInputError, match=r"save_to is .*allowed is a file whose name ends with a form"):
        twin.predict(28, 430, 60, save_to=tmp_path / "table")


def test_a_form_that_there_is_not_is_refused_in_the_clients_words(twin: RoverTwin, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"^form is 'docx', allowed is one of json, csv") as caught:
        twin.predict(28, 430, 60, save_to=tmp_path / "rover.docx")

    assert [fault.field for fault in caught.value.faults] == ["form"]
    assert list(tmp_path.iterdir()) == []


def test_a_refused_number_is_the_number_that_was_given(twin: RoverTwin) -> None:
    with pytest.raises(InvalidInputError, match=r"^slope_deg is 280\.0, allowed is") as caught:
        twin.predict(280, 430, 60)

    assert caught.value.faults[0].value == 280.0


def test_many_times_of_its_own_fit_a_question(twin: RoverTwin) -> None:
    times_s = np.linspace(0, 10, 20_001)

    np.testing.assert_array_equal(twin.predict(28, 430, 60, times_s=times_s).time_s, times_s)
    with pytest.raises(InvalidInputError, match="horizon_s is 5"):
        twin.predict(28, 430, 60, 5.0, times_s=times_s)


def test_drives_show_themselves(twin: RoverTwin) -> None:
    from matplotlib.figure import Figure

    drive = twin.drive(430, TRACK, 100, until_distance_m=4, include=["band"])
    table = drive.to_pandas()

    np.testing.assert_array_equal(table["brake"], drive.brake)
    np.testing.assert_array_equal(drive.to_xarray()["speed_m_s"], drive.speed_m_s)
    assert drive.to_polars().columns == list(table)
    assert "arrives after" in repr(drive)
    assert "<svg" in drive._repr_html_()
    assert drive.plot("speed_m_s", ax=Figure().subplots()).get_ylabel() == "speed (m/s)"
