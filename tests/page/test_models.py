"""The view Models and training: cards, comparisons, aliases, uploads, and what it says to who may not."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import httpx
import numpy as np
import pytest

from service.access.token_file import StoredToken, add
from service.access.tokens import digest_of, new_token
from service.settings import Settings
from tests.api.chrono_uploads import archive, run_text
from tests.api.conftest import ADMIN, TOKEN, Running, publish_version, serving
from tests.page.conftest import PHONE, Seen
from tests.training.stored import put_dataset, stored_runs

HOSTILE = "<img src=x onerror=document.title=1><b>bold</b>"
PARTS = ("card", "compare", "aliases", "data", "jobs")
READY = {
    "card": "[data-part=card][data-shown]",
    "compare": "[data-part=compare] [data-shown*=slope_deg]",
    "aliases": "[data-part=aliases][data-shown]",
    "data": "[data-part=data][data-shown]",
    "jobs": "[data-part=jobs] [data-shown]",
}
KEPT = "JSON.stringify([localStorage, sessionStorage, document.cookie, location.href, history.state])"


@pytest.fixture(scope="module")
def admin_service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """A service with a token over a copy of the shipped models, for tests that move no alias."""
    folder = tmp_path_factory.mktemp("copy") / "store"
    shutil.copytree(Path(Settings().store_url) / "models", folder / "models")
    with serving(folder, admin_token=TOKEN, start_worker=False) as running:
        running.client.headers.update(ADMIN)
        put_dataset(running.store, "unit", stored_runs())
        running.wait_ready()
        yield running


@pytest.fixture
def three(serve, store, publish, move) -> Running:
    """A service of the test's own: three versions, champion went from 1 to 2."""
    for coefficient in (0.1, 0.2, 0.3):
        publish(store, coefficient=coefficient)
    move(store, 1)
    move(store, 2)
    running: Running = serve(admin_token=TOKEN, start_worker=False)
    running.wait_ready()
    return running


def opened(seen: Seen, part: str, more: str = "", token: str = TOKEN):
    """The part of the view, with the token given when it is asked for."""
    seen.forgiven = ("401", "409", "412", "422")
    page = seen.go(f"#models?show={part}{more}")
    if part in ("data", "jobs"):
        enter(page, token)
    page.wait_for_selector(READY[part])
    return page


def enter(page, token):
    page.get_by_label("Token", exact=True).fill(token)
    page.get_by_role("button", name="Use", exact=True).click()


def with_token(seen: Seen, part: str, more: str = ""):
    """The part, with a token given before."""
    page = opened(seen, part, more)
    page.get_by_role("button", name="Token", exact=True).click()
    enter(page, TOKEN)
    page.get_by_role("button", name="Token in use").wait_for()
    page.wait_for_selector(READY[part])
    return page


def test_the_card_says_what_the_manifest_says(seen, shipped):
    page = opened(seen, "card", "&model=viper-lunar&version=5")
    manifest = shipped.get("/v1/models/viper-lunar/versions/5").json()
    runs = manifest["metrics"]["left_out"]["by_run"]
    table = page.get_by_role("region", name="Errors by what the rover did")

    names = table.locator("tbody th").all_inner_texts()
    told = [float(each.get_attribute("value")) for each in table.locator('[data-name="median_m"]').all()]
    regimes = shipped.get("/v1/models/viper-lunar/versions/5/card", format="json").json()["regimes"]
    assert dict(zip(names, told, strict=True)) == {each["regime"]: each["final"]["median_m"] for each in regimes}
    assert sum(each["runs"] for each in regimes) == len(runs)
    assert f"At the end of {len(runs)} runs" in page.locator("div[data-part=card]").inner_text()
    assert page.get_by_text(manifest["lineage"]["code_version"]).is_visible()
    assert page.get_by_text(manifest["lineage"]["command"]).is_visible()
    page.get_by_text("Every run").click()
    assert page.get_by_role("region", name="Errors of every run").locator("tbody tr").count() == len(runs)
    assert seen.violations() == []


