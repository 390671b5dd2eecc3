"""A version as an FMU in a file."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from pathlib import Path

from model_store import ModelStore
from service.cli.views.models import find_version
from service.fmu import Fmi, fmu_bytes
from service.twin.load import load_twin


@dataclass(frozen=True, slots=True)
class Written:
    """Which version (name@number), and how many bytes."""

    version: str
    size: int


def write_fmu(store: ModelStore, reference: str, fmi: str, output: Path) -> Written:
    """Write the archive, whole or not at all, over one that is there.

    Raises InvalidValueError for a version of another architecture, OSError, and what the store raises.
    """
    manifest = find_version(store, reference)
    content = fmu_bytes(load_twin(store, manifest.name, manifest.version), Fmi(fmi))
    handle, beside = tempfile.mkstemp(prefix=f".{output.name}.", dir=output.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        Path(beside).chmod(0o644)
        Path(beside).replace(output)
    finally:
        Path(beside).unlink(missing_ok=True)
    return Written(f"{manifest.name}@{manifest.version}", len(content))
