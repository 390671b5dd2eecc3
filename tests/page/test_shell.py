"""The shell around the views: addresses, themes, sizes, keyboard, token, accessibility."""

from __future__ import annotations

import pytest

from tests.api.conftest import TOKEN
from tests.page.conftest import DESKTOP, PHONE, VIEWS


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("view", VIEWS)
def test_axe_finds_nothing_in_any_view_and_theme(open_at, shipped, view, scheme):
    seen = open_at(shipped.url, scheme)
    page = seen.go(f"#{view}")
    page.wait_for_selector(f'.view[data-view="{view}"] h1')
    page.wait_for_load_state("networkidle")

    assert page.locator(f'nav a[data-view="{view}"]').get_attribute("aria-current") == "page"
    assert seen.violations() == []


@pytest.mark.parametrize("view", VIEWS)
def test_nothing_is_wider_than_a_phone(open_at, shipped, view):
    page = open_at(shipped.url, size=PHONE).go(f"#{view}")
    page.wait_for_selector(f'.view[data-view="{view}"] h1')
    page.wait_for_load_state("networkidle")

    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE[0]


def test_both_themes_follow_the_system(open_at, shipped):
    def background(scheme):
        page = open_at(shipped.url, scheme, DESKTOP).go("#slope")
        return page.evaluate("getComputedStyle(document.documentElement).backgroundColor")

    assert background("light") == "rgb(238, 241, 245)"
    assert background("dark") == "rgb(11, 17, 24)"


def test_back_returns_to_the_view_and_its_question(seen):
    page = seen.go("#slope?slope_deg=20&mass_kg=500&torque_nm=60&horizon_s=8")
    page.wait_for_selector("[data-shown]")
    page.get_by_role("link", name="Mobility").click()
    page.wait_for_selector('.view[data-view="mobility"] h1')
    page.go_back()
    page.wait_for_selector('.view[data-view="slope"] [data-shown]')

    assert page.locator("#field-mass_kg").input_value() == "500"
    assert page.title().startswith("Slope")
    page.go_forward()
    page.wait_for_selector('.view[data-view="mobility"] h1')


def test_views_are_left_and_found_again_with_their_question(seen):
    page = seen.go("#slope?slope_deg=20&mass_kg=500&torque_nm=60&horizon_s=8")
    page.wait_for_selector("[data-shown]")
    page.get_by_role("link", name="Mobility").click()
    page.wait_for_selector('.view[data-view="mobility"] h1')
    page.get_by_role("link", name="Slope").click()
    page.wait_for_selector('.view[data-view="slope"] [data-shown]')

    assert page.locator("#field-mass_kg").input_value() == "500"


def test_an_unknown_view_says_so(seen):
    page = seen.go("#moon?slope_deg=1")

    page.get_by_role("heading", name="No such view").wait_for()
    page.get_by_role("link", name="Slope").click()
    page.wait_for_selector("[data-shown]")


def test_the_keyboard_alone_gets_from_the_first_link_to_a_view(seen):
    page = seen.go("#slope")
    page.wait_for_selector("[data-shown]")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.id") == "skip"
    for _ in range(3):
        page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.dataset.view") == "mobility"
    page.keyboard.press("Enter")
    page.wait_for_selector('.view[data-view="mobility"] h1')

    assert page.evaluate("document.activeElement.id") == "main"


def test_where_a_token_is_needed_the_page_asks_for_it_and_keeps_it_nowhere(open_at, serve, store, publish, move):
    move(store, publish(store))
    running = serve(admin_token=TOKEN, require_token=True, start_worker=False)
    seen = open_at(running.url)
    seen.forgiven = ("401", "429")
    page = seen.go("#slope")
    page.get_by_role("dialog").wait_for()
    assert seen.violations() == []
    page.get_by_label("Token", exact=True).fill(TOKEN)
    page.get_by_role("button", name="Use").click()
    page.wait_for_selector("[data-shown]")

    assert page.get_by_role("button", name="Token in use").is_visible()
    kept = "JSON.stringify([localStorage, sessionStorage, document.cookie, location.href, history.state])"
    assert TOKEN not in page.evaluate(kept)
    page.reload()
    page.get_by_role("dialog").wait_for()
