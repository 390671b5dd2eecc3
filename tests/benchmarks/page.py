"""How soon the page is there, and how soon a curve follows a slider: `python -m tests.benchmarks.page`. Measures only.

A real Chromium without a window on this machine, at a service on loopback. First paint is the browser's own
`first-contentful-paint`, with an empty cache each time. A slider's time goes from its `input` event to the first frame
after the curve of that value was drawn.
"""

from __future__ import annotations

import argparse
import os
import statistics

from playwright.sync_api import Browser, Page, sync_playwright

from tests.benchmarks.machine import described, load_note
from tests.benchmarks.processes import HOST, service
from tests.page.conftest import found_chromium, launched_with

_SLOPE = "#slope?slope_deg=28&mass_kg=430&torque_nm=60&horizon_s=10"
_PAINT = "performance.getEntriesByName('first-contentful-paint')[0]?.startTime"
_BYTES = """performance.getEntriesByType('resource').concat(performance.getEntriesByType('navigation'))
    .filter((each) => !/[/](v1|health)[/]/.test(each.name)).reduce((sum, each) => sum + each.transferSize, 0)"""
_MOVE = """(value) => new Promise((done) => {
    const slider = document.querySelector('#field-mass_kg-slider'), room = document.querySelector('[data-shown]');
    const began = performance.now();
    const watch = new MutationObserver(() => {
        if (!room.dataset.shown.includes(`mass_kg=${value}&`)) return;
        watch.disconnect();
        const drawn = performance.now();
        requestAnimationFrame(() => setTimeout(() => done([drawn - began, performance.now() - began])));
    });
    watch.observe(room, { attributes: true, attributeFilter: ['data-shown'] });
    slider.value = value;
    slider.dispatchEvent(new Event('input', { bubbles: true }));
})"""


def main() -> None:
    """Measure and print."""
    asked = _arguments()
    program = found_chromium()
    if program is None:
        raise SystemExit("no Chromium is installed")
    before = os.getloadavg()
    with service() as running, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=launched_with())
        address = f"http://{HOST}:{running.port}/{_SLOPE}"
        paints, sizes = zip(*(_first_paint(browser, address) for _ in range(asked.visits)), strict=True)
        drawn, framed = _slider(browser, address, asked.moves)
        browser.close()
    print(f"{described()} {load_note(before)}\n")
    print("| what | p50 | p90 | most | bar |\n|---|---|---|---|---|")
    print(_row("first paint, empty cache, ms", paints, "1000"))
    print(_row("slider to curve drawn, ms", drawn, "50"))
    print(_row("slider to the frame that shows it, ms", framed, "50"))
    print(_row("page weight as sent, kB", [size / 1000 for size in sizes], "1500"))


def _first_paint(browser: Browser, address: str) -> tuple[float, float]:
    """Milliseconds, and bytes of the page's own files."""
    page = browser.new_page()
    page.goto(address)
    page.wait_for_selector("[data-shown]")
    paint, size = page.evaluate(_PAINT), page.evaluate(_BYTES)
    page.close()
    return float(paint), float(size)


def _slider(browser: Browser, address: str, moves: int) -> tuple[list[float], list[float]]:
    page: Page = browser.new_page()
    page.goto(address)
    page.wait_for_selector("[data-judged]")
    for mass in range(420, 430):
        page.evaluate(_MOVE, mass)
    found = [page.evaluate(_MOVE, 430 + move) for move in range(moves)]
    page.close()
    return [each[0] for each in found], [each[1] for each in found]


def _row(what: str, values: list[float] | tuple[float, ...], bar: str) -> str:
    middle, high = statistics.median(values), statistics.quantiles(values, n=10)[-1]
    return f"| {what} | {middle:.0f} | {high:.0f} | {max(values):.0f} | {bar} |"


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--visits", type=int, default=10)
    parser.add_argument("--moves", type=int, default=100)
    return parser.parse_args()


if __name__ == "__main__":
    main()
