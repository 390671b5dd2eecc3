"""The shell around the views: addresses, themes, sizes, keyboard, token, accessibility."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import quote

import httpx
import pytest

from tests.api.conftest import TOKEN
from tests.page.conftest import DESKTOP, PHONE, VIEWS


@pytest.mark.parametrize("view", VIEWS)
def test_axe_finds_nothing_in_any_view_and_theme(open_at, shipped, view):
    seen = open_at(shipped.url)
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


@pytest.mark.parametrize("address", ["#{}", "#slope?model={}", "#slope?slope_deg={}", "#mobility?layer={}&model={}"])
def test_markup_in_an_address_stays_text(seen, address):
    seen.forgiven = ("404", "422")
    page = seen.go(address.replace("{}", quote("<img src=x onerror=document.title=1>")))
    page.wait_for_selector("h1")
    page.wait_for_load_state("networkidle")

    assert page.locator("main img").count() == 0
    assert page.title() != "1"


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

    page.locator("#main:focus").wait_for()


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
    page.wait_for_selector('[data-form="csv"]')
    with page.expect_download() as loaded:
        page.locator('[data-form="csv"]').click()  # a plain link would come without the token
    assert loaded.value.path().read_text().startswith("time_s,x_m,y_m")
    page.reload()
    page.get_by_role("dialog").wait_for()


def test_with_a_token_the_footer_leads_on_and_a_service_that_was_away_is_found_again(
    open_at, serve, store, publish, move
):
    move(store, publish(store))
    running = serve(admin_token=TOKEN, require_token=True, start_worker=False)
    seen = open_at(running.url)
    seen.forgiven = ("401", "429", "ERR_FAILED", "Failed to fetch")
    page = seen.go("#slope")
    page.wait_for_load_state("networkidle")  # each refusal asks, a late one after "Cancel" too
    page.get_by_role("dialog").get_by_role("button", name="Cancel").click()
    page.get_by_role("link", name="OpenAPI").click()  # asks for the token
    page.get_by_label("Token", exact=True).fill(TOKEN)
    page.get_by_role("button", name="Use").click()
    page.wait_for_selector("[data-shown]")
    with page.expect_download() as loaded:
        page.get_by_role("link", name="OpenAPI").click()
    assert loaded.value.path().read_text().startswith('{"openapi"')
    page.get_by_role("link", name="API documentation").click()
    page.get_by_text("needs the token").wait_for()
    page.route("**/*", lambda route: route.abort())
    page.get_by_role("link", name="Mobility").click()
    page.wait_for_selector("[data-unreachable]")
    page.unroute("**/*")

    page.wait_for_selector('.view[data-view="mobility"] [data-shown]')
    assert page.get_by_role("button", name="Token in use").is_visible()


@contextmanager
def prefixed(origin: str) -> Iterator[str]:
    """A proxy that shows a service under `/rover/` and does not tell it."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            assert self.path.startswith("/rover/")
            self._send(httpx.get(origin + self.path.removeprefix("/rover"), trust_env=False))

        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            headers = {"Content-Type": self.headers["Content-Type"]}
            address = origin + self.path.removeprefix("/rover")
            self._send(httpx.post(address, content=body, headers=headers, trust_env=False))

        def _send(self, answer: httpx.Response) -> None:
            self.send_response(answer.status_code)
            for name in ("content-type", "content-security-policy"):
                if name in answer.headers:
                    self.send_header(name, answer.headers[name])
            self.send_header("Content-Length", str(len(answer.content)))
            self.end_headers()
            self.wfile.write(answer.content)

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{server.server_address[1]}/rover"
        server.shutdown()
        thread.join(10)


def test_behind_a_proxy_with_a_prefix_it_works_and_asks_under_the_prefix_only(open_at, shipped):
    with prefixed(shipped.url) as url:
        seen = open_at(url)
        page = seen.go("#slope?slope_deg=28&mass_kg=430&torque_nm=60&horizon_s=10")
        page.wait_for_selector("[data-judged]")

        assert all(each.startswith(f"{url}/") for each in seen.requests)
        assert page.locator('[data-form="csv"]').get_attribute("href").startswith(f"{url}/v1/predictions?")
        page.context.close()
