"""How `rover-twin datasets` lays out what the store says."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from model_store import DatasetRecord
from service.cli.output import make_table

_SPANS = {
    "slope_deg": "slope, deg",
    "mass_kg": "mass, kg",
    "torque_nm": "torque, N m",
    "horizon_s": "horizon, s",
    "step_s": "sampling step, s",
    "distance_m": "distance, m",
}


def datasets_table(records: Sequence[DatasetRecord]) -> Table:
    """One line per dataset. Ids are cut to what `dataset` accepts comfortably."""
    table = make_table("id", "name", "runs", "rows", "slope deg", "mass kg", "torque N m", "published", left=2)
    for record in records:
        summary = record.summary
        spans = [_span(summary.get(name)) for name in ("slope_deg", "mass_kg", "torque_nm")]
        counts = [str(summary.get(name, "-")) for name in ("runs", "rows")]
        published = record.created_at.isoformat(timespec="seconds")
        table.add_row(record.id[:12], record.name, *counts, *spans, published)
    return table


def dataset_facts(record: DatasetRecord, names: Sequence[str]) -> Table:
    """Everything a person asks of one dataset; `names` are all that find it."""
    summary = record.summary
    sets, columns = summary.get("sets"), summary.get("columns")
    facts = {
        "name": ", ".join(names),
        "description": record.description,
        "published": f"{record.created_at.isoformat(timespec='seconds')} by {record.created_by}",
        "runs": summary.get("runs"),
        "rows": summary.get("rows"),
        **{words: _span(summary.get(name)) for name, words in _SPANS.items()},
        "changes underway": _varies(summary.get("varies")),
        "sets": ", ".join(f"{name} ({count})" for name, count in sets.items()) if isinstance(sets, dict) else None,
        "columns": ", ".join(map(str, columns)) if isinstance(columns, list) else None,
        "files": ", ".join(f"{path} ({entry.size_bytes} bytes)" for path, entry in record.files.items()),
    }
    table = make_table("id", record.id, left=2)
    for what, value in facts.items():
        table.add_row(what, "-" if value in (None, "") else str(value))
    return table


def _varies(counts: object) -> str | None:
    """In how many runs what changes; None where nothing does."""
    if not isinstance(counts, dict):
        return None
    words = {"slope_deg": "slope", "torque_nm": "torque", "brake": "brake"}
    said = (f"{words[name]} in {count} runs" for name, count in counts.items() if count and name in words)
    return ", ".join(said).replace(" 1 runs", " 1 run") or None


def _span(span: object) -> str:
    if not isinstance(span, dict) or not {"lowest", "highest"} <= span.keys():
        return "-"
    lowest, highest = (f"{span[end]:g}" for end in ("lowest", "highest"))
    return lowest if lowest == highest else f"{lowest} to {highest}"
