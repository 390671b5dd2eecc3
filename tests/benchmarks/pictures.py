"""What pictures and pages cost, in processor seconds and bytes. Run: `python -m tests.benchmarks.pictures`."""

from __future__ import annotations

import gzip
import time
from collections.abc import Callable

import numpy as np

from model_store import ModelStore
from service.pictures.drawing import as_png, as_svg
from service.settings import load_settings
from service.twin import TwinRegistry
from service.twin.mobility import mobility_map
from service.wire.drives.ask import driven
from service.wire.drives.question import DriveBody
from service.wire.forms import ENCODERS, Format, PictureFormat
from service.wire.mobility_picture import drawing_of_map, map_as_html
from service.wire.versions.card import card_of
from service.wire.versions.comparison import ComparisonInputs, Two, compared
from service.wire.versions.written import written_card, written_comparison

_DRIVE = {
    "mass_kg": 430,
    "track": {"distance_m": [0, 4, 8], "slope_deg": [10, 28, 36]},
    "controls": {"time_s": [0], "torque_nm": [70]},
    "horizon_s": 30,
    "include": ["band"],
}
_TIMES = 3


def main() -> None:
    """A row for each picture: the least of three times."""
    settings = load_settings()
    store = ModelStore.open(settings.store_url)
    loaded = TwinRegistry(store, settings.default_model).get(None)
    twin = loaded.twin
    usual, finest = (
        mobility_map(twin, 430, np.linspace(30, 120, torques), np.linspace(0, 35, slopes), 10, 0.9)
        for torques, slopes in ((10, 36), (64, 64))
    )
    body = DriveBody.model_validate(_DRIVE)
    drive = driven(*body.asked(settings.max_points), False, loaded)
    card = card_of(store, twin.manifest, with_figures=True)
    comparison = compared(store, Two(twin.manifest, twin.manifest, (twin, twin)), ComparisonInputs.model_validate({}))
    rows: dict[str, dict[str, Callable[[], bytes]]] = {
        f"mobility map, {found.inside_domain.size} cells": {
            "svg": lambda found=found: as_svg(drawing_of_map(loaded, found)),
            "png": lambda found=found: as_png(drawing_of_map(loaded, found)),
            "html": lambda found=found: map_as_html(loaded, found),
        }
        for found in (usual, finest)
    }
    kinds = ("svg", "png", "html")
    rows["drive"] = {kind: lambda kind=kind: ENCODERS[Format(kind)].encode(drive) for kind in kinds}
    rows["card"] = {kind: lambda kind=kind: written_card(card, PictureFormat(kind)) for kind in kinds}
    rows["comparison"] = {kind: lambda kind=kind: written_comparison(comparison, PictureFormat(kind)) for kind in kinds}
    print("| picture | form | processor, s | kB | kB gzipped |\n|---|---|---:|---:|---:|")
    for name, forms in rows.items():
        for kind, draw in forms.items():
            seconds, content = _least(draw)
            sizes = f"{len(content) / 1e3:.0f} | {len(gzip.compress(content)) / 1e3:.0f}"
            print(f"| {name} | {kind} | {seconds:.2f} | {sizes} |")


def _least(draw: Callable[[], bytes]) -> tuple[float, bytes]:
    taken = []
    for _ in range(_TIMES):
        began = time.process_time()
        content = draw()
        taken.append(time.process_time() - began)
    return min(taken), content


if __name__ == "__main__":
    main()
