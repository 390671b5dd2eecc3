"""What the page says where it cannot answer: addresses that cannot be read, refusals, and a service that is away."""

from __future__ import annotations

import json
from urllib.parse import quote

import pytest

NO_ANSWER = '[data-verdict="none"]'
STEEP = "#slope?slope_deg=28&mass_kg=430&torque_nm=60&horizon_s=10"


def told(page):
    """The words in place of an answer."""
    page.wait_for_selector(NO_ANSWER)
    return page.locator(NO_ANSWER).inner_text()


@pytest.mark.parametrize(
    ("query", "words"),
    [
        ("slope?slope_deg=28,5", ["slope_deg is “28,5”, which is no number (decimals have a point)"]),
        ("slope?slope_deg=NaN&mass_kg=Infinity", ["slope_deg is “NaN”", "mass_kg is “Infinity”"]),
        ("slope?slope_deg=&model=", ["slope_deg is empty", "model is empty"]),
        ("slope?slope_deg=28&slope_deg=5", ["slope_deg is there 2 times"]),
        ("mobility?mass_kg=x", ["mass_kg is “x”"]),
        ("mobility?mass_kg=430&torque_max_nm=1e999", ["torque_max_nm is “1e999”"]),
        ("mobility?layer=constructor", ["layer is “constructor”, allowed is outcome, mean_speed_m_s, slip_ratio"]),
        ("models?model=viper-lunar&version=abc", ["version is “abc”, which is neither a number nor an alias"]),
        ("models?show=constructor", ["show is “constructor”, allowed is card, compare, aliases, data, jobs"]),
    ],
)
def test_what_cannot_be_read_is_told_and_not_asked(seen, query, words):
    page = seen.go(f"#{query}")

    assert all(each in told(page) for each in words)
    page.wait_for_load_state("networkidle")
    assert [each for each in seen.requests if "/v1/predictions" in each or "/v1/mobility" in each] == []
    assert page.locator("[data-shown]:visible").count() == 0
    if query.startswith("slope?slope_deg=28,5"):
        assert seen.violations() == []
        assert page.locator("#field-slope_deg").get_attribute("aria-invalid") == "true"
        page.locator("#field-slope_deg").fill("20")
        page.wait_for_selector('[data-shown*="slope_deg=20"]')


@pytest.mark.parametrize(
    "query", ["mass_kg=x", "slopes=0:10&elevations=0:0,4:1", "until_distance_m=", "mass_kg=1&mass_kg=2"]
)
def test_a_drive_that_cannot_be_read_is_told_beside_an_example(seen, query):
    page = seen.go(f"#drive?{query}")
    page.wait_for_selector("[data-shown]")

    assert page.get_by_text("cannot be read").is_visible()
    assert page.locator("#field-mass_kg").input_value() == "430"


@pytest.mark.parametrize(
    ("query", "name"),
    [
        ("slope?slope_deg=28&torque_steps=5", "torque_steps"),
        ("mobility?mass_kg=430&torque_steps=500", "torque_steps"),
        ("drive?mass_kg=430&torque_nm=9", "torque_nm"),
        ("models?slope_steps=9", "slope_steps"),
    ],
)
def test_names_that_a_view_does_not_know_are_told(seen, query, name):
    page = seen.go(f"#{query}")

    page.get_by_text(f"This view does not know “{name}”").wait_for()


@pytest.mark.parametrize("view", ["constructor", "__proto__", "toString"])
def test_names_that_every_object_has_are_no_views(seen, view):
    seen.go(f"#{view}").get_by_role("heading", name="No such view").wait_for()


def test_the_reasons_stand_in_the_refusal_and_the_mark_stays(seen):
    seen.forgiven = ("422",)
    page = seen.go(STEEP)
    page.wait_for_selector("[data-shown]")
    page.locator("#field-slope_deg").fill("99")
    assert "slope_deg is '99'" in told(page)
    page.keyboard.press("Tab")

    assert page.locator("#field-slope_deg").get_attribute("aria-invalid") == "true"
    assert page.locator("#field-slope_deg-hint").inner_text() == "Allowed is -45 to 45"
    assert page.locator(".plot:visible").count() == 0  # the old curves are not beside it
    assert seen.violations() == []
    page.locator("#field-slope_deg").fill("20")
    page.wait_for_selector('[data-shown*="slope_deg=20"]')
    assert page.locator(".plot:visible").count() == 2


def test_the_reason_of_a_wrong_version_stands_in_the_refusal_and_at_its_field(seen):
    seen.forgiven = ("422", "404")
    page = seen.go(f"#slope?slope_deg=28&model={quote('<img src=x>')}")

    assert "model is '<img src=x>', allowed is" in told(page)
    assert page.get_by_label("Version").get_attribute("aria-invalid") == "true"


def test_the_reason_of_a_wrong_range_is_not_hidden_in_a_closed_part(seen):
    seen.forgiven = ("422",)
    page = seen.go("#mobility?mass_kg=430&torque_min_nm=100&torque_max_nm=10")

    assert "torque_max_nm is 10" in told(page)
    assert page.locator("#field-torque_max_nm").is_visible()
    assert page.locator("#field-torque_max_nm").get_attribute("aria-invalid") == "true"
    assert page.locator("canvas:visible").count() == 0


def test_a_time_that_is_too_long_is_told_as_such(seen):
    seen.forgiven = ("422",)
    words = told(seen.go("#slope?slope_deg=28&horizon_s=1e9"))

    assert "horizon_s" in words
    assert "dt_s" not in words


