"""What must be true after a kill; every check answers with what is wrong, by the column of the table it belongs to."""

from __future__ import annotations

from collections import Counter
from typing import Any

from model_store import AliasNotFoundError, AliasRecord, CorruptArtefactError, ModelNotFoundError, StoreError
from service.datasets.passport import PASSPORT_FILE
from service.errors import JobNotFoundError
from service.jobs.audit import MOST_LISTED, AuditLog
from service.jobs.job import TrainingJob
from service.training.gate import compare
from service.training.stored_dataset import RUNS_FILE
from tests.faults.crash_world import World
from tests.jobs.nursery import until

UPLOAD_LOST = "uploads lost"
JOB_LOST = "jobs lost"
STUCK = "jobs stuck"
FAILED = "jobs failed"
HALF = "half versions"
DOUBLE = "double versions"
ALIAS = "wrong alias"
WEIGHTS = "other weights"
AUDIT = "not on record"
LEFT = "left over"
COLUMNS = (UPLOAD_LOST, JOB_LOST, STUCK, FAILED, HALF, DOUBLE, ALIAS, WEIGHTS, AUDIT, LEFT)
_TIDY_S = 30.0
_SERVED_S = 10.0


def check_dataset(world: World, data: bytes, acknowledged: str | None) -> dict[str, str]:
    """After an upload: what was acknowledged is there and whole, and what was not can be sent again."""
    found: dict[str, str] = {}
    if acknowledged is not None and acknowledged not in world.store.dataset_ids():
        found[UPLOAD_LOST] = acknowledged
    identity = until(lambda: world.upload(data), 60, "an upload is acknowledged")
    if acknowledged not in (None, identity):
        found[UPLOAD_LOST] = f"{acknowledged} became {identity}"
    try:
        world.store.dataset(identity)
        for file in (RUNS_FILE, PASSPORT_FILE):
            world.store.read_dataset_file(identity, file)
    except StoreError as error:
        found[UPLOAD_LOST] = str(error)
    return found | _folders_left(world)


def check_job(
    world: World, request: dict[str, Any], acknowledged: str | None, again: str, weights: str
) -> dict[str, str]:
    """After a job: it ended well, as one whole version with the weights of an undisturbed one, and the right moves."""
    if acknowledged not in (None, again):
        return {JOB_LOST: f"{acknowledged} became {again}"}
    try:
        job = world.ended(again)
    except JobNotFoundError as error:
        return {JOB_LOST: str(error)}
    if job is None:
        return {STUCK: again}
    if job.result is None:
        return {FAILED: f"{again}: {job.state}, {job.failure}"}
    found = _check_versions(world, request["model"], job, weights)
    if wrong := _wrong_aliases(world, job):
        found[ALIAS] = "; ".join(wrong)
    return found | _work_left(world, again) | _folders_left(world)


def check_move(
    world: World, moved: str, before: list[AliasRecord], version: int, acknowledged: int | None
) -> dict[str, str]:
    """After an alias was moved by hand: it moved once or, if nobody was told so, not at all; and so it is served."""
    after = world.moves_of(moved)
    made = after[len(before) :]
    if after[: len(before)] != before or [record.version for record in made] not in ([], [version]):
        return {ALIAS: f"{moved} went from {before} to {after}, asked was for {version}"}
    if acknowledged is not None and [record.seq for record in made] != [acknowledged]:
        return {ALIAS: f"move {acknowledged} of {moved} was acknowledged, there is {made}"}
    if not made:
        # 0: the call that nobody was told of went on, and came first
        again = until(lambda: world.move(moved, version, len(before)) is not None, 30, "a move")
        if not again or [record.version for record in world.moves_of(moved)[len(before) :]] != [version]:
            return {ALIAS: f"asked for again, {moved} did not move to {version}"}
    try:
        until(lambda: world.served_version(moved) == version, _SERVED_S)
    except AssertionError:
        return {ALIAS: f"{moved} is {version}, served is {world.served_version(moved)}"}
    return {}


