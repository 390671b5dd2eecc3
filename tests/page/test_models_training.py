"""From an upload to a promotion in the browser, with a real worker; and the stream of events as it comes in pieces."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from service.settings import Settings
from tests.api.chrono_uploads import archive
from tests.api.conftest import ADMIN, TOKEN, serving
from tests.page.conftest import Open, Seen
from tests.page.test_models import KEPT, READY, enter

STREAM = (
    'retry: 2000\n\n: still here\r\n\r\nid: 1\nevent: state\ndata: {"state":"running"}\n\n'
    'id: 2\r\nevent: log\r\ndata: {"message":"na\u00efve \\u2713 \U0001f319"}\r\n\r\n'
    'event: progress\ndata: {"fraction":0.5}\n\nid: 3\nevent: log\ndata: {"message":"cut o'
)
READ = """async ([bytes, size]) => {
    const { eventsOf } = await import('./page/views/models/events.js');
    const parts = [];
    for (let at = 0; at < bytes.length; at += size) parts.push(new Uint8Array(bytes.slice(at, at + size)));
    const start = (control) => { parts.forEach((each) => control.enqueue(each)); control.close(); };
    const stream = new ReadableStream({ start });
    const found = [];
    for await (const event of eventsOf(stream)) found.push([event.id ?? null, event.kind, JSON.stringify(event.data)]);
    return found;
}"""


def test_events_are_the_same_however_the_stream_is_cut(seen: Seen) -> None:
    page = seen.go("#models")
    page.wait_for_selector(READY["card"])
    for size in (1, 2, 3, 5, 7, 16, 1000):
        assert page.evaluate(READ, [list(STREAM.encode()), size]) == [
            [1, "state", '{"state":"running"}'],
            [2, "log", '{"message":"na\u00efve \u2713 \U0001f319"}'],
            [None, "progress", '{"fraction":0.5}'],
        ]


@pytest.mark.slow
def test_from_upload_to_promotion_and_back(open_at: Open, tmp_path: Path) -> None:
    folder = tmp_path / "store"
    shutil.copytree(Path(Settings().store_url) / "models", folder / "models")
    with serving(folder, admin_token=TOKEN, start_worker=True) as running:
        running.wait_ready()
        seen = open_at(running.url)
        seen.forgiven = ("401", "ERR_FAILED", "ERR_ABORTED")
        page = seen.go("#models?show=data")
        enter(page, TOKEN)
        page.wait_for_selector(READY["data"])
        upload = {"name": "campaign.zip", "mimeType": "application/zip", "buffer": archive(8)}
        page.set_input_files("#upload-file", upload)
        page.wait_for_selector("[data-report=good]")
        page.get_by_role("button", name="Store it").click()
        page.get_by_role("link", name="start a training on campaign").click()
        _train(page)
        _promote_and_roll_back(page, running)

        assert TOKEN not in page.evaluate(KEPT)
        assert not any(TOKEN in each for each in seen.requests)
        page.context.close()


def _train(page):
    """A small network on the runs that were uploaded; the connection to its events is lost once."""
    lost = []
    page.route("**/events", lambda route: route.continue_() if lost else (lost.append(1), route.abort()))
    page.locator("#job-architecture").select_option("paper_network")
    page.get_by_text("Advanced").click()
    page.locator("#job-budget-max_epochs").fill("2")
    page.locator("#job-split-test_fraction").fill("0.25")
    page.get_by_role("button", name="Start training").click()
    page.get_by_text("it is taken up again").wait_for()
    page.wait_for_selector("[data-state=running]", timeout=60_000)
    page.wait_for_selector('[data-job][data-fraction]:not([data-fraction="0"])', timeout=60_000)
    page.wait_for_selector('[data-made="viper-lunar@6"]', timeout=60_000)
    assert lost == [1]
    assert "published viper-lunar@6" in page.get_by_role("log").inner_text()


def _promote_and_roll_back(page, running):
    dialog = page.get_by_role("dialog")
    page.get_by_role("button", name="Promote version 6").click()
    dialog.get_by_label("Reason, kept in the history").fill("to see it in use")
    dialog.get_by_role("button", name="Move champion from 5 to 6").click()
    dialog.wait_for(state="detached")
    question = {"slope_deg": 21, "mass_kg": 430, "torque_nm": 60}
    _wait_for_version(page, running, question, 6)
    page.get_by_role("link", name="Aliases").click()
    page.get_by_role("cell", name="to see it in use").wait_for()
    page.locator("[data-alias=champion]").get_by_role("button", name="Roll back").click()
    dialog.get_by_label("Reason, kept in the history").fill("the shipped one is better")
    dialog.get_by_role("button", name="Move champion from 6 back to 5").click()
    page.get_by_role("cell", name="the shipped one is better").wait_for()
    _wait_for_version(page, running, question, 5)
    history = running.client.get("/v1/models/viper-lunar/aliases/champion/history", headers=ADMIN).json()["history"]
    assert [each["version"] for each in history[:3]] == [5, 6, 5]
    page.get_by_role("link", name="Version 6").click()
    page.wait_for_selector('[data-part=card][data-shown="viper-lunar@6"]')
    assert page.get_by_text("campaign").first.is_visible()


def _wait_for_version(page, running, question, version):
    for _ in range(50):
        if running.client.get("/v1/predictions", params=question).json()["model"]["version"] == version:
            return
        page.wait_for_timeout(100)
    raise AssertionError(f"version {version} does not answer")
