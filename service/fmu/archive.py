"""An FMU from a version: the same version gives the same bytes."""

from __future__ import annotations

import hashlib
import html
import io
import json
import zipfile
from enum import StrEnum

import service
from model_store import Manifest
from service.errors import InvalidValueError
from service.fmu import law_file, platforms
from service.fmu.description import LICENSE, About, description_xml
from service.learning.drive.model import DriveModel
from service.twin import Twin

_FORMAT = 1  # of what we put into the archive
_TIME = (1980, 1, 1, 0, 0, 0)  # the first that a zip archive can tell
_LICENSE_TEXT = f"SPDX-License-Identifier: {LICENSE}\n"


class Fmi(StrEnum):
    """Versions of the standard that are written."""

    TWO = "2.0"
    THREE = "3.0"


def fmu_bytes(twin: Twin, fmi: Fmi) -> bytes:
    """The archive. Raises InvalidValueError for another architecture, FmuLibraryError where libraries are missing."""
    model, manifest = twin.model, twin.manifest
    if not isinstance(model, DriveModel):
        allowed = "a version with the drive model: another one cannot be stepped, which is all that an FMU does"
        raise InvalidValueError("version", f"{manifest.name}@{manifest.version}", allowed)
    token, identifier = _token(manifest, fmi), _identifier(manifest.name)
    about = About(
        name=f"{manifest.name}@{manifest.version}",
        identifier=identifier,
        token=token,
        description=manifest.description,
        version=str(manifest.version),
        author=manifest.created_by,
        made_at=manifest.created_at,
    )
    files = {"modelDescription.xml": description_xml(about, fmi)}
    for place, content in platforms.binaries(fmi).items():
        folder, suffix = place.split("/")
        files[f"binaries/{folder}/{identifier}{suffix}"] = content
    files[f"resources/{law_file.NAME}"] = law_file.law_bytes(model, token)
    files |= _documentation(manifest)
    return _zipped(files)


def tag_of(manifest: Manifest, fmi: Fmi) -> str:
    """Tells the archive of a version from all others: it can be kept as long as this stays."""
    known = f"{_FORMAT} {fmi} {service.__version__} {platforms.digest()} {manifest.model_dump_json()}"
    return hashlib.sha256(known.encode()).hexdigest()


def _token(manifest: Manifest, fmi: Fmi) -> str:
    digits = tag_of(manifest, fmi)
    return "{" + "-".join((digits[:8], digits[8:12], digits[12:16], digits[16:20], digits[20:32])) + "}"


def _identifier(name: str) -> str:
    found = name.replace("-", "_")
    return found if found[0].isalpha() else f"rover_{found}"


def _documentation(manifest: Manifest) -> dict[str, bytes]:
    """The lineage, for people and for programs."""
    lines = [
        ("version", f"{manifest.name}@{manifest.version}"),
        ("description", manifest.description),
        ("published", f"{manifest.created_at.isoformat(timespec='seconds')} by {manifest.created_by}"),
        ("made by", f"rover-twin {service.__version__}"),
        ("code", manifest.lineage.code_version),
        ("datasets", ", ".join(manifest.lineage.datasets)),
        ("seed", str(manifest.lineage.seed)),
        ("command", manifest.lineage.command),
        *((f"sha256 of {path}", entry.sha256) for path, entry in manifest.files.items()),
    ]
    rows = "".join(f"<tr><th>{html.escape(what)}</th><td>{html.escape(text)}</td></tr>\n" for what, text in lines)
    page = (
        "<!DOCTYPE html>\n<html lang='en'><meta charset='utf-8'><title>Rover Twin</title>\n"
        "<p>The motion of a rover along a track, by slope, torque and brake. The whole manifest is "
        f"<a href='manifest.json'>manifest.json</a>.</p>\n<table>\n{rows}</table></html>\n"
    )
    told = json.dumps(manifest.model_dump(mode="json"), indent=1, sort_keys=True)
    return {
        "documentation/index.html": page.encode(),
        "documentation/manifest.json": told.encode(),
        "documentation/licenses/license.txt": _LICENSE_TEXT.encode(),
    }


def _zipped(files: dict[str, bytes]) -> bytes:
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, content in files.items():
            entry = zipfile.ZipInfo(path, _TIME)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system, entry.external_attr = 3, 0o644 << 16  # Unix, whatever writes it
            archive.writestr(entry, content)
    return sink.getvalue()
