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

    Raises InvalidValueError for a version of another architecture, OSError, which names `output`, and what the store
    raises.
    """
    if os.path.isdir(output):  # noqa: PTH112 - false for a name that is too long
        raise IsADirectoryError(f"{output} is a folder; name a file, such as {output / 'viper.fmu'}")
    if not output.parent.is_dir():
        raise FileNotFoundError(f"{output} cannot be written: there is no folder {output.parent}")
    manifest = find_version(store, reference)
    content = fmu_bytes(load_twin(store, manifest.name, manifest.version), Fmi(fmi))
    try:
        _put(content, output)
    except OSError as error:
        raise OSError(f"{output} cannot be written: {error.strerror}") from error
    return Written(f"{manifest.name}@{manifest.version}", len(content))


def _put(content: bytes, output: Path) -> None:
    handle, beside = tempfile.mkstemp(prefix=f".{output.name}.", dir=output.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        Path(beside).chmod(0o644)
        Path(beside).replace(output)
    finally:
        Path(beside).unlink(missing_ok=True)