def test_a_slider_has_a_range_where_all_runs_are_at_one_value(seen):
    def single(route):
        answer = route.fetch()
        manifest = answer.json()
        manifest["domain"] |= {"mass_kg": [430, 430], "torque_nm": [60, 60]}
        route.fulfill(response=answer, body=json.dumps(manifest))

    seen.page.route("**/v1/models/*/versions/*", single)
    for view, names in {"slope": ("mass_kg", "torque_nm"), "mobility": ("mass_kg",), "drive": ("mass_kg",)}.items():
        page = seen.go(f"#{view}")
        page.wait_for_selector(f'.view[data-view="{view}"] [data-shown]')
        for name in names:
            slider = page.locator(f"#field-{name}-slider")
            low, high, step = (float(slider.get_attribute(each)) for each in ("min", "max", "step"))
            assert low < float(slider.input_value()) < high
            assert 50 < (high - low) / step < 5000
            assert slider.input_value() == page.locator(f"#field-{name}").input_value()
            assert page.locator(f"#field-{name}-hint").inner_text().startswith("All runs at ")
    slider.focus()
    page.keyboard.press("ArrowRight")
    assert page.locator("#field-mass_kg").input_value() == "431"
    page.unroute_all(behavior="ignoreErrors")


def test_the_slider_of_the_time_moves_in_round_numbers(seen):
    page = seen.go(STEEP)
    page.wait_for_selector("[data-shown]")
    slider, field = page.get_by_label("Time, slider"), page.locator("#field-horizon_s")
    slider.focus()
    page.keyboard.press("ArrowRight")
    assert field.input_value() == "10.1"
    for key, end in {"Home": "min", "End": "max"}.items():
        page.keyboard.press(key)
        assert field.input_value() == slider.get_attribute(end)
    assert page.locator("#field-horizon_s-slider").get_attribute("min") == "0.1"


@pytest.mark.parametrize("view", ["mobility", "models", "drive"])
def test_where_the_service_is_away_the_page_says_so_and_finds_it_again(seen, view):
    seen.forgiven = ("ERR_FAILED", "Failed to fetch")
    page = seen.go(STEEP)
    page.wait_for_selector("[data-judged]")
    page.route("**/*", lambda route: route.abort())
    page.locator("#field-mass_kg").fill("500")
    assert "The service cannot be reached" in told(page)
    page.locator(f'nav a[data-view="{view}"]').click()
    page.get_by_role("heading", level=1).wait_for()
    assert "The service cannot be reached" in told(page)
    assert "TypeError" not in page.locator("main").inner_text()
    page.unroute("**/*")

    page.wait_for_selector(f'.view[data-view="{view}"] [data-shown]')  # by itself


def test_an_answer_comes_by_a_button_once_the_service_is_there_again(seen):
    seen.forgiven = ("ERR_FAILED",)
    page = seen.go(STEEP)
    page.wait_for_selector("[data-judged]")
    page.route("**/v1/**", lambda route: route.abort())
    page.locator("#field-mass_kg").fill("500")
    page.wait_for_selector("[data-unreachable]")
    page.unroute("**/v1/**")
    page.get_by_role("button", name="Try again").click()

    page.wait_for_selector('[data-shown*="mass_kg=500"]')


def test_a_map_says_that_it_is_rough_and_its_command_asks_for_all_of_it(seen):
    page, held = seen.page, []
    page.route("**/v1/mobility?*torque_steps=27*", lambda route: held.append(route))  # else what is rough may be gone
    seen.go("#mobility?mass_kg=430&horizon_s=10&torque_min_nm=0&torque_max_nm=130&slope_min_deg=0&slope_max_deg=35")
    page.wait_for_selector("[data-rough]")
    assert "torque_steps=27" in page.locator("pre").inner_text()
    for _ in range(400):
        if held:
            break
        page.wait_for_timeout(50)
    held.pop().continue_()
    page.wait_for_selector('[data-cells="all"]')
    assert "steepest slope" in page.locator(".notice").first.inner_text()


def test_an_emptied_field_of_a_drive_shows_again_what_is_asked(seen):
    page = seen.go("#drive?mass_kg=430&slopes=0:10&torques=0:100,6:80&horizon_s=10")
    page.wait_for_selector("[data-shown]")
    page.get_by_label("Torque, N m, change 2").fill("")
    page.keyboard.press("Tab")

    assert page.get_by_label("Torque, N m, change 2").input_value() == "80"


def test_what_was_said_of_a_file_goes_with_its_track(seen):
    page = seen.go("#drive?mass_kg=430&slopes=0:10&torques=0:100&horizon_s=10")
    page.wait_for_selector("[data-shown]")
    page.locator("#field-mass_kg").fill("440")
    page.keyboard.press("Tab")
    page.get_by_text("Load an elevation profile").click()
    page.locator("#drive-text").fill("0, 0\n1, x")
    page.get_by_role("button", name="Use this text").click()
    page.locator("#drive-file-said").get_by_text("Line 2").wait_for()
    page.go_back()
    page.wait_for_selector('[data-shown*="mass_kg=430"]')

    assert page.locator("#drive-file-said").is_hidden()


def test_the_card_names_its_datasets_without_a_token(seen, shipped):
    page = seen.go("#models?model=viper-lunar&version=5")
    page.wait_for_selector("div[data-part=card][data-shown]")
    card = shipped.get("/v1/models/viper-lunar/versions/5/card", format="json").json()
    words = page.locator("dd ul.plain li").all_inner_texts()

    assert card["datasets"]
    assert [each.split(" ")[0] for each in words] == [each["name"] for each in card["datasets"]]
