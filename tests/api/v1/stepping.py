"""A service that has the shipped models, and how its steps are asked."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from service.settings import Settings
from tests.api.conftest import Running, serving


def copy_models(folder: Path) -> None:
    """The shipped models, without the datasets."""
    shutil.copytree(Path(Settings().store_url) / "models", folder / "models")


@contextmanager
def stepping(folder: Path, **settings: object) -> Iterator[Running]:
    if not (folder / "models").exists():
        copy_models(folder)
    with serving(folder, **settings) as running:
        running.wait_ready()
        yield running


def begin(name: str = "a", mass_kg: float = 430.0, **told: object) -> dict[str, Any]:
    return {"id": name, "start": {"mass_kg": mass_kg}, "slope_deg": 20, "torque_nm": 60, "dt_s": 0.1} | told


def go_on(name: str, state: str | None = None, **told: object) -> dict[str, Any]:
    from_where = {} if state is None else {"state": state}
    return {"id": name, "slope_deg": 20, "torque_nm": 60, "dt_s": 0.1} | from_where | told