def test_two_versions_are_compared_by_two_predictions_and_the_address_holds_them(seen, open_at, shipped):
    page = opened(seen, "compare", "&model=viper-lunar&version=5&with=viper-lunar@1&slope_deg=20")
    for number, version in enumerate((5, 1)):
        question = {"slope_deg": 20, "mass_kg": 430, "torque_nm": 60, "horizon_s": 10}
        answer = shipped.get("/v1/predictions", **question, model=f"viper-lunar@{version}").json()
        told = page.locator(f'[data-name="final_x_m_{number}"]').get_attribute("value")
        assert float(told) == answer["summary"]["final_x_m"]
    page.wait_for_selector('[data-part=compare][data-shown="viper-lunar@5 viper-lunar@1"]')
    compared = shipped.get(
        "/v1/models/viper-lunar/versions/5/comparison", against="viper-lunar@1", slopes_deg="0", format="json"
    ).json()
    assert page.get_by_text(compared["sentence"]).is_visible()
    rows = page.get_by_role("region", name="Errors of both").locator("tbody th")
    assert rows.all_inner_texts() == [each["regime"] for each in compared["regimes"]]
    page.get_by_label("with").select_option("viper-lunar-paper@1")
    page.wait_for_selector('[data-part=compare][data-shown="viper-lunar@5 viper-lunar-paper@1"]')
    other = open_at(shipped.url).go(page.evaluate("location.hash"))

    other.wait_for_selector('[data-part=compare][data-shown="viper-lunar@5 viper-lunar-paper@1"]')
    assert other.locator("#field-slope_deg").input_value() == "20"


def test_a_service_without_token_says_how_to_turn_uploads_on(seen):
    seen.forgiven = ("403",)
    page = seen.go("#models?show=data")
    page.wait_for_selector('[data-refused="admin-off"]')

    assert "ROVER_TWIN_ADMIN_TOKEN" in page.locator("main").inner_text()
    assert seen.violations() == []
    page.get_by_role("link", name="Version", exact=True).click()
    page.get_by_role("button", name="Promote").click()
    page.locator('[data-part=card] [data-refused="admin-off"]').wait_for()


def test_wrong_tokens_are_told_in_plain_words_and_slowed(open_at, serve, store, publish, move):
    move(store, publish(store))
    running = serve(admin_token=TOKEN, start_worker=False, failed_logins_free=1)
    seen = open_at(running.url)
    seen.forgiven = ("401", "429")
    page = seen.go("#models?show=jobs")
    for _ in range(6):  # by the last of them the next one has to wait for half a minute
        httpx.get(f"{running.url}/v1/admin/training-jobs", headers={"authorization": "Bearer wrong"}, trust_env=False)
    enter(page, "not the token")
    page.locator('[data-refused="too-many-attempts"]').wait_for()
    assert "The right one is let in at once" in page.locator("main").inner_text()
    page.get_by_role("button", name="Use another token").click()
    enter(page, TOKEN)
    page.wait_for_selector(READY["jobs"])

    assert TOKEN not in page.evaluate(KEPT)


def test_a_token_that_may_only_read_is_told_so(open_at, serve, store, publish, move, tmp_path):
    move(store, publish(store))
    token = new_token()
    add(tmp_path / "tokens", StoredToken("bob", "read", digest_of(token.encode())))
    seen = open_at(serve(tokens_file=tmp_path / "tokens", start_worker=False).url)
    seen.forgiven = ("401", "403")
    page = seen.go("#models?show=data")
    enter(page, token)
    page.wait_for_selector(READY["data"])  # it may look
    page.set_input_files("#upload-file", {"name": "a.zip", "mimeType": "application/zip", "buffer": archive(1)})
    page.locator('[data-refused="insufficient-scope"]').wait_for()

    assert "This token may only read" in page.locator("main").inner_text()


def test_a_job_is_asked_for_and_cancelled(open_at, admin_service):
    page = opened(open_at(admin_service.url), "jobs", "&dataset=unit")
    page.locator("#job-architecture").select_option("zero")
    page.locator("#job-description").fill("to be cancelled")
    page.get_by_role("button", name="Start training").click()
    page.locator("[data-job][data-state=queued]").wait_for()
    job = page.locator("[data-job]").get_attribute("data-job")
    asked = admin_service.get(f"/v1/admin/training-jobs/{job}").json()["request"]
    assert (asked["model"], asked["architecture"], asked["description"]) == ("viper-lunar", "zero", "to be cancelled")
    assert job in page.evaluate("location.hash")
    page.get_by_role("button", name="Cancel the job…").click()
    page.get_by_role("dialog").get_by_role("button", name="Keep it running").click()
    assert page.get_by_role("dialog").count() == 0
    page.get_by_role("button", name="Cancel the job…").click()
    page.get_by_role("dialog").get_by_role("button", name="Cancel the job").click()
    page.locator("[data-job][data-state=cancelled]").wait_for()

    assert admin_service.get(f"/v1/admin/training-jobs/{job}").json()["state"] == "cancelled"
    assert page.get_by_role("button", name="Cancel the job…").is_hidden()
    page.get_by_role("region", name="All jobs").get_by_text("cancelled").wait_for()


