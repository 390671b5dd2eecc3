"""The page in a real Chromium: the system's, for nothing is downloaded. Where there is none, these tests skip."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, BrowserContext, Page, sync_playwright

from service.settings import Settings
from tests.api.conftest import Running, move, publish, serve, service, serving, store

__all__ = ["move", "publish", "serve", "service", "store"]  # fixtures
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
DESKTOP, PHONE = (1280, 900), (360, 740)
VIEWS = ("drive", "slope", "mobility", "models")
WAIT_MS = 20_000.0


def found_chromium() -> str | None:
    """The program of the system's browser."""
    return next(filter(None, map(shutil.which, NAMES)), None)


def launched_with() -> list[str]:
    """Root, as in a container of a CI, has no sandbox."""
    return ["--no-sandbox"] if os.geteuid() == 0 else []


@dataclass
class Seen:
    """A page, and what the browser told of it."""

    page: Page
    origin: str
    errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)
    forgiven: tuple[str, ...] = ()  # parts of errors that the test provokes

    def watch(self) -> None:
        """Hear what the page complains of, and whom it asks."""
        self.page.set_default_timeout(WAIT_MS)
        self.page.on(
            "console", lambda said: self.errors.append(said.text) if said.type in ("error", "warning") else None
        )
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))

    def go(self, address: str) -> Page:
        """Open an address of the page: `#slope?mass_kg=430`."""
        self.page.goto(f"{self.origin}/{address}")
        return self.page

    def require_clean(self) -> None:
        """No complaint of the browser, no request to another host."""
        assert [each for each in self.errors if not any(part in each for part in self.forgiven)] == []
        hosts = {urlsplit(each).netloc for each in self.requests if not each.startswith(("blob:", "data:"))}
        assert hosts <= {urlsplit(self.origin).netloc}, hosts

    def violations(self) -> list[str]:
        """What axe finds wrong, each with the elements: in the page's theme, and the colours of the other one."""
        found = Axe().run(self.page).response["violations"]
        other = "light" if self.page.evaluate("matchMedia('(prefers-color-scheme: dark)').matches") else "dark"
        self.page.emulate_media(color_scheme=other)
        self.page.evaluate("document.getAnimations().forEach((each) => each.finish())")  # colours fade over
        found += Axe().run(self.page, options={"runOnly": ["color-contrast"]}).response["violations"]
        return [f"{each['id']}: {[node['html'][:150] for node in each['nodes']]}" for each in found]


Open = Callable[..., Seen]


@pytest.fixture(scope="module")
def browser(processes: None) -> Iterator[Browser]:
    """A browser for one file of tests: while Playwright is there, its event loop is in the way of others."""
    program = found_chromium()
    if program is None:
        pytest.skip(f"no Chromium is installed ({', '.join(NAMES)})")
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=program, args=launched_with())
        yield chromium
        chromium.close()


@pytest.fixture(scope="session")
def shipped() -> Iterator[Running]:
    """A ready service with the shipped models."""
    with serving(Path(Settings().store_url)) as running:
        running.wait_ready()
        yield running


@pytest.fixture
def open_at(browser: Browser, serve: object) -> Iterator[Open]:
    """Opens a browser of its own at a service: `open_at(running.url, scheme="dark", size=PHONE)`.

    It asks for `serve`, so that pages close before a service of the test ends: an open one would complain.
    """
    opened: list[tuple[BrowserContext, Seen]] = []

    def at(url: str, scheme: str = "light", size: tuple[int, int] = DESKTOP) -> Seen:
        context = browser.new_context(
            color_scheme="dark" if scheme == "dark" else "light", viewport={"width": size[0], "height": size[1]}
        )
        seen = Seen(context.new_page(), url)
        seen.watch()
        opened.append((context, seen))
        return seen

    yield at
    for context, seen in opened:
        context.close()
        seen.require_clean()


@pytest.fixture
def seen(open_at: Open, shipped: Running) -> Seen:
    """A browser at the service with the shipped models."""
    return open_at(shipped.url)