def check_audit(world: World) -> dict[str, str]:
    """Each call that was acknowledged since the last look is on record, with that status or none yet."""
    asked = dict(world.acknowledged)
    world.acknowledged.clear()
    log, before, missing = AuditLog(world.url, 365), None, dict(asked)
    while missing and (page := log.page(limit=MOST_LISTED, before=before)):
        before = page[-1].id
        for row in page:
            if row.status in (None, asked.get(row.request_id)):
                missing.pop(row.request_id, None)
    return {AUDIT: str(missing)} if missing else {}


def check_leftovers(world: World) -> dict[str, str]:
    """At the end, after all that was begun: nothing in the store is unreadable, nothing lies about."""
    found: dict[str, str] = {}
    for name in world.store.model_names():
        for version in world.store.versions(name):
            try:
                world.store.verify(name, version)
            except StoreError as error:
                found[HALF] = str(error)
    for identity in world.store.dataset_ids():
        try:
            world.store.read_dataset_file(identity, RUNS_FILE)
        except StoreError as error:
            found[UPLOAD_LOST] = str(error)
    if work := world.store.jobs_with_work():
        found[LEFT] = f"work of {work}"
    return found | _folders_left(world)


def _check_versions(world: World, model: str, job: TrainingJob, weights: str) -> dict[str, str]:
    found: dict[str, str] = {}
    owners: Counter[str | None] = Counter()
    try:
        for version in world.store.versions(model):
            manifest = world.store.verify(model, version)
            owners[manifest.lineage.job] += 1
            mine = manifest.lineage.job == job.id
            if mine and (job.result is None or job.result.version != version):
                found[DOUBLE] = f"{model}@{version} is of {job.id} too"
            if mine and manifest.files["weights.safetensors"].sha256 != weights:
                found[WEIGHTS] = f"{model}@{version} of {job.id}"
    except (CorruptArtefactError, ModelNotFoundError) as error:
        found[HALF] = str(error)
    if owners[job.id] != 1 and HALF not in found:
        found[DOUBLE if owners[job.id] else HALF] = f"{job.id} has {owners[job.id]} versions"
    return found


def _wrong_aliases(world: World, job: TrainingJob) -> list[str]:
    assert job.result is not None
    model, version = job.result.model, job.result.version
    candidate, champion = _history(world, model, "candidate"), _history(world, model, "champion")
    wrong = []
    if [record.version for record in _moves_of(candidate, job)] != [version]:
        wrong.append(f"candidate was not moved once to {version}: {candidate}")
    if candidate and candidate[-1].version != version:
        wrong.append(f"candidate is {candidate[-1].version}, the newest version is {version}")
    moves = _moves_of(champion, job)
    earlier = [record for record in champion if record not in moves]
    judged = compare(world.store, model, version, earlier[-1].version if earlier else None, margin=job.request.margin)
    if [record.version for record in moves] != ([version] if judged.promote else []):
        wrong.append(f"champion was moved {len(moves)} times by {job.id}, though: {judged.sentence()}")
    if job.result.promoted != bool(moves):
        wrong.append(f"{job.id} says promoted is {job.result.promoted}, it moved champion {len(moves)} times")
    for history in (candidate, champion):
        if [record.seq for record in history] != list(range(1, len(history) + 1)):
            wrong.append(f"numbers of moves have gaps: {history}")
        wrong += _dangling(world, model, history)
    return wrong


def _dangling(world: World, model: str, history: list[AliasRecord]) -> list[str]:
    known = world.store.versions(model)
    return [f"{model}@{record.version} is named and not there" for record in history if record.version not in known]


def _moves_of(history: list[AliasRecord], job: TrainingJob) -> list[AliasRecord]:
    return [record for record in history if job.id in record.reason]


def _history(world: World, model: str, alias: str) -> list[AliasRecord]:
    try:
        return world.store.alias_history(model, alias)
    except AliasNotFoundError:
        return []


def _work_left(world: World, job_id: str) -> dict[str, str]:
    return _left(lambda: world.store.work_names(job_id), f"work of {job_id}")


def _folders_left(world: World) -> dict[str, str]:
    return _left(lambda: [path.name for path in world.temporary.iterdir()], "temporary folders")


def _left(look: Any, what: str) -> dict[str, str]:
    try:
        until(lambda: not look(), _TIDY_S)
    except AssertionError:
        return {LEFT: f"{what}: {look()}"}
    return {}
