"""Importing in a process of its own: the same answers as here, and what goes wrong there stays there."""

from __future__ import annotations

import anyio
import psutil
import pytest

from model_store import InvalidReferenceError, ModelStore
from service.datasets import RejectedDatasetError
from service.datasets.uploads.upload_form import UploadForm, UploadLimits
from service.errors import DatasetError, InvalidValueError
from service.jobs import import_process
from service.jobs.import_process import ImportLimits, import_in_process
from service.training import dataset_import
from service.training.dataset_import import RUNS_FILE, import_upload
from tests.datasets.conftest import chrono_text, motion
from tests.datasets.hostile_files import SCENARIO, honest, zipped


@pytest.fixture
def store(tmp_path):
    ModelStore.open(tmp_path / "store", create=True)
    return tmp_path / "store"


@pytest.fixture(scope="module")
def slow():
    """Takes more than a second to unpack."""
    return zipped(honest({"zeros.csv": bytes(600 << 20)}))


def send(store, data, *, limits=None, dry_run=False, filename="runs.zip", cancel_when=None, **form):
    path, workspace = store.parent / "sent", store.parent / "workspace"
    path.write_bytes(data)
    workspace.mkdir(exist_ok=True)

    async def imported():
        return await import_in_process(
            str(store),
            path,
            filename=filename,
            form=UploadForm(**form),
            created_by="tests",
            dry_run=dry_run,
            workspace=workspace,
            limits=limits,
        )

    async def cancelled():
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(imported)
            while not cancel_when():
                await anyio.sleep(0.02)
            tasks.cancel_scope.cancel()

    try:
        return anyio.run(imported if cancel_when is None else cancelled)
    finally:
        assert list(workspace.iterdir()) == []


@pytest.mark.processes
def test_the_same_content_is_created_once_whatever_its_name_and_shape(store):
    path = store.parent / "first.zip"
    path.write_bytes(zipped(honest()))
    opened = ModelStore.open(store)
    dry = send(store, zipped(honest()), dry_run=True)
    assert (dry.created, dry.record, opened.dataset_ids()) == (False, None, [])
    first = send(store, zipped(honest()), name="first", description="a set")
    assert first.created
    assert first.dataset_id == dry.dataset_id
    again = import_upload(opened, path, filename="x", form=UploadForm(name="second"), created_by="me")
    assert (again.dataset_id, again.created, again.record.name) == (first.dataset_id, False, "first")
    assert (first.already_known_as, again.already_known_as, again.name) == ((), ("first",), "second")
    assert opened.dataset("second") == opened.dataset("first") == first.record
    unnamed = import_upload(opened, path, filename="third.zip", form=UploadForm(), created_by="me")
    assert (unnamed.already_known_as, unnamed.name) == (("first", "second"), "first")
    assert again.report == first.report
    assert first.record == opened.dataset(first.dataset_id)
    assert (first.record.description, first.record.created_by) == ("a set", "tests")


@pytest.mark.processes
def test_two_at_once_under_two_names_are_one_dataset(store):
    (store.parent / "sent").write_bytes(zipped(honest()))
    results = []

    async def one(name):
        form = UploadForm(name=name)
        results.append(
            await import_in_process(str(store), store.parent / "sent", filename="x", form=form, created_by=name)
        )

    async def both():
        async with anyio.create_task_group() as group:
            for name in ("one", "two"):
                group.start_soon(one, name)

    anyio.run(both)
    assert [result.created for result in results].count(True) == 1
    assert results[0].record == results[1].record


def test_an_upload_that_was_killed_half_way_is_taken_up_under_another_name(store):
    path = store.parent / "sent"
    path.write_bytes(zipped(honest()))
    opened = ModelStore.open(store)
    first = import_upload(opened, path, filename="x", form=UploadForm(name="first"), created_by="me")
    (store / "datasets" / first.dataset_id / "dataset.json").unlink()
    (store / "datasets" / first.dataset_id / "passport.json").unlink()
    again = import_upload(opened, path, filename="y", form=UploadForm(name="second"), created_by="me")
    assert (again.created, again.record.name) == (True, "second")
    assert opened.read_dataset_file(again.dataset_id, RUNS_FILE)


@pytest.mark.processes
def test_rejections_come_back_whole(store):
    bad = chrono_text(motion() | {"rear_x_m": motion()["rear_x_m"] + 3.0})
    with pytest.raises(RejectedDatasetError, match="no run is usable") as caught:
        send(store, bad, filename="run.csv", **SCENARIO)
    finding = caught.value.report.rejections[0]
    assert (finding.code, finding.file, finding.row, finding.column) == ("start-position", "run.csv", 3, "rear_x_m")
    assert ModelStore.open(store).dataset_ids() == []


@pytest.mark.processes
def test_a_map_that_is_not_allowed_comes_back_as_what_it_is(store):
    with pytest.raises(InvalidValueError) as caught:
        send(store, zipped(honest()), column_map="x")
    assert (caught.value.field, caught.value.value) == ("column_map", "x")


@pytest.mark.processes
@pytest.mark.parametrize(
    ("limits", "says"),
    [
        (ImportLimits(memory_bytes=1 << 20), "bytes of memory"),
        (ImportLimits(cpu_s=1, upload=UploadLimits(ratio=1e6)), "processor time"),
        (ImportLimits(wall_s=1, upload=UploadLimits(ratio=1e6)), "longer than 1 s"),
    ],
    ids=["memory", "processor", "wall"],
)
def test_bounds_end_the_process_and_not_this_one(limits, says, store, slow):
    data = zipped(honest()) if "memory" in says else slow
    with pytest.raises(DatasetError, match=says):
        send(store, data, limits=limits)
    assert ModelStore.open(store).dataset_ids() == []


@pytest.mark.processes
def test_a_process_that_dies_is_an_error_of_the_upload(store, monkeypatch):
    monkeypatch.setattr(import_process, "_MAIN", "os:abort")
    with pytest.raises(DatasetError, match=r"ended its process \(signal 6\)"):
        send(store, zipped(honest()))


@pytest.mark.processes
def test_cancelling_kills_the_process(store, monkeypatch):
    monkeypatch.setattr(import_process, "_MAIN", "signal:pause")  # for ever
    before, new = set(psutil.Process().children()), set()

    def there() -> bool:
        new.update(set(psutil.Process().children()) - before)
        return bool(new)

    assert send(store, zipped(honest()), cancel_when=there) is None
    assert not any(each.is_running() for each in new)


def test_what_cannot_be_read_back_is_not_stored(store, monkeypatch):
    monkeypatch.setattr(
        dataset_import, "read_parquet", lambda data: dataset_import.read_folder(store.parent / "other")[0]
    )
    (store.parent / "other").mkdir()
    for name, data in honest(table="file,slope_deg,mass_kg,torque_nm\nrun.csv,21,430,60\n").items():
        (store.parent / "other" / name).write_bytes(data)
    (store.parent / "sent").write_bytes(zipped(honest()))
    opened = ModelStore.open(store)
    with pytest.raises(DatasetError, match="do not read back the same"):
        import_upload(opened, store.parent / "sent", filename="x", form=UploadForm(), created_by="me")
    assert opened.dataset_ids() == []


def test_errors_of_the_store_keep_their_kind():
    answer = import_process._Answer(error="store", name="InvalidReferenceError", message="no")
    assert isinstance(import_process._store_error(answer), InvalidReferenceError)
