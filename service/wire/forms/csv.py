"""A prediction as a table: one header line, one line per time. What is no column goes into response headers."""

from __future__ import annotations

from service.wire.forms.numbers import dump
from service.wire.forms.subject import Subject


def encode_csv(subject: Subject) -> bytes:
    """Lines of comma-separated numbers, each ended by a line feed. Raises NonFiniteError."""
    columns = subject.columns()
    # orjson writes a column many times faster than a loop would, and the digits are then those of the JSON answer
    numbers = [dump(values)[1:-1].split(b",") for values in columns.values()]
    return b"\n".join([",".join(columns).encode(), *map(b",".join, zip(*numbers, strict=True)), b""])


def header_fields(subject: Subject) -> dict[str, str]:
    """Model, frame, domain, outcome and the band's level, if there is one, as response headers."""
    twin, prediction = subject.loaded.twin, subject.prediction
    level = {} if prediction.band is None else {"Rover-Twin-Band-Level": f"{prediction.band.level:.12g}"}
    return {
        "Rover-Twin-Model": f"{twin.name}@{twin.version}",
        "Rover-Twin-Frame": prediction.frame.value,
        "Rover-Twin-Domain": "inside" if prediction.domain.inside else "outside",
        "Rover-Twin-Outcome": prediction.summary.outcome.value,
        **level,
    }
