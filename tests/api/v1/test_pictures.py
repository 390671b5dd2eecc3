"""Maps, drives, cards, comparisons and datasets for people: pictures and pages that say what the JSON answer says."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

import model_store
from service.wire.mobility import MobilityAnswer
from service.wire.versions.card import CardAnswer
from service.wire.versions.comparison import ComparisonAnswer
from tests.api.conftest import QUESTION, TOKEN, Running, serving
from tests.pictures.looking import leaves, require_page, require_png, require_svg

BROWSER = "text/html,application/xhtml+xml,application/xml;q=0.9,image/avif,image/webp,*/*;q=0.8"
MAP = {"mass_kg": 430, "torque_min_nm": 30, "torque_max_nm": 140, "torque_steps": 3}
MAP |= {"slope_max_deg": 40, "slope_steps": 6, "horizon_s": 4}
DRIVE = {
    "mass_kg": 430,
    "track": {"distance_m": [0, 4, 8], "slope_deg": [10, 28, 40]},
    "controls": {"time_s": [0, 4, 5], "torque_nm": [80, 0, 80], "brake": [False, True, False]},
    "horizon_s": 30,
    "include": ["band"],
}
VERSION = "/v1/models/viper-lunar/versions/5"
ADDRESSES = {
    "prediction": ("/v1/predictions", QUESTION | {"include": "band,prior"}, (7.5, 5.4)),
    "map": ("/v1/mobility", MAP, (8.2, 5.6)),
    "card": (f"{VERSION}/card", {}, (10.5, 5.0)),
    "comparison": (f"{VERSION}/comparison", {"against": "viper-lunar@1", "slopes_deg": "0,20,35"}, (10.5, 5.6)),
}
ANSWERS = {"map": MobilityAnswer, "card": CardAnswer, "comparison": ComparisonAnswer}

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def shipped(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """A service over the models that ship, and one of their datasets."""
    folder = tmp_path_factory.mktemp("shipped")
    for part in ("models", "datasets"):
        shutil.copytree(Path(model_store.__file__).parent / part, folder / part)
    with serving(folder, admin_token=TOKEN, start_worker=False) as running:
        running.wait_ready()
        yield running


def ask(running: Running, name: str, form: str | None = None, **headers: str):
    path, query, _ = ADDRESSES[name]
    asked = query if form is None else query | {"format": form}
    answer = running.client.get(path, params=asked, headers=headers)
    assert answer.status_code == 200, answer.text
    return answer


@pytest.mark.parametrize("name", ADDRESSES)
def test_a_picture_explains_itself_and_is_the_same_each_time(shipped, name):
    svg, png = ask(shipped, name, "svg"), ask(shipped, name, "png")

    require_svg(svg.content)
    require_png(png.content, ADDRESSES[name][2])
    assert svg.headers["content-type"] == "image/svg+xml"
    assert svg.content == ask(shipped, name, "svg").content
    assert len(svg.content) < 250_000


@pytest.mark.parametrize("name", ADDRESSES)
def test_a_page_asks_for_nothing_and_its_numbers_are_those_of_the_answer(shipped, name):
    answer, page = ask(shipped, name, "html"), ask(shipped, name, "json").json()

    assert answer.headers["content-type"].startswith("text/html")
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    shown = require_page(answer.content).numbers()
    derived = {float(len(page["slope_deg"]) * len(page["torque_nm"]))} if name == "map" else set()
    assert len(shown) > 20
    assert shown <= leaves(page) | derived


@pytest.mark.parametrize("name", ANSWERS)
def test_json_is_what_everyone_but_a_browser_gets(shipped, name):
    for accept in ("*/*", "application/json"):
        answer = ask(shipped, name, accept=accept)
        assert ANSWERS[name].model_validate(answer.json()).model_dump(mode="json") == answer.json()
    assert ask(shipped, name, accept=BROWSER).content == ask(shipped, name, "html").content
    assert ask(shipped, name, accept="image/svg+xml").content == ask(shipped, name, "svg").content
    assert "Accept" in ask(shipped, name).headers["vary"]


@pytest.mark.parametrize("name", ADDRESSES)
@pytest.mark.parametrize("form", ["json", "svg", "html"])
def test_who_has_a_picture_is_not_sent_it_again(shipped, name, form):
    tag = ask(shipped, name, form).headers["etag"]
    path, query, _ = ADDRESSES[name]
    again = shipped.client.get(path, params=query | {"format": form}, headers={"if-none-match": tag})

    assert (again.status_code, again.content) == (304, b"")


@pytest.mark.parametrize(
    "change", [{"torque_max_nm": None}, {"slope_min_deg": 40}, {"torque_max_nm": None, "slope_min_deg": 40}]
)
def test_a_map_of_one_row_or_column_is_a_picture_too(shipped, change):
    asked = {key: value for key, value in (MAP | change).items() if value is not None}
    for form, require in (("svg", require_svg), ("html", require_page)):
        answer = shipped.client.get("/v1/mobility", params=asked | {"format": form})
        assert answer.status_code == 200, answer.text
        require(answer.content)


def test_a_drive_is_seen_from_the_side_with_its_events(shipped):
    found = {}
    for form in ("json", "svg", "png", "html"):
        answer = shipped.client.post("/v1/drives", params={"format": form}, json=DRIVE)
        assert answer.status_code == 200, answer.text
        found[form] = answer
    require_svg(found["svg"].content)
    require_png(found["png"].content, (7.5, 2.6 + 1.45 * 5 + 1.55))
    page, document = require_page(found["html"].content), found["json"].json()
    assert page.numbers() <= leaves(document)
    assert document["events"]
    for event in document["events"]:
        assert {event["time_s"], event["x_m"]} <= page.numbers()


@pytest.mark.processes
def test_a_dataset_is_a_page_with_every_run(shipped):
    admin = {"authorization": f"Bearer {TOKEN}"}
    answer = shipped.client.get("/v1/admin/datasets/drive/preview", params={"format": "html"}, headers=admin)
    summary = shipped.store.dataset("drive").summary

    assert answer.status_code == 200, answer.text
    assert answer.headers["content-security-policy"].startswith("default-src 'none'")
    page = require_page(answer.content)
    assert {float(summary["runs"]), float(summary["rows"])} <= page.numbers()
    assert sum(tag == "tr" for tag, _ in page.elements) == summary["runs"] + 1


def test_a_comparison_says_what_the_gate_says_and_how_far_apart_they_end(shipped):
    answer = ask(shipped, "comparison", "json").json()

    assert (answer["candidate"], answer["against"]) == ("viper-lunar@5", "viper-lunar@1")
    assert answer["promote"] is (answer["verdict"] == "better")
    assert sum(each["runs"] for each in answer["regimes"]) == answer["common_runs"]
    assert [each["slope_deg"] for each in answer["curves"]["slopes"]] == [0, 20, 35]
    for each in answer["curves"]["slopes"]:
        one = QUESTION | {"slope_deg": each["slope_deg"], "mass_kg": 430, "torque_nm": 60, "horizon_s": 10}
        single = shipped.client.get("/v1/predictions", params=one | {"model": "viper-lunar@5"}).json()
        assert each["candidate_x_m"][-1] == pytest.approx(single["trajectory"]["x_m"][-1])
        assert each["candidate_outcome"] == single["summary"]["outcome"]
        assert each["final_difference_m"] == each["candidate_x_m"][-1] - each["against_x_m"][-1]


def test_without_another_version_it_is_the_champion_that_one_is_compared_with(shipped):
    answer = shipped.client.get("/v1/models/viper-lunar/versions/1/comparison").json()

    assert (answer["candidate"], answer["against"]) == ("viper-lunar@1", "viper-lunar@5")
    itself = shipped.client.get(f"{VERSION}/comparison").json()
    assert itself["ratio"] == 1
    assert all(each["final_difference_m"] == 0 for each in itself["curves"]["slopes"])


@pytest.mark.parametrize(
    ("query", "status"),
    [
        ({"against": "nobody"}, 404), ({"against": "viper-lunar@9"}, 404), ({"against": "viper-lunar@new"}, 404),
        ({"against": "<script>"}, 422), ({"against": "a@0"}, 422),
        ({"against": "-a"}, 422), ({"slopes_deg": "0,nan"}, 422), ({"slopes_deg": ",".join(["1"] * 13)}, 422),
        ({"mass_kg": "0"}, 422), ({"margin": "0.9"}, 422), ({"format": "pdf"}, 422), ({"else": "1"}, 422),
    ],
)  # fmt: skip
def test_what_cannot_be_compared_is_refused(shipped, query, status):
    answer = shipped.client.get(f"{VERSION}/comparison", params=query)

    assert answer.status_code == status, answer.text


def test_a_card_of_nothing_is_not_there(shipped):
    for path in ("/v1/models/viper-lunar/versions/9/card", "/v1/models/<b>/versions/1/card"):
        assert shipped.client.get(path).status_code == 404


def test_a_card_counts_every_left_out_run_once_and_warns_of_what_it_does_not_know(shipped):
    card = ask(shipped, "card", "json").json()

    assert sum(each["runs"] for each in card["regimes"]) == card["left_out_runs"] == 164
    assert any("slides back" in each for each in card["not_for"])
    assert card["domain"]["slope_deg"] == [-25, 32]
    assert next(each["name"] for each in card["datasets"]) == "paper"
    old = shipped.client.get("/v1/models/viper-lunar/versions/1/card").json()
    assert any("no band" in each for each in old["not_for"])


def test_an_archived_version_has_a_card_that_says_so_and_no_curves(shipped):
    store = shipped.store
    store.archive_version("viper-lunar", 1, actor="tests", reason="old")
    try:
        card = shipped.client.get("/v1/models/viper-lunar/versions/1/card").json()
        beside = shipped.client.get(f"{VERSION}/comparison", params={"against": "viper-lunar@1"})
    finally:
        store.restore_version("viper-lunar", 1, actor="tests", reason="")

    assert card["state"] == "archived"
    assert "archived" in card["not_for"][0]
    assert beside.json()["curves"] is None
    assert "archived" in beside.json()["curves_missing"]
