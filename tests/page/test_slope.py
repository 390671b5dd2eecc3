"""The view Slope: what it shows is what the API answers, and its address holds the question."""

from __future__ import annotations

import time

import pytest

from tests.page.conftest import PHONE

STEEP = "#slope?slope_deg=28&mass_kg=430&torque_nm=60&horizon_s=10"
SHOWN = "[data-shown]"


def shown(page, name):
    return page.locator(f'[data-name="{name}"]').first.get_attribute("value")


def wait_for(page, **question):
    """Until the curve of this question is drawn."""
    parts = "".join(f'[data-shown*="{name}={value}"]' for name, value in question.items())
    page.wait_for_selector(parts)


def require_same_as_api(page, running, **question):
    answer = running.get("/v1/predictions", **question, include="band").json()
    for name in ("final_x_m", "mean_speed_m_s", "slip_ratio", "distance_m"):
        assert float(shown(page, name)) == answer["summary"][name], name
    assert float(shown(page, "x_lower_m")) == answer["band"]["x_lower_m"][-1]
    assert float(shown(page, "x_upper_m")) == answer["band"]["x_upper_m"][-1]
    return answer


def test_the_numbers_are_those_of_the_api(seen, shipped):
    page = seen.go(STEEP)
    wait_for(page, slope_deg=28, torque_nm=60)

    answer = require_same_as_api(page, shipped, slope_deg=28, mass_kg=430, torque_nm=60, horizon_s=10)
    assert page.get_by_text(f"{answer['summary']['final_x_m']:.3f} m", exact=True).is_visible()
    page.wait_for_selector("[data-judged]")
    steepest = shipped.get("/v1/mobility", mass_kg=430, torque_min_nm=60).json()["steepest_climb_slope_deg"][0]
    assert f"{steepest:.1f}°" in page.locator("[data-verdict]").inner_text()
    assert page.locator("[data-verdict]").get_attribute("data-verdict") == "good"


def test_a_slider_moved_by_keys_leads_to_the_number_of_the_api(seen, shipped):
    page = seen.go(STEEP)
    wait_for(page, slope_deg=28)
    slider = page.get_by_label("Slope, slider")
    slider.focus()
    for _ in range(5):
        page.keyboard.press("ArrowLeft")
    wait_for(page, slope_deg="27.5")

    assert page.locator("#field-slope_deg").input_value() == "27.5"
    require_same_as_api(page, shipped, slope_deg=27.5, mass_kg=430, torque_nm=60, horizon_s=10)
    page.wait_for_function("location.hash.includes('slope_deg=27.5')")


def test_a_slider_dragged_by_the_pointer_shows_its_last_place(seen, shipped):
    page = seen.go(STEEP)
    wait_for(page, slope_deg=28)
    box = page.get_by_label("Wheel torque, slider").bounding_box()
    middle = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + box["width"] * 0.4, middle)
    page.mouse.down()
    for step in range(12):
        page.mouse.move(box["x"] + box["width"] * (0.4 + step * 0.02), middle)
    page.mouse.up()
    torque = page.locator("#field-torque_nm").input_value()
    wait_for(page, torque_nm=torque)

    assert 75 < float(torque) < 110
    require_same_as_api(page, shipped, slope_deg=28, mass_kg=430, torque_nm=torque, horizon_s=10)


def test_a_shared_address_shows_the_same(seen, open_at, shipped):
    page = seen.go(STEEP)
    wait_for(page, slope_deg=28)
    page.locator("#field-mass_kg").fill("512.5")
    page.keyboard.press("Tab")
    wait_for(page, mass_kg="512.5")
    other = open_at(shipped.url).go(page.evaluate("location.hash"))
    wait_for(other, mass_kg="512.5")

    assert shown(other, "final_x_m") == shown(page, "final_x_m")
    page.go_back()
    wait_for(page, mass_kg="430")
    assert page.locator("#field-mass_kg").input_value() == "430"


def test_outside_the_domain_the_reasons_are_those_of_the_answer(seen, shipped):
    page = seen.go("#slope?slope_deg=40&mass_kg=1400&torque_nm=60&horizon_s=40")
    wait_for(page, slope_deg=40)
    reasons = shipped.get("/v1/predictions", slope_deg=40, mass_kg=1400, torque_nm=60, horizon_s=40).json()["domain"]

    for reason in reasons["reasons"]:
        assert page.get_by_text(reason["detail"]).is_visible()
    assert page.locator("[data-verdict]").get_attribute("data-verdict") == "warn"


