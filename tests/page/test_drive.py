"""The view Drive: it shows what the API answers, and draws the rover where that has it."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest

from service.physics.parameters import VIPER
from service.settings import Settings
from tests.api.conftest import TOKEN, serving
from tests.page.conftest import PHONE

COAST = "#drive?mass_kg=430&slopes=0:18,4:22,8:20&torques=0:100,8:0,10:100&until_distance_m=8&horizon_s=30"
QUESTION = {
    "mass_kg": 430,
    "track": {"distance_m": [0, 4, 8], "slope_deg": [18, 22, 20]},
    "controls": {"time_s": [0, 8, 10], "torque_nm": [100, 0, 100]},
    "horizon_s": 30,
    "until_distance_m": 8,
}
HILL = "#drive?mass_kg=430&elevations=-1:0.1,2:0.3,4:1,6:1.2&torques=0:90,3:brake,5:90&horizon_s=12"
HILLS = {
    "mass_kg": 430,
    "track": {"horizontal_m": [-1, 2, 4, 6], "elevation_m": [0.1, 0.3, 1, 1.2]},
    "controls": {"time_s": [0, 3, 5], "torque_nm": [90, 0, 90], "brake": [False, True, False]},
    "horizon_s": 12,
}
ONE = "#drive?mass_kg=430&slopes=0:25&torques=0:60&horizon_s=20"
OUTSIDE = "#drive?mass_kg=430&slopes=0:10,3:18,5:36&torques=0:80,6:brake,8:100&horizon_s=60"


def shown(page, name, which=0):
    return page.locator(f'[data-name="{name}"]').nth(which).get_attribute("value")


def opened(seen, address, **question):
    page = seen.go(address)
    wait_for(page, **question)
    return page


def wait_for(page, **question):
    """Until the drive of this question is drawn."""
    parts = "".join(f'[data-shown*="{name}={value}"]' for name, value in question.items())
    page.wait_for_selector(parts or "[data-shown]")


def answered(running, question=QUESTION, **more):
    return running.client.post("/v1/drives", json={**question, **more}).json()


def now(page):
    """What the side view shows: time, distance, and where the rear wheel is drawn."""
    told = page.locator(".scene canvas").evaluate("each => ({...each.dataset})")
    return {name: float(value) for name, value in told.items() if value}


def sought(page, time_s):
    slider = page.get_by_label("Time of the drive")
    slider.evaluate("(each, time) => { each.value = time; each.dispatchEvent(new Event('input')); }", time_s)


def test_the_numbers_are_those_of_the_api(seen, shipped):
    page = opened(seen, COAST, until_distance_m=8)
    answer = answered(shipped, include=["band"], dt_s=0.05)

    for name in ("arrival_time_s", "arrival_earliest_s", "final_x_m", "mean_speed_m_s", "motor_energy_j"):
        assert float(shown(page, name)) == answer["summary"][name], name
    assert float(shown(page, "x_lower_m")) == answer["band"]["x_lower_m"][-1]
    assert float(shown(page, "x_upper_m")) == answer["band"]["x_upper_m"][-1]
    told = [each.get_attribute("data-event") for each in page.locator(".events li").all()]
    assert told == [each["event"] for each in answer["events"]]
    times = page.locator('.events [data-name="time_s"]').evaluate_all("all => all.map((each) => Number(each.value))")
    assert times == [each["time_s"] for each in answer["events"]]
    assert page.locator("[data-verdict]").get_attribute("data-verdict") == "warn"  # it arrives, but slides on its way
    assert "slides back" in page.locator("[data-verdict]").inner_text()


@pytest.mark.parametrize(("address", "question"), [(COAST, QUESTION), (HILL, HILLS)])
def test_the_rover_is_drawn_where_the_api_has_it(seen, shipped, address, question):
    page = opened(seen, address)
    world = answered(shipped, question, frame="world", dt_s=0.05)["trajectory"]
    for share in (0, 0.4, 0.7, 1):
        row = round(share * (len(world["time_s"]) - 1))
        sought(page, world["time_s"][row])
        told = now(page)

        assert told["across"] == pytest.approx(world["x_m"][row], abs=1e-6)
        assert told["up"] == pytest.approx(world["z_m"][row], abs=1e-6)


def test_playing_moves_the_rover_in_real_time_to_its_end_and_then_rests(seen, shipped):
    page = opened(seen, COAST.replace("until_distance_m=8&horizon_s=30", "horizon_s=3"), horizon_s=3)
    end = answered(shipped, {**QUESTION, "until_distance_m": None, "horizon_s": 3} | {"until_distance_m": 50})
    page.evaluate("""() => {
        window.frames_ = 0;
        const ask = requestAnimationFrame.bind(window);
        window.requestAnimationFrame = (draw) => { window.frames_ += 1; return ask(draw); };
    }""")
    began = page.evaluate("performance.now()")
    page.get_by_role("button", name="Play", exact=True).click()
    page.get_by_role("button", name="Pause").wait_for()
    page.get_by_role("button", name="Play again").wait_for()
    took = page.evaluate("performance.now()") - began
    frames = page.evaluate("window.frames_")
    page.wait_for_timeout(300)

    assert 2900 < took < 5000
    assert now(page)["x"] == pytest.approx(end["summary"]["final_x_m"], abs=1e-7)
    assert frames > 20
    assert page.evaluate("window.frames_") == frames  # nothing is drawn where nothing moves
    assert page.locator('[data-now="x"]').inner_text() == f"{end['summary']['final_x_m']:.2f} m"


def test_it_pauses_goes_faster_and_to_an_event(seen, shipped):
    page = opened(seen, COAST, until_distance_m=8)
    page.get_by_role("button", name="5\u00d7").click()
    page.get_by_role("button", name="Play", exact=True).click()
    page.wait_for_timeout(800)
    page.get_by_role("button", name="Pause").click()
    paused = now(page)["time"]
    page.wait_for_timeout(300)

    assert 1.5 < paused < 12
    assert now(page)["time"] == paused
    page.locator('.events [data-event="goes_on"] button').click()
    event = next(each for each in answered(shipped)["events"] if each["event"] == "goes_on")
    assert now(page)["time"] == event["time_s"]
    assert now(page)["x"] == pytest.approx(event["x_m"], abs=1e-3)


def test_with_less_motion_wished_few_pictures_are_drawn(open_at, shipped):
    seen = open_at(shipped.url)
    seen.page.emulate_media(reduced_motion="reduce")
    page = opened(seen, COAST, until_distance_m=8)
    page.evaluate("""() => {
        window.drawn_ = 0;
        const { fillRect } = CanvasRenderingContext2D.prototype;
        CanvasRenderingContext2D.prototype.fillRect = function (...box) {
            if (box[2] > 200) window.drawn_ += 1;
            fillRect.apply(this, box);
        };
    }""")
    page.get_by_role("button", name="Play", exact=True).click()
    page.wait_for_timeout(1600)
    page.get_by_role("button", name="Pause").click()

    assert page.evaluate("window.drawn_") <= 6


def test_one_slope_has_the_prior_of_the_api_as_ghost_and_other_drives_say_that_they_have_none(seen, shipped):
    page = opened(seen, ONE, slopes="0%3A25")
    sought(page, 1e9)
    question = {"slope_deg": 25, "mass_kg": 430, "torque_nm": 60, "horizon_s": 20, "include": "prior"}
    prior = shipped.get("/v1/predictions", **question).json()["prior"]["x_m"][-1]

    assert now(page)["prior"] == pytest.approx(prior, abs=1e-9)
    assert "The ghost is the prior" in page.locator(".ghost").inner_text()
    page.goto(f"{seen.origin}/{COAST}")
    wait_for(page, until_distance_m=8)
    assert "prior" not in now(page)
    assert "No ghost" in page.locator(".ghost").inner_text()


def test_a_slope_can_be_watched_as_a_drive(seen, shipped):
    page = seen.go("#slope?slope_deg=25&mass_kg=430&torque_nm=60&horizon_s=20")
    page.get_by_role("link", name="Watch the rover drive it").click()
    wait_for(page, slopes="0%3A25")
    question = {"mass_kg": 430, "track": {"distance_m": [0], "slope_deg": [25]}, "controls": 60, "horizon_s": 20}

    assert float(shown(page, "final_x_m")) == answered(shipped, question)["summary"]["final_x_m"]
    assert "prior" in now(page)


def test_a_shared_address_shows_the_same_and_back_returns(seen, open_at, shipped):
    page = opened(seen, HILL, horizon_s=12)
    page.locator("#field-mass_kg").fill("512.5")
    page.keyboard.press("Tab")
    wait_for(page, mass_kg="512.5")
    address = page.evaluate("location.hash")
    other = opened(open_at(shipped.url), address, mass_kg="512.5")

    assert "elevations=-1:0.1,2:0.3,4:1,6:1.2" in address
    assert "torques=0:90,3:brake,5:90" in address
    assert shown(other, "final_x_m") == shown(page, "final_x_m")
    assert float(shown(page, "final_x_m")) == answered(shipped, HILLS, mass_kg=512.5)["summary"]["final_x_m"]
    page.go_back()
    wait_for(page, mass_kg=430)
    assert page.locator("#field-mass_kg").input_value() == "430"


def test_torque_and_brake_over_time_are_edited_and_asked(seen, shipped):
    page = opened(seen, "#drive?mass_kg=430&slopes=0:15&torques=0:80&horizon_s=10", horizon_s=10)
    page.get_by_role("button", name="Add a change").click()
    page.get_by_label("From, s, change 2").fill("4")
    page.get_by_label("Brake, change 2").check()
    page.get_by_label("Start speed").fill("0.3")
    page.keyboard.press("Tab")
    wait_for(page, torques="0%3A80%2C4%3Abrake", start_speed_m_s="0.3")
    controls = {"time_s": [0, 4], "torque_nm": [80, 0], "brake": [False, True]}
    question = {"mass_kg": 430, "track": {"distance_m": [0], "slope_deg": [15]}, "controls": controls, "horizon_s": 10}

    assert float(shown(page, "final_x_m")) == answered(shipped, question, start_speed_m_s=0.3)["summary"]["final_x_m"]
    page.get_by_label("Remove change 2").click()
    wait_for(page, torques="0%3A80&")
    assert page.locator('[data-cell="torque_nm1"]').count() == 0


def test_what_the_service_refuses_is_told_where_it_is_in_its_words(seen, shipped):
    seen.forgiven = ("422",)
    page = opened(seen, COAST, until_distance_m=8)
    page.locator("#field-until_distance_m").fill("-4")
    page.wait_for_selector('[data-verdict="none"]')
    assert "Allowed is" in page.locator("#field-until_distance_m-hint").inner_text()
    page.locator("#field-until_distance_m").fill("8")
    wait_for(page, until_distance_m=8)
    page.get_by_label("Torque, N m, change 2").fill("-3")
    page.wait_for_selector('[data-verdict="none"]')

    assert "controls.torque_nm is -3" in page.get_by_role("alert").filter(has_text="torque").inner_text()
    assert page.locator("#field-until_distance_m").get_attribute("aria-invalid") is None


def test_where_it_is_outside_the_reasons_are_those_of_the_answer(seen, shipped):
    page = opened(seen, OUTSIDE, horizon_s=60)
    question = {
        "mass_kg": 430,
        "track": {"distance_m": [0, 3, 5], "slope_deg": [10, 18, 36]},
        "controls": {"time_s": [0, 6, 8], "torque_nm": [80, 0, 100], "brake": [False, True, False]},
        "horizon_s": 60,
    }
    reasons = [each for stretch in answered(shipped, question)["domain"]["stretches"] for each in stretch["reasons"]]

    assert reasons
    told = page.locator(".notice.warn").last.inner_text()
    assert all(each["detail"] in told for each in reasons)
    assert page.locator("[data-verdict]").get_attribute("data-verdict") == "warn"


def test_the_same_question_elsewhere_is_the_same(seen, shipped):
    page = opened(seen, COAST, until_distance_m=8)
    words = shlex.split(page.locator(".command pre").inner_text())
    answer = shipped.client.post(words[1], content=words[-1], headers={"Content-Type": "application/json"}).json()

    assert answer["summary"] == answered(shipped)["summary"]
    assert json.loads(words[-1])["controls"] == QUESTION["controls"]
    for form in ("csv", "usda"):
        with page.expect_download() as loaded:
            page.locator(f'[data-form="{form}"]').click()
        assert len(loaded.value.path().read_bytes()) > 1000
        assert loaded.value.suggested_filename == f"drives.{form}"


def test_a_version_without_drive_model_says_so_at_its_field(seen, shipped):
    seen.forgiven = ("422",)
    page = seen.go(f"{COAST}&model=viper-lunar%401")
    page.wait_for_selector('[data-verdict="none"]')

    assert page.locator("#field-model-hint").inner_text()


def test_of_many_questions_the_newest_wins_and_few_are_asked(seen):
    page = opened(seen, COAST, until_distance_m=8)
    before = len([each for each in seen.requests if "/v1/drives" in each])
    page.evaluate("""() => {
        const slider = document.querySelector('#field-mass_kg-slider');
        for (let mass = 400; mass < 500; mass++) { slider.value = mass; slider.dispatchEvent(new Event('input')); }
        slider.dispatchEvent(new Event('change'));
    }""")
    wait_for(page, mass_kg=499)

    assert len([each for each in seen.requests if "/v1/drives" in each]) - before <= 3


def test_it_works_with_a_token(open_at):
    secret = {"admin_token": TOKEN, "require_token": True, "start_worker": False}
    with serving(Path(Settings().store_url), **secret) as running:
        running.wait_ready()
        seen = open_at(running.url)
        seen.forgiven = ("401", "429")
        page = seen.go(COAST)
        page.get_by_label("Token", exact=True).fill(TOKEN)
        page.get_by_role("button", name="Use").click()
        wait_for(page, until_distance_m=8)
        with page.expect_download() as loaded:
            page.locator('[data-form="csv"]').click()

        assert loaded.value.path().read_text().startswith("time_s,x_m,y_m")
        assert TOKEN not in page.evaluate("location.href") + page.locator(".command pre").inner_text()
        page.context.close()


@pytest.mark.parametrize("address", [ONE, OUTSIDE])
def test_axe_finds_nothing_and_nothing_is_wider_than_a_phone(open_at, shipped, address):
    seen = open_at(shipped.url, size=PHONE)
    page = opened(seen, address)
    page.get_by_text("Knots as a table").click()
    page.get_by_text("Load an elevation profile").click()

    assert seen.violations() == []
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE[0]


def test_the_rover_is_drawn_as_large_as_it_is(seen):
    page = opened(seen, ONE)
    told = page.evaluate("import('./page/views/drive_motion.js').then((found) => found.VIPER)")

    assert told == {"wheelbase": VIPER.wheelbase_m, "radius": VIPER.wheel_radius_m}
