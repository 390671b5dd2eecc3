"""The editor of a track: pointer, keys, table, files; each asks the service anew."""

from __future__ import annotations

import re

import pytest

from tests.page.test_drive import COAST, HILL, answered, opened, shown, wait_for

PROFILE = "distance_m,elevation_m\n0,0\n2,0.2\n4,0.9\n6,1.4\n9,1.5\n"


def track_of(page):
    """The track in the address, as pairs of numbers."""
    address = page.evaluate("location.hash")
    found = re.search(r"(slopes|elevations)=([^&]*)", address)
    assert found, address
    return found[1], [tuple(map(float, each.split(":"))) for each in found[2].split(",")]


def knot(page, number):
    return page.locator(f'[data-knot="{number}"]')


def wait_until_written(page, before):
    page.wait_for_function("(before) => location.hash !== before", arg=before)


def load(page, text, name="profile.csv"):
    summary = page.get_by_text("Load an elevation profile")
    if not page.locator("#drive-file").is_visible():
        summary.click()
    page.locator("#drive-file").set_input_files(
        {"name": name, "mimeType": "text/csv", "buffer": text if isinstance(text, bytes) else text.encode()}
    )


def test_a_knot_that_is_dragged_changes_the_question(seen, shipped):
    page = opened(seen, COAST, until_distance_m=8)
    before = page.evaluate("location.hash")
    knot(page, 1).scroll_into_view_if_needed()
    box = knot(page, 1).bounding_box()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(*middle)
    page.mouse.down()
    for step in range(1, 9):
        page.mouse.move(middle[0] + 4 * step, middle[1] + 5 * step)
    page.mouse.up()
    wait_until_written(page, before)
    _, knots = track_of(page)
    wait_for(page, slopes="%2C".join(f"{x:g}%3A{y:g}" for x, y in knots))

    assert knots[0] == (0, 18)
    assert knots[2] == (8, 20)
    assert 4.2 < knots[1][0] < 5.2
    assert 8 < knots[1][1] < 21
    question = {"track": {"distance_m": [x for x, _ in knots], "slope_deg": [y for _, y in knots]}}
    assert float(shown(page, "final_x_m")) == answered(shipped, **question)["summary"]["final_x_m"]
    page.go_back()
    wait_for(page, slopes="0%3A18%2C4%3A22%2C8%3A20")
    assert knot(page, 1).get_attribute("aria-valuenow") == "22"


def test_a_knot_is_moved_added_and_removed_by_keys(seen, shipped):
    page = opened(seen, COAST, until_distance_m=8)
    knot(page, 0).focus()
    page.keyboard.press("PageDown")
    assert page.evaluate("document.activeElement.dataset.knot") == "1"
    for key in ("ArrowUp", "ArrowUp", "Shift+ArrowDown", "ArrowRight"):
        page.keyboard.press(key)
    wait_for(page, slopes="0%3A18%2C4.1%3A22.9%2C8%3A20")

    assert knot(page, 1).get_attribute("aria-valuetext") == "at 4.10 m: slope 22.90 °"
    assert page.evaluate("document.activeElement.dataset.knot") == "1"
    track = {"distance_m": [0, 4.1, 8], "slope_deg": [18, 22.9, 20]}
    assert float(shown(page, "final_x_m")) == answered(shipped, track=track)["summary"]["final_x_m"]
    page.keyboard.press("Insert")
    wait_for(page, slopes="0%3A18%2C4.1%3A22.9%2C6.05%3A21.45%2C8%3A20")
    assert page.evaluate("document.activeElement.dataset.knot") == "2"
    page.keyboard.press("Delete")
    wait_for(page, slopes="0%3A18%2C4.1%3A22.9%2C8%3A20")


def test_a_double_click_adds_a_knot_there(seen):
    page = opened(seen, COAST, until_distance_m=8)
    page.locator("svg.track").scroll_into_view_if_needed()
    one, other = knot(page, 1).bounding_box(), knot(page, 2).bounding_box()
    page.mouse.dblclick((one["x"] + other["x"]) / 2 + one["width"] / 2, one["y"] + 90)
    page.wait_for_selector('[data-knot="3"]')
    _, knots = track_of(page)

    assert len(knots) == 4
    assert knots[2][0] == pytest.approx(6, abs=0.1)
    assert knots[2][1] < 20


def test_the_table_has_every_knot_and_each_can_be_typed(seen, shipped):
    page = opened(seen, HILL, horizon_s=12)
    page.get_by_text("Knots as a table").click()
    page.get_by_label("elevation_m of knot 3").fill("1.3")
    page.keyboard.press("Tab")
    wait_for(page, elevations="-1%3A0.1%2C2%3A0.3%2C4%3A1.3%2C6%3A1.2")

    assert page.locator(".knots tbody tr").count() == 4
    page.get_by_label("Remove knot 4").click()
    wait_for(page, elevations="-1%3A0.1%2C2%3A0.3%2C4%3A1.3&")
    assert page.locator(".knots tbody tr").count() == 3


