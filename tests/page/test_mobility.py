"""The view Mobility: the map, the steepest slopes, and the way to one slope."""

from __future__ import annotations

import pytest

SMALL = "#mobility?mass_kg=430&horizon_s=10&torque_min_nm=40&torque_max_nm=50&slope_min_deg=26&slope_max_deg=34"
QUESTION = {"mass_kg": 430, "torque_min_nm": 40, "torque_max_nm": 50, "slope_min_deg": 26, "slope_max_deg": 34}
STEPS = {"torque_steps": 11, "slope_steps": 17}


def opened(seen, address=SMALL):
    page = seen.go(address)
    page.wait_for_selector('[data-cells="all"]')
    return page


def test_the_steepest_slopes_are_those_of_the_api(seen, shipped):
    page = opened(seen)
    answer = shipped.get("/v1/mobility", **QUESTION, **STEPS).json()
    told = [float(each.get_attribute("value")) for each in page.locator('[data-name="steepest_climb_slope_deg"]').all()]

    assert told == answer["steepest_climb_slope_deg"]
    rows = page.locator(".steepest tbody th").all_inner_texts()
    assert [float(each) for each in rows] == answer["torque_nm"]
    assert f"{max(told):.1f}° is the steepest" in page.locator(".notice").first.inner_text()


def test_a_cell_is_read_with_the_arrow_keys_and_enter_opens_its_slope(seen, shipped):
    page = opened(seen)
    page.get_by_role("application").focus()
    page.keyboard.press("Home")
    for _ in range(2):
        page.keyboard.press("ArrowRight")
        page.keyboard.press("ArrowUp")
    answer = shipped.get("/v1/mobility", **QUESTION, **STEPS).json()
    told = page.locator(".reading").inner_text()

    assert told.startswith("42.0 N m, 27.0°: climbs")
    assert f"{answer['mean_speed_m_s'][2][2]:.3f} m/s, slip {answer['slip_ratio'][2][2]:.2f}" in told
    page.keyboard.press("Enter")
    page.wait_for_selector('[data-shown*="slope_deg=27&mass_kg=430&torque_nm=42"]')
    assert page.locator("#field-torque_nm").input_value() == "42"
    page.go_back()
    page.wait_for_selector('[data-cells="all"]')
    assert page.locator("#field-torque_min_nm").input_value() == "40"


def test_a_click_opens_the_slope_under_the_pointer(seen):
    page = opened(seen)
    box = page.get_by_role("application").bounding_box()
    page.mouse.move(box["x"] + box["width"] * 0.5, box["y"] + box["height"] * 0.5)
    torque, slope = page.locator(".reading").inner_text().split("°")[0].split(" N m, ")
    page.mouse.click(box["x"] + box["width"] * 0.5, box["y"] + box["height"] * 0.5)
    page.wait_for_selector(".view[data-view=slope] [data-shown]")

    assert float(page.locator("#field-torque_nm").input_value()) == float(torque)
    assert float(page.locator("#field-slope_deg").input_value()) == float(slope)


@pytest.mark.parametrize(
    ("layer", "name"), [("outcome", "Outcome"), ("mean_speed_m_s", "Mean speed"), ("slip_ratio", "Slip")]
)
def test_every_layer_is_there_as_a_table_with_the_numbers_of_the_api(seen, shipped, layer, name):
    page = opened(seen)
    page.get_by_role("button", name=name).click()
    page.get_by_text("All cells as a table").click()
    answer = shipped.get("/v1/mobility", **QUESTION, **STEPS).json()
    rows = page.locator("details table").last.locator("tbody tr").all()
    told = [each.locator("td").all_inner_texts() for each in rows[:3]]

    for texts, values in zip(told, answer[layer][:3], strict=True):
        for text, value in zip(texts, values, strict=True):
            if isinstance(value, str):
                assert text == value
            else:
                assert abs(float(text.replace("\N{MINUS SIGN}", "-")) - value) < 0.006
    assert ("layer=" + layer in page.evaluate("location.hash")) == (layer != "outcome")
    if layer == "outcome":
        assert seen.violations() == []


def test_a_moved_slider_changes_map_and_address(seen, shipped):
    page = opened(seen)
    page.get_by_label("Mass, slider").focus()
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    page.wait_for_selector('[data-cells="all"][data-shown*="mass_kg=433"]')
    told = [float(each.get_attribute("value")) for each in page.locator('[data-name="steepest_climb_slope_deg"]').all()]

    assert (
        told == shipped.get("/v1/mobility", **QUESTION | {"mass_kg": 433}, **STEPS).json()["steepest_climb_slope_deg"]
    )
    assert "mass_kg=433" in page.evaluate("location.hash")


def test_a_wrong_range_is_told_in_the_services_words(seen):
    seen.forgiven = ("422",)
    page = seen.go("#mobility?mass_kg=430&torque_min_nm=90&torque_max_nm=50")

    words = "torque_max_nm is 50.0, allowed is at least torque_min_nm, which is 90"
    page.get_by_role("form").get_by_text(words).wait_for()