def test_what_a_job_cannot_do_is_told_where_it_was_asked(open_at, admin_service):
    page = opened(open_at(admin_service.url), "jobs", "&dataset=unit")
    page.get_by_text("Advanced").click()
    page.locator("#job-split-test_slopes_deg").fill("44, 45")
    page.get_by_role("button", name="Start training").click()

    page.wait_for_selector("#job-split-test_slopes_deg[aria-invalid]")
    assert "nearest are" in page.locator("#job-split-test_slopes_deg-hint").inner_text()


def test_an_alias_moves_only_from_where_it_was_seen_and_rolls_back(open_at, three):
    seen = open_at(three.url)
    page = with_token(seen, "card", "&model=viper-lunar&version=3")
    page.get_by_role("button", name="Promote").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_role("button", name="Move champion from 2 to 3").wait_for()
    assert seen.violations() == []
    three.store.move_alias("viper-lunar", "champion", 1, actor="somebody", reason="meanwhile")
    dialog.get_by_label("Reason, kept in the history").fill(HOSTILE)
    dialog.get_by_role("button", name="Move champion from 2 to 3").click()
    dialog.locator('[data-refused="precondition-failed"]').wait_for()
    assert three.store.alias("viper-lunar", "champion").version == 1
    assert "by somebody: meanwhile" in dialog.inner_text()
    dialog.get_by_role("button", name="Move champion from 1 to 3").click()
    dialog.wait_for(state="detached")
    record = three.store.alias("viper-lunar", "champion")
    assert (record.version, record.actor, record.reason) == (3, "admin", HOSTILE)

    page.get_by_role("link", name="Aliases").click()
    page.get_by_role("cell", name=HOSTILE).wait_for()
    page.get_by_role("button", name="Roll back").click()
    dialog.get_by_label("Reason, kept in the history").fill("too steep")
    dialog.get_by_role("button", name="Move champion from 3 back to 1").click()
    page.get_by_role("cell", name="too steep").wait_for()
    assert three.store.alias("viper-lunar", "champion").version == 1
    assert page.locator("main img").count() == 0
    assert TOKEN not in page.evaluate(KEPT)


def test_a_version_is_archived_and_restored(open_at, three):
    page = with_token(open_at(three.url), "card", "&model=viper-lunar&version=3")
    for verb, state in (("Archive", "archived"), ("Restore", "published")):
        page.get_by_role("button", name=f"{verb}…").click()
        page.get_by_role("dialog").get_by_role("button", name=f"{verb} version 3").click()
        page.get_by_role("dialog").wait_for(state="detached")
        page.get_by_role("button", name="Restore…" if verb == "Archive" else "Archive…").wait_for()
        assert three.store.version_state("viper-lunar", 3)[0] == state


def test_a_report_is_read_filtered_and_only_then_stored(open_at, admin_service):
    seen = open_at(admin_service.url)
    page = opened(seen, "data")
    before = len(admin_service.get("/v1/admin/datasets").json()["datasets"])
    name = HOSTILE.replace("/", "")
    upload = {"name": f"{name}.zip", "mimeType": "application/zip", "buffer": archive(6, broken=(1, 4))}
    page.set_input_files("#upload-file", upload)
    page.locator("main").get_by_text("4 of 6 runs can be used").wait_for(timeout=60_000)

    rows = page.get_by_role("region", name="Findings").locator("tbody tr")
    sent = admin_service.client.post(
        "/v1/admin/datasets?dry_run=true", files={"file": ("runs.zip", archive(6, broken=(1, 4)))}
    ).json()["report"]["findings"]
    told = [row.locator("th, td").all_inner_texts() for row in rows.all()]
    assert [(each[1], each[2], each[3], each[4], each[5]) for each in told] == [
        (each["file"], str(each["row"] or ""), each["column"] or "", each["code"], each["message"]) for each in sent
    ]
    page.locator("#finding-text").fill("run4")
    assert [row.locator("td").first.inner_text() for row in rows.all()] == ["runs/run4.csv"]
    assert seen.violations() == []
    assert page.locator("main img").count() == 0
    assert len(admin_service.get("/v1/admin/datasets").json()["datasets"]) == before
    page.locator("#upload-name").fill("from-the-page")
    page.get_by_role("button", name="Store it").click()
    page.get_by_text("start a training on from-the-page").wait_for()
    assert admin_service.get("/v1/admin/datasets/from-the-page").json()["summary"]["runs"] == 4
    assert TOKEN not in page.evaluate(KEPT)


