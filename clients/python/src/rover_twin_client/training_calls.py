"""Builds the operator's calls: datasets, training jobs, aliases. Both clients send these calls. No I/O."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from typing import Any
from urllib.parse import quote

from rover_twin_client import training_parsing as parsing
from rover_twin_client.calls import Call, checked_name, finite, flag, refused, said, whole
from rover_twin_client.training import Alias, Dataset, DatasetInfo, TrainingJob, Upload, VersionState

DATASETS = "/v1/admin/datasets"
JOBS = "/v1/admin/training-jobs"
PAGE = 200
# The service needs minutes for a gigabyte of text, and answers only at the end.
UPLOAD_S = 900.0
_ARGUMENTS = {
    **{f"split.{name}": name for name in ("test_slopes_deg", "test_fraction")},
    **{f"budget.{name}": name for name in ("max_epochs", "max_minutes")},
    "Idempotency-Key": "idempotency_key",
}
_KEY = re.compile(r"[\x21\x23-\x5b\x5d-\x7e]{1,255}")


def upload(fields: Mapping[str, str], *, retried: bool) -> Call[Upload]:
    """POST /v1/admin/datasets. Harmless to repeat: the same content is the same dataset."""
    return Call(
        DATASETS, parsing.upload, method="POST", form=fields, statuses=(200, 201), read_s=UPLOAD_S, retried=retried,
        always_patient=True,
    )  # fmt: skip


def upload_fields(
    *,
    name: str | None,
    description: str | None,
    slope_deg: float | None,
    mass_kg: float | None,
    torque_nm: float | None,
    horizon_s: float | None,
    set_name: str | None,
    column_map: str | Mapping[str, object] | None,
    frame: str | None,
    reference: str | None,
    start: str | float | None,
    passport: Mapping[str, object] | None,
    strict: bool,
    dry_run: bool,
) -> dict[str, str]:
    """The fields of the form beside the file. The service has a default for every None."""
    fields: dict[str, str] = said(
        name=name, description=description, set_name=set_name, frame=frame, reference=reference
    )
    if start is not None:
        fields["start"] = start if isinstance(start, str) else repr(finite("start", start))
    numbers = said(slope_deg=slope_deg, mass_kg=mass_kg, torque_nm=torque_nm, horizon_s=horizon_s)
    fields |= {field: repr(finite(field, value)) for field, value in numbers.items()}
    if column_map is not None:
        fields["column_map"] = column_map if isinstance(column_map, str) else _json("column_map", column_map)
    if passport is not None:
        fields["passport"] = _json("passport", passport)
    flags = {"strict": strict, "dry_run": dry_run}
    return fields | {field: "true" for field, wanted in flags.items() if flag(field, wanted)}


def datasets(after: str | None) -> Call[tuple[list[DatasetInfo], bool]]:
    """GET /v1/admin/datasets: one page."""
    return Call(DATASETS, parsing.datasets, {"limit": str(PAGE), **said(after=after)})


def dataset(reference: str) -> Call[Dataset]:
    """GET /v1/admin/datasets/{dataset}."""
    return Call(_path(DATASETS, "dataset", reference), parsing.dataset)


def preview(reference: str, form: str) -> Call[bytes]:
    """GET /v1/admin/datasets/{dataset}/preview."""
    path = f"{_path(DATASETS, 'dataset', reference)}/preview"
    return Call(path, parsing.content, {"format": form}, is_document=False, words={"format": "form"})


def download(reference: str) -> Call[bytes]:
    """GET /v1/admin/datasets/{dataset}/download. The clients write its body to a file while they receive it."""
    path = f"{_path(DATASETS, 'dataset', reference)}/download"
    return Call(path, parsing.content, is_document=False)


def delete_dataset(identity: str) -> Call[None]:
    """DELETE /v1/admin/datasets/{id}."""
    path = _path(DATASETS, "dataset", identity)
    return Call(path, parsing.nothing, method="DELETE", statuses=(204,), retried=False)


def start(request: Mapping[str, Any], key: str) -> Call[TrainingJob]:
    """POST /v1/admin/training-jobs. Harmless to repeat: the same request with the same key is the same job."""
    if not isinstance(key, str) or not _KEY.fullmatch(key):
        raise refused("idempotency_key", key, "1 to 255 visible ASCII characters without quotes and backslashes")
    headers = {"Idempotency-Key": f'"{key}"'}
    return Call(JOBS, parsing.job, method="POST", json=request, headers=headers, statuses=(202,), words=_ARGUMENTS)


def job_request(
    model: str,
    datasets: Iterable[str],
    *,
    test_slopes_deg: Iterable[float],
    test_fraction: float | None,
    max_epochs: int | None,
    max_minutes: float | None,
    seed: int | None,
    margin: float | None,
    inputs: Iterable[str] | None,
    **others: str | None,
) -> dict[str, Any]:
    """The body of a request for a training job. The service has a default for every None."""
    asked: dict[str, Any] = {
        "model": model,
        "datasets": [datasets] if isinstance(datasets, str) else list(datasets),
        **said(**others),
    }
    split: dict[str, Any] = {name: finite(name, value) for name, value in said(test_fraction=test_fraction).items()}
    slopes = [finite("test_slopes_deg", slope) for slope in test_slopes_deg]
    if slopes:
        split["test_slopes_deg"] = slopes
    budget: dict[str, Any] = {name: finite(name, value) for name, value in said(max_minutes=max_minutes).items()}
    budget |= {name: int(whole(name, value)) for name, value in said(max_epochs=max_epochs).items()}
    asked |= {name: int(whole(name, value)) for name, value in said(seed=seed).items()}
    asked |= {name: finite(name, value) for name, value in said(margin=margin).items()}
    asked |= {name: list(value) for name, value in said(inputs=inputs).items()}
    return asked | {name: part for name, part in (("split", split), ("budget", budget)) if part}


def job(job_id: str) -> Call[TrainingJob]:
    """GET /v1/admin/training-jobs/{id}."""
    return Call(_path(JOBS, "job_id", job_id), parsing.job)


def jobs(*, state: str | None, model: str | None, limit: int, before: str | None) -> Call[list[TrainingJob]]:
    """GET /v1/admin/training-jobs: one page, newest first."""
    query = {"limit": whole("limit", limit), **said(state=state, model=model, before=before)}
    return Call(JOBS, parsing.jobs, query)


def cancel(job_id: str) -> Call[TrainingJob]:
    """POST /v1/admin/training-jobs/{id}/cancel."""
    path = f"{_path(JOBS, 'job_id', job_id)}/cancel"
    return Call(path, parsing.job, method="POST", statuses=(202,), retried=False)


def events_path(job_id: str) -> str:
    """The path of /v1/admin/training-jobs/{id}/events."""
    return f"{_path(JOBS, 'job_id', job_id)}/events"


def alias(name: str, alias: str) -> Call[Alias]:
    """GET /v1/models/{name}/aliases/{alias}."""
    return Call(_alias_path(name, alias), parsing.alias)


def alias_history(name: str, alias: str) -> Call[list[Alias]]:
    """GET /v1/models/{name}/aliases/{alias}/history."""
    return Call(f"{_alias_path(name, alias)}/history", parsing.aliases)


def move_alias(name: str, alias: str, version: int, reason: str, expected: Alias | str | None) -> Call[Alias]:
    """PUT /v1/models/{name}/aliases/{alias}."""
    body = {"version": int(whole("version", version)), "reason": reason}
    path = _alias_path(name, alias)
    return Call(
        path, parsing.alias, method="PUT", json=body, headers=_condition(expected), statuses=(200, 201), retried=False
    )


def rollback_alias(name: str, alias: str, reason: str, expected: Alias | str | None) -> Call[Alias]:
    """POST /v1/models/{name}/aliases/{alias}/rollback."""
    path = f"{_alias_path(name, alias)}/rollback"
    headers = _condition(expected)
    return Call(path, parsing.alias, method="POST", json={"reason": reason}, headers=headers, retried=False)


def version_state(name: str, version: int) -> Call[VersionState]:
    """GET /v1/models/{name}/versions/{version}/state."""
    return Call(f"/v1/{_version_path(name, version)}/state", parsing.version_state)


def change_version(name: str, version: int, change: str, reason: str) -> Call[VersionState]:
    """POST /v1/admin/models/{name}/versions/{version}/archive or /restore. Harmless to repeat."""
    path = f"/v1/admin/{_version_path(name, version)}/{change}"
    return Call(path, parsing.version_state, method="POST", json={"reason": reason})


def delete_version(name: str, version: int, reason: str) -> Call[VersionState]:
    """DELETE /v1/admin/models/{name}/versions/{version}. Harmless to repeat."""
    path = f"/v1/admin/{_version_path(name, version)}"
    return Call(path, parsing.version_state, {"reason": reason}, method="DELETE")


def _version_path(name: str, version: int) -> str:
    return f"models/{checked_name(name)}/versions/{whole('version', version)}"


def _condition(expected: Alias | str | None) -> dict[str, str]:
    if expected is None:
        return {}
    tag = expected.etag if isinstance(expected, Alias) else expected
    if not re.fullmatch(r'\*|"[0-9]+"', tag):
        raise refused("expected", tag, 'an Alias, its etag such as \'"3"\', or "*"')
    return {"If-Match": tag}


def _alias_path(name: str, alias: str) -> str:
    return f"/v1/models/{checked_name(name)}/aliases/{checked_name(alias, 'alias')}"


def _path(collection: str, field: str, reference: str) -> str:
    # The reference becomes part of the address. Names of datasets may have dots, but `..` would lead elsewhere.
    if not isinstance(reference, str) or not reference.strip(".") or len(reference) > 200:
        raise refused(field, reference, "an id or a name, at most 200 characters")
    return f"{collection}/{quote(reference, safe='')}"


def _json(name: str, value: Mapping[str, object]) -> str:
    try:
        return json.dumps(dict(value), allow_nan=False)
    except (TypeError, ValueError) as fault:
        raise refused(name, value, "a mapping that JSON can hold") from fault