def test_a_wrong_value_is_told_at_its_field_in_the_services_words(seen):
    seen.forgiven = ("422",)
    page = seen.go("#slope?slope_deg=280&mass_kg=430&torque_nm=60")
    hint = page.locator("#field-slope_deg-hint")
    page.wait_for_selector('[data-verdict="none"]')

    assert hint.inner_text() == "Allowed is -45 to 45"
    assert page.locator("#field-slope_deg").get_attribute("aria-invalid") == "true"
    page.locator("#field-slope_deg").fill("20")
    wait_for(page, slope_deg=20)
    assert page.locator("#field-slope_deg").get_attribute("aria-invalid") is None


@pytest.mark.parametrize("manifest_comes", ["before", "after"])
def test_a_version_without_band_is_shown_without(seen, shipped, manifest_comes):
    seen.forgiven = ("422",)  # until the manifest is there, the question is asked with a band, and refused
    if manifest_comes == "after":
        seen.page.route("**/v1/models/*/versions/*", lambda route: (time.sleep(1.5), route.continue_()))
    page = seen.go(f"{STEEP}&model=viper-lunar-paper%40champion")
    wait_for(page, slope_deg=28)
    question = {"slope_deg": 28, "mass_kg": 430, "torque_nm": 60, "model": "viper-lunar-paper"}

    assert float(shown(page, "final_x_m")) == shipped.get("/v1/predictions", **question).json()["summary"]["final_x_m"]
    assert page.locator('[data-name="x_lower_m"]').count() == 0
    page.wait_for_selector("[data-judged]")
    assert "central estimate" in page.locator("[data-verdict]").inner_text()


def test_the_version_is_chosen_from_those_there_are(seen, shipped):
    page = seen.go(STEEP)
    wait_for(page, slope_deg=28)
    page.get_by_label("Version").select_option("viper-lunar@1")
    wait_for(page, model="viper-lunar%401")
    question = {"slope_deg": 28, "mass_kg": 430, "torque_nm": 60, "model": "viper-lunar@1"}

    assert float(shown(page, "final_x_m")) == shipped.get("/v1/predictions", **question).json()["summary"]["final_x_m"]
    assert "viper-lunar%401" in page.evaluate("location.hash")


def test_a_curve_is_read_with_the_arrow_keys_and_as_a_table(seen, shipped):
    page = seen.go(STEEP)
    wait_for(page, slope_deg=28)
    curve = page.get_by_role("slider", name="Position along the slope, read along Time")
    curve.focus()
    page.keyboard.press("End")
    answer = shipped.get("/v1/predictions", slope_deg=28, mass_kg=430, torque_nm=60).json()
    last = f"{answer['summary']['final_x_m']:.3f}"

    assert "At 10.00 s: Prior alone" in curve.get_attribute("aria-valuetext")
    assert f"Prediction {last} m" in curve.get_attribute("aria-valuetext")
    page.keyboard.press("Home")
    assert "At 0.00 s" in page.locator(".reading").first.inner_text()
    page.get_by_text("Values as a table").first.click()
    assert page.locator(".plot table tbody tr").last.locator("td").nth(1).inner_text() == last
    assert seen.violations() == []


def test_links_lead_to_the_same_question_in_each_form(seen, shipped):
    page = seen.go(STEEP)
    wait_for(page, slope_deg=28)
    answer = shipped.get("/v1/predictions", slope_deg=28, mass_kg=430, torque_nm=60).json()

    csv = shipped.client.get(page.locator('[data-form="csv"]').get_attribute("href")).text
    assert float(csv.splitlines()[-1].split(",")[1]) == answer["trajectory"]["x_m"][-1]
    for form in ("json", "npz", "arrow", "usda", "svg", "png"):
        assert shipped.client.get(page.locator(f'[data-form="{form}"]').get_attribute("href")).status_code == 200
    address = page.locator("pre").inner_text().split('"')[1]
    assert shipped.client.get(address).json()["summary"] == answer["summary"]


def test_of_many_questions_the_newest_wins_and_few_are_asked(seen):
    page = seen.go(STEEP)
    wait_for(page, slope_deg=28)
    before = len([each for each in seen.requests if "/v1/predictions" in each])
    page.evaluate("""() => {
        const slider = document.querySelector('#field-mass_kg-slider');
        for (let mass = 400; mass < 500; mass++) { slider.value = mass; slider.dispatchEvent(new Event('input')); }
        slider.dispatchEvent(new Event('change'));
    }""")
    wait_for(page, mass_kg=499)

    assert len([each for each in seen.requests if "/v1/predictions" in each]) - before <= 3


def test_axe_finds_nothing_outside_the_domain_and_on_a_phone(open_at, shipped):
    seen = open_at(shipped.url, size=PHONE)
    page = seen.go("#slope?slope_deg=40&mass_kg=1400&torque_nm=60&horizon_s=40")
    page.wait_for_selector("[data-judged]")

    assert seen.violations() == []
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE[0]