def test_a_file_is_dropped_and_faults_are_told_at_their_fields(open_at, admin_service):
    page = opened(open_at(admin_service.url), "data")
    drop = """([text]) => {
        const data = new DataTransfer();
        data.items.add(new File([text], 'one run.csv'));
        document.querySelector('.drop').dispatchEvent(new DragEvent('drop', {dataTransfer: data, bubbles: true}));
    }"""
    page.evaluate(drop, [run_text().decode()])
    page.wait_for_selector("[data-refused], [data-report=bad]")  # nobody knows its slope
    page.get_by_text("Scenario, for one plain run").click()
    for name, value in {"slope_deg": "200", "mass_kg": "430", "torque_nm": "60"}.items():
        page.locator(f"#upload-{name}").fill(value)
    page.get_by_role("button", name="Check again").click()
    page.wait_for_selector("#upload-slope_deg[aria-invalid]")
    assert "-45" in page.locator("#upload-slope_deg-hint").inner_text()
    page.locator("#upload-slope_deg").fill("20")
    page.get_by_role("button", name="Check again").click()

    page.locator("main").get_by_text("1 of 1 run can be used").wait_for()
    assert page.locator("#upload-slope_deg").get_attribute("aria-invalid") is None


def test_an_upload_shows_how_far_it_is_and_can_be_cancelled(open_at, admin_service):
    seen = open_at(admin_service.url)
    page = opened(seen, "data")
    page.set_input_files("#upload-file", {"name": "first.zip", "mimeType": "application/zip", "buffer": archive(2)})
    page.locator("main").get_by_text("2 of 2 runs can be used").wait_for(timeout=60_000)
    slow = page.context.new_cdp_session(page)
    slow.send("Network.enable")
    limits = {"offline": False, "latency": 0, "downloadThroughput": -1, "uploadThroughput": 200_000}
    slow.send("Network.emulateNetworkConditions", limits)
    noise = np.random.default_rng(1).bytes(3_000_000)
    page.set_input_files("#upload-file", {"name": "noise.zip", "mimeType": "application/zip", "buffer": noise})
    page.get_by_text(re.compile(r"[2-9] % sent")).wait_for()
    assert page.locator("[data-report]").count() == 0  # that of the first file does not stand under the second's name
    assert page.get_by_role("button", name="Store it").is_hidden()
    page.get_by_role("button", name="Cancel").click()

    page.get_by_text("noise.zip (3.0 MB): cancelled.").wait_for()
    assert page.get_by_role("button", name="Cancel").is_hidden()


def test_what_strangers_wrote_stays_text_everywhere(open_at, serve, store):
    version = publish_version(store)
    store.move_alias("viper-lunar", "champion", version, actor=HOSTILE[:60], reason=HOSTILE)
    running = serve(admin_token=TOKEN, start_worker=False)
    running.client.headers.update(ADMIN)
    dataset = put_dataset(store, "unit", stored_runs(), description=HOSTILE)
    asked = {"model": "viper-lunar", "datasets": [dataset], "description": HOSTILE, "architecture": "zero"}
    job = running.client.post("/v1/admin/training-jobs", json=asked)
    assert job.status_code == 202, job.text
    number = job.json()["id"]
    seen = open_at(running.url)
    page = opened(seen, "jobs")
    seen.forgiven = ("401", "404")
    for part in PARTS:
        if part == "compare":
            continue  # there is one version only
        page.evaluate(f"location.hash = '#models?show={part}&model=viper-lunar&job={number}'")
        page.wait_for_selector(READY[part])
        if part in ("aliases", "data"):
            page.get_by_text(HOSTILE).first.wait_for()
        if part == "jobs":
            page.get_by_text("What was asked").click()
            page.get_by_text(HOSTILE).first.wait_for()
        assert page.locator("main img, main b").count() == 0
    assert page.title() != "1"


@pytest.mark.parametrize("part", PARTS)
def test_axe_finds_nothing_on_a_phone_and_nothing_is_wider(open_at, admin_service, part):
    seen = open_at(admin_service.url, size=PHONE)
    page = opened(seen, part)
    for fold in page.locator(f"[data-part={part}] summary").all():
        if fold.inner_text() != "Every run":  # hundreds of rows take axe half a minute
            fold.click()
    page.wait_for_load_state("networkidle")

    assert seen.violations() == []
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE[0]


def test_the_keyboard_alone_reaches_every_part(open_at, admin_service):
    page = opened(open_at(admin_service.url), "card")
    page.get_by_role("link", name="Version", exact=True).focus()
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    page.wait_for_selector(READY["compare"])
    assert page.evaluate("document.activeElement.dataset.part") == "compare"
    page.go_back()
    page.wait_for_selector("[data-part=card][aria-current]")
