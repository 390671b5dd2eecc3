"""Adds to a CycloneDX document what a Python environment does not know of: `bom.py DOCUMENT VARIANT ENVIRONMENT`.

The libraries that were compiled while building (with their SHA-256), the Python interpreter, and the packages of the
system beneath. The document is rewritten in place; one that is not as the schema says ends the build.
"""

from __future__ import annotations

import hashlib
import json
import platform
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

NATIVE = ("service/learning/drive/native", "service/fmu/native", "service/wire/native")
LIBRARIES = (".so", ".dll", ".dylib")
DPKG = Path("/var/lib/dpkg/status")


def compiled(packages: Path) -> Iterator[dict[str, Any]]:
    """Our own libraries: made from C in this repository with the compiler that pyproject.toml names."""
    for folder in NATIVE:
        for file in sorted((packages / folder).iterdir()):
            if file.suffix in LIBRARIES:
                name = str(file.relative_to(packages))
                yield {
                    "type": "library",
                    "bom-ref": f"compiled:{name}",
                    "name": name,
                    "version": hashlib.sha256(file.read_bytes()).hexdigest()[:12],
                    "description": "compiled from C while the image was built",
                    "hashes": [{"alg": "SHA-256", "content": hashlib.sha256(file.read_bytes()).hexdigest()}],
                    "licenses": [{"license": {"id": "Apache-2.0"}}],
                }


def system(status: Path) -> Iterator[dict[str, Any]]:
    """The installed Debian packages, by name and version. Their licences lie in /usr/share/doc/*/copyright."""
    for paragraph in status.read_text(encoding="utf-8", errors="replace").split("\n\n"):
        fields = dict(line.split(": ", 1) for line in paragraph.splitlines() if ": " in line and line[0] != " ")
        if fields.get("Status", "").endswith(" installed"):
            name, version = fields["Package"], fields["Version"]
            purl = f"pkg:deb/debian/{name}@{version}?arch={fields['Architecture']}".replace("+", "%2B")
            yield {"type": "library", "bom-ref": purl, "name": name, "version": version, "purl": purl}


def _license(packages: Path, component: dict[str, Any]) -> str:
    """What the package says of its licence itself."""
    folder = next(packages.glob(f"{component['name'].replace('-', '_')}-{component['version']}.dist-info"), None)
    lines = (folder / "METADATA").read_text(encoding="utf-8").splitlines() if folder else []
    return next((line.partition(": ")[2] for line in lines if line.startswith("License: ")), "see its LICENSE file")


def complete(document: dict[str, Any], packages: Path, variant: str, status: Path = DPKG) -> dict[str, Any]:
    """The document with all of it; `variant` is the image's name in it."""
    python = {
        "type": "platform",
        "bom-ref": "python",
        "name": "cpython",
        "version": platform.python_version(),
        "licenses": [{"license": {"id": "Python-2.0"}}],
    }
    for component in document["components"]:
        if not component.get("licenses"):  # named in words of its own, which are no SPDX identifier
            component["licenses"] = [{"license": {"name": _license(packages, component)}}]
    more = [python, *compiled(packages), *(system(status) if status.exists() else ())]
    image = {"type": "container", "bom-ref": "image", "name": variant}
    depends = {"ref": "image", "dependsOn": sorted(each["bom-ref"] for each in [*document["components"], *more])}
    return {
        **document,
        "metadata": {**document.get("metadata", {}), "component": image},
        "components": [*document["components"], *more],
        "dependencies": [*document.get("dependencies", []), depends],
    }


def main(document: Path, variant: str, environment: Path) -> str | None:
    """Complete the document; what is wrong with it by the schema, else None."""
    from cyclonedx.schema import SchemaVersion  # noqa: PLC0415 - where the document was made
    from cyclonedx.validation.json import JsonStrictValidator  # noqa: PLC0415
    from jsonschema import Draft7Validator  # noqa: PLC0415

    # An address is taken for one: the parser for them is nine tenths of the time, and it is in pip's metadata already.
    Draft7Validator.FORMAT_CHECKER.checkers.pop("iri-reference", None)
    packages = next(environment.glob("lib/python3*/site-packages"))
    whole = complete(json.loads(document.read_text(encoding="utf-8")), packages, variant)
    text = json.dumps(whole, indent=1, sort_keys=True)
    document.write_text(text, encoding="utf-8")
    wrong = JsonStrictValidator(SchemaVersion.V1_6).validate_str(text)
    return None if wrong is None else str(wrong)[:2000]


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3])))