def test_elevations_become_the_same_track_as_slopes(seen):
    page = opened(seen, HILL, horizon_s=12)
    before = float(shown(page, "final_x_m"))
    page.get_by_role("button", name="Slope", exact=True).click()
    page.wait_for_selector('[data-shown*="slopes="]')

    assert float(shown(page, "final_x_m")) == pytest.approx(before, abs=2e-4)  # four digits in the address


def test_too_steep_is_told_at_the_track_in_the_services_words(seen):
    seen.forgiven = ("422",)
    page = opened(seen, HILL, horizon_s=12)
    page.get_by_text("Knots as a table").click()
    page.get_by_label("elevation_m of knot 3").fill("9")
    page.wait_for_selector('[data-verdict="none"]')

    assert "slopes from -45 to 45 deg" in page.get_by_role("alert").filter(has_text="elevation").inner_text()


def test_a_profile_from_a_file_is_asked_as_it_is(seen, shipped):
    page = opened(seen, COAST, until_distance_m=8)
    load(page, PROFILE)
    wait_for(page, elevations="0%3A0%2C2%3A0.2%2C4%3A0.9%2C6%3A1.4%2C9%3A1.5")
    track = {"horizontal_m": [0, 2, 4, 6, 9], "elevation_m": [0, 0.2, 0.9, 1.4, 1.5]}

    assert float(shown(page, "final_x_m")) == answered(shipped, track=track)["summary"]["final_x_m"]
    page.locator("#drive-text").fill("100\t5\n103\t5,5\n106\t6,1\n")
    page.get_by_role("button", name="Use this text").click()
    wait_for(page, elevations="0%3A5%2C3%3A5.5%2C6%3A6.1")
    assert "moved by -100 m" in page.get_by_text("Distances were moved").inner_text()


BAD_PROFILES: list[tuple[str | bytes, str]] = [
    ("", "no places"),
    ("x,z\n", "no places"),
    ("0,0\n", "one place"),
    ("0,0\n2,zwei\n", "Line 2: “zwei” is no number"),
    ("0,0\n1,1,1\n", "Line 2 has 3 columns"),
    ("0,0\n2,1\n2,1\n", "Line 3: distance 2 does not rise"),
    ("0,0\n1e999,1\n", "“1e999” is no number"),
    ("distance_km,elevation_m\n0,0\n1,1\n", "unit other than metres"),
    (b"PK\x03\x04\x00\x00", "is no text"),
    ("0,0\n" + "".join(f"{row},0\n" for row in range(1, 10_002)), "more than 10,000 places"),
    ("#" * 2_000_001, "2 MB are allowed"),
    ("<script>alert(1)</script>\n0,0\n1,1", "Line 1 has 1 column"),
]


def test_a_bad_profile_is_refused_with_the_reason_and_changes_nothing(seen):
    page = opened(seen, COAST, until_distance_m=8)
    before = page.evaluate("location.hash")
    for text, words in BAD_PROFILES:
        load(page, text)
        page.get_by_role("alert").filter(has_text=words).wait_for()

    assert page.evaluate("location.hash") == before


def test_a_long_profile_works_and_can_be_thinned_for_the_address(seen, shipped):
    page = opened(seen, COAST, until_distance_m=8)
    heights = [0.3 * row * 0.01 for row in range(3000)]
    load(page, "".join(f"{row / 100},{height}\n" for row, height in enumerate(heights)))
    wait_for(page, elevations="file")

    assert page.locator("[data-knot]").count() == 0
    assert "too long for the address" in page.locator(".notice.warn").first.inner_text()
    assert len(page.evaluate("location.hash")) < 500
    page.get_by_role("button", name="Keep the").click()
    page.wait_for_selector("[data-knot]")
    kind, knots = track_of(page)
    assert kind == "elevations"
    assert 2 <= len(knots) <= 30
    page.reload()
    wait_for(page, elevations="0%3A0")


def test_an_address_that_cannot_be_read_says_so(seen):
    page = opened(seen, "#drive?slopes=0:ten")

    assert "cannot be read" in page.locator(".notice.warn").first.inner_text()
    page.goto(f"{seen.origin}/#drive?elevations=file&mass_kg=400")
    page.get_by_text("was in a file").wait_for()


def test_every_example_can_be_asked(seen):
    page = opened(seen, COAST, until_distance_m=8)
    names = [
        each
        for each in page.locator("#drive-example option").evaluate_all("all => all.map((each) => each.value)")
        if each
    ]
    verdicts = {}
    for name in names:
        before = page.locator("[data-shown]").get_attribute("data-shown")
        page.get_by_label("Example").select_option(name)
        page.wait_for_function(
            "(before) => document.querySelector('[data-shown]').dataset.shown !== before", arg=before
        )
        verdicts[name] = page.locator("[data-verdict]").get_attribute("data-verdict")

    assert verdicts.pop("steep") == "bad"
    assert verdicts.pop("rim") == "good"
    assert set(verdicts.values()) <= {"good", "warn"}
