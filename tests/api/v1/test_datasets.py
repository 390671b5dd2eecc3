"""Datasets over HTTP: uploaded, validated, listed, looked at, taken back, deleted - and refused with reasons."""

from __future__ import annotations

import io
import json
import re
import zipfile
from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest

from model_store import Lineage, ManifestDraft
from service.datasets import read_parquet
from service.jobs.queue import JobQueue
from service.jobs.request import TrainingJobRequest
from service.settings import Settings
from tests.api.chrono_uploads import PASSPORT, archive, run_text
from tests.api.conftest import TOKEN, move_alias, publish_version
from tests.training.stored import put_dataset, stored_runs

DATASETS = "/v1/admin/datasets"


@pytest.fixture(scope="module")
def admin(service_with_token):
    return service_with_token


def upload(admin, data, *, query=None, **form):
    return admin.client.post(DATASETS, params=query, files={"file": ("my runs.zip", data)}, data=form)


def upload_raw(admin, data, **query):
    return admin.client.post(DATASETS, params=query, content=data)


@pytest.fixture(scope="module")
def stored(admin, processes):
    """One dataset that is there: the answer to its upload."""
    answer = upload(admin, archive(), name="stored", description="made by a test")
    assert answer.status_code == 201, answer.text
    return answer.json()


@pytest.mark.processes
def test_an_upload_is_stored_under_the_digest_of_its_content_and_says_what_it_took(admin):
    answer = upload(admin, archive(seed=0.01, broken={1}), name="slopes")

    assert answer.status_code == 201, answer.text
    taken = answer.json()
    assert re.fullmatch("[0-9a-f]{64}", taken["id"])
    assert (taken["created"], taken["stored"], taken["dry_run"], taken["name"]) == (True, True, False, "slopes")
    assert answer.headers["location"] == taken["links"]["self"] == f"{DATASETS}/{taken['id']}"
    assert len(taken["report"]["accepted"]) == 2
    assert len(taken["report"]["rejected"]) == 1
    rejection = taken["report"]["findings"][0]
    assert (rejection["severity"], rejection["code"]) == ("reject", "not-a-number")
    assert (rejection["row"], rejection["column"]) == (7, "time_s")
    assert rejection["file"].endswith("run1.csv")
    assert taken["report"]["summary"]["slope_deg"] == {"lowest": 20, "highest": 22}


@pytest.mark.processes
def test_the_same_content_is_the_same_dataset_however_it_came(admin, stored):
    as_form = upload(admin, archive(), name="another-name")
    as_body = upload_raw(admin, archive(), name="the-third-name", filename="x.zip")

    known = ["stored"]
    for answer, name in ((as_form, "another-name"), (as_body, "the-third-name")):
        assert answer.status_code == 200
        assert "location" not in answer.headers
        again = answer.json()
        assert (again["id"], again["created"], again["stored"]) == (stored["id"], False, True)
        assert (again["name"], again["already_known_as"]) == (name, known)
        known.append(name)
        assert admin.get(f"{DATASETS}/{name}").json()["id"] == stored["id"]
    assert admin.get(stored["links"]["self"]).json()["names"] == known


@pytest.mark.processes
def test_of_the_same_upload_many_times_at_once_one_creates_it(admin):
    data = archive(seed=0.02)

    with ThreadPoolExecutor(2) as pool:
        answers = list(pool.map(lambda _: upload(admin, data), range(2)))

    assert sorted(answer.status_code for answer in answers) == [200, 201]
    assert len({answer.json()["id"] for answer in answers}) == 1


@pytest.mark.processes
@pytest.mark.parametrize("send", [upload, upload_raw])
def test_a_dry_run_says_the_same_and_stores_nothing(admin, send):
    data = archive(seed=0.03)
    before = admin.store.dataset_ids()
    dry = send(admin, data, **({"query": {"dry_run": "true"}} if send is upload else {"dry_run": "true"}))
    after = admin.store.dataset_ids()

    assert (dry.status_code, dry.json()["dry_run"], dry.json()["stored"], dry.json()["created"]) == (
        200,
        True,
        False,
        False,
    )
    assert before == after
    wet = send(admin, archive(seed=0.03))
    assert wet.json()["id"] == dry.json()["id"]
    assert wet.json()["report"] == dry.json()["report"]
    admin.client.delete(wet.json()["links"]["self"])


@pytest.mark.processes
def test_one_plain_file_gets_its_scenario_from_the_form(admin):
    answer = upload(
        admin,
        run_text(0.77),
        name="single",
        slope_deg="12.5",
        mass_kg="300",
        torque_nm="45",
        passport=json.dumps(PASSPORT),
    )

    assert answer.status_code == 201, answer.text
    one = admin.get(answer.json()["links"]["self"]).json()
    assert one["summary"]["slope_deg"] == {"lowest": 12.5, "highest": 12.5}
    assert one["summary"]["runs"] == 1
    assert one["passport"]["title"] == "synthetic"


@pytest.mark.processes
def test_a_passport_may_be_a_part_with_a_file(admin):
    files = {"file": ("run.csv", run_text(0.78)), "passport": ("passport.json", json.dumps(PASSPORT))}

    answer = admin.client.post(DATASETS, files=files, data={"slope_deg": "9", "mass_kg": "300", "torque_nm": "45"})

    assert answer.status_code == 201, answer.text
    assert admin.get(answer.json()["links"]["self"]).json()["passport"]["title"] == "synthetic"


@pytest.mark.processes
def test_what_nothing_of_can_be_used_is_refused_with_every_reason(admin):
    before = admin.store.dataset_ids()

    answer = upload(admin, archive(broken={0, 1, 2}))

    assert answer.status_code == 422
    problem = answer.json()
    assert problem["type"] == "urn:rover-twin:problem:dataset-rejected"
    assert problem["report"]["accepted"] == []
    assert len(problem["report"]["rejected"]) == 3
    assert {each["code"] for each in problem["report"]["findings"]} >= {"not-a-number"}
    assert all(each["field"] == "file" and "line 7" in each["message"] for each in problem["errors"][:3])
    assert admin.store.dataset_ids() == before


@pytest.mark.processes
def test_strict_refuses_everything_for_one_bad_run(admin):
    answer = upload(admin, archive(seed=0.04, broken={1}), strict="true")

    assert answer.status_code == 422
    assert answer.json()["report"]["findings"][0]["code"] == "not-a-number"


@pytest.mark.parametrize(
    ("form", "field"),
    [
        ({"name": "no spaces please"}, "name"),
        ({"name": "../etc"}, "name"),
        ({"slope_deg": "steep"}, "slope_deg"),
        ({"slope_deg": "nan"}, "slope_deg"),
        ({"mass_kg": "-1"}, "mass_kg"),
        ({"strict": "perhaps"}, "strict"),
        ({"dry_run": "perhaps"}, "dry_run"),
        ({"passport": "not json"}, "passport"),
        ({"passport": "[1]"}, "passport"),
        ({"passport": '{"gravity_m_s2": NaN}'}, "passport"),
        ({"column_map": "{"}, "column_map"),
        pytest.param({"column_map": "no-such-preset"}, "column_map", marks=pytest.mark.processes),
        ({"colour": "red"}, "colour"),
    ],
)
def test_fields_that_are_wrong_are_named_in_a_form_and_in_a_query(admin, form, field):
    for answer in (upload(admin, archive(seed=0.05), **form), upload_raw(admin, archive(seed=0.05), **form)):
        assert answer.status_code == 422, answer.text
        assert answer.json()["type"] == "urn:rover-twin:problem:invalid-input"
        assert answer.json()["errors"][0]["field"] == field


def test_a_field_twice_is_refused(admin):
    in_query = admin.client.post(f"{DATASETS}?name=a&name=b", content=archive())
    in_both = upload(admin, archive(), query={"name": "a"}, name="b")

    assert (in_query.status_code, in_both.status_code) == (422, 422)
    assert "one value only" in in_both.json()["detail"]


def multipart(*parts, end=True, boundary="cut"):
    body = b"".join(b"--cut\r\n" + head + b"\r\n\r\n" + data + b"\r\n" for head, data in parts)
    return body + (b"--cut--\r\n" if end else b"")


FILE = b'Content-Disposition: form-data; name="file"; filename="x.csv"'
MALFORMED = {
    "no boundary": ("multipart/form-data", multipart((FILE, b"x")), 400),
    "boundary too long": (f"multipart/form-data; boundary={'x' * 1000}", multipart((FILE, b"x")), 400),
    "another boundary": ("multipart/form-data; boundary=other", multipart((FILE, b"x")), 400),
    "no end": ("multipart/form-data; boundary=cut", multipart((FILE, b"x"), end=False), 400),
    "cut in a header": ("multipart/form-data; boundary=cut", multipart((FILE, b"x"))[:30], 400),
    "empty": ("multipart/form-data; boundary=cut", b"", 400),
    "no name": ("multipart/form-data; boundary=cut", multipart((b"Content-Disposition: form-data", b"x")), 400),
    "no disposition": ("multipart/form-data; boundary=cut", multipart((b"Content-Type: text/csv", b"x")), 400),
    "huge header": ("multipart/form-data; boundary=cut", multipart((FILE + b"x" * 100_000, b"x")), 400),
    "many headers": ("multipart/form-data; boundary=cut", multipart((FILE + b"\r\nA: b" * 1000, b"x")), 400),
    "many fields": (
        "multipart/form-data; boundary=cut",
        multipart(*((b'Content-Disposition: form-data; name="f%d"' % n, b"x") for n in range(30))),
        400,
    ),
    "no file": (
        "multipart/form-data; boundary=cut",
        multipart((b'Content-Disposition: form-data; name="name"', b"x")),
        422,
    ),
    "two files": ("multipart/form-data; boundary=cut", multipart((FILE, b"x"), (FILE, b"y")), 422),
    "no text": (
        "multipart/form-data; boundary=cut",
        multipart((FILE, b"x"), (b'Content-Disposition: form-data; name="name"', b"\xff\xfe")),
        422,
    ),
    "huge field": (
        "multipart/form-data; boundary=cut",
        multipart((FILE, b"x"), (b'Content-Disposition: form-data; name="name"', b"x" * 1_100_000)),
        422,
    ),
    "empty file": ("multipart/form-data; boundary=cut", multipart((FILE, b"")), 422),
    "nothing at all": ("application/octet-stream", b"", 422),
}
READ = ("empty file", "nothing at all")  # as uploads, in a process


@pytest.mark.parametrize(
    ("kind", "body", "status"),
    [
        pytest.param(*case, id=name, marks=[pytest.mark.processes] if name in READ else [])
        for name, case in MALFORMED.items()
    ],
)
def test_bodies_that_are_no_upload(admin, kind, body, status):
    before = admin.store.dataset_ids()

    answer = admin.client.post(DATASETS, content=body, headers={"Content-Type": kind})

    assert answer.status_code == status, answer.text
    assert answer.json()["type"].startswith("urn:rover-twin:problem:")
    assert admin.store.dataset_ids() == before


@pytest.mark.processes
def test_a_file_name_is_shown_and_never_becomes_a_path(admin):
    head = b'Content-Disposition: form-data; name="file"; filename="../../etc/\xc3\xa4passwd"'
    body = multipart((head, run_text(0.79)), *((f'Content-Disposition: form-data; name="{name}"'.encode(), value)
        for name, value in (("slope_deg", b"5"), ("mass_kg", b"300"), ("torque_nm", b"45"))))  # fmt: skip

    answer = admin.client.post(DATASETS, content=body, headers={"Content-Type": "multipart/form-data; boundary=cut"})

    assert answer.status_code == 201, answer.text
    assert "etc/" not in answer.text


def test_the_list_has_pages(admin, stored):
    ids, address = [], f"{DATASETS}?limit=2"
    while address:
        page = admin.client.get(address).json()
        assert len(page["datasets"]) <= 2
        ids += [each["id"] for each in page["datasets"]]
        address = page["next"]

    assert ids == admin.store.dataset_ids()
    whole = {each["id"]: each for each in admin.get(DATASETS).json()["datasets"]}
    assert whole[stored["id"]]["name"] == "stored"
    assert whole[stored["id"]]["summary"]["runs"] == 3
    assert whole[stored["id"]]["unreadable"] is None


@pytest.mark.parametrize(
    "query", [{"limit": 0}, {"limit": 201}, {"limit": "+3"}, {"after": "x"}, {"before": "x"}, {"limit": ["1", "2"]}]
)
def test_a_page_that_there_is_none_of(admin, query):
    assert admin.get(DATASETS, **query).status_code == 422


def test_one_dataset_says_everything_about_itself(admin, stored):
    by_id = admin.get(f"{DATASETS}/{stored['id']}")
    found = by_id.json()

    assert by_id.status_code == 200
    assert found == admin.get(f"{DATASETS}/{stored['id'][:12]}").json() == admin.get(f"{DATASETS}/stored").json()
    assert (found["name"], found["description"], found["created_by"]) == ("stored", "made by a test", "admin")
    assert found["passport"]["soil"]["bekker_n"] == 1.0
    assert found["summary"]["torque_nm"] == {"lowest": 60, "highest": 60}
    assert found["used_by"] == {"versions": [], "jobs": []}
    assert found["files"]["runs.parquet"]["size_bytes"] > 0


@pytest.mark.parametrize("path", ["", "/preview", "/download"])
@pytest.mark.parametrize("reference", ["0" * 64, "no-such", "%2e%2e", "A" * 300])
def test_a_dataset_that_is_not_there(admin, path, reference):
    answer = admin.get(f"{DATASETS}/{reference}{path}")

    assert answer.status_code == 404
    assert answer.json()["type"].endswith(("dataset-not-found", "not-found"))


@pytest.mark.processes
def test_a_name_of_another_dataset_is_refused_until_it_is_taken_from_that_one(admin):
    data, other = (archive(runs=1, seed=seed) for seed in (0.06, 0.07))
    first = upload(admin, data, name="born").json()["id"]
    upload(admin, data, name="twin")

    for name in ("born", "twin", first[:8]):
        for dry_run in ("true", "false"):
            refused = upload(admin, other, name=name, query={"dry_run": dry_run})
            assert refused.status_code == 409
            assert refused.json()["type"].endswith("dataset-name-taken")
            assert first in refused.json()["detail"]
    assert admin.get(f"{DATASETS}/twin").json()["id"] == admin.get(f"{DATASETS}/born").json()["id"] == first

    names = f"{DATASETS}/{first}/names"
    assert admin.client.delete(f"{names}/twin").status_code == 204
    assert admin.client.delete(f"{names}/twin").status_code == 404
    assert admin.client.delete(f"{names}/born").status_code == 409
    assert admin.client.delete(f"{DATASETS}/born/names/born").status_code == 422
    assert upload(admin, other, name="twin").status_code == 201
    assert admin.get(f"{DATASETS}/twin").json()["id"] != first


@pytest.mark.processes
def test_a_name_made_of_a_files_name_is_told_apart_from_that_of_another_dataset(admin):
    first, second = (upload_raw(admin, archive(runs=1, seed=seed), filename="same.zip") for seed in (0.08, 0.09))

    assert (first.status_code, second.status_code) == (201, 201)
    for answer in (first.json(), second.json()):
        assert admin.get(f"{DATASETS}/{answer['name']}").json()["id"] == answer["id"]
    assert second.json()["name"] == f"{first.json()['name']}-{second.json()['id'][:12]}"


@pytest.mark.parametrize(("form", "start"), [("svg", b"<?xml"), ("png", b"\x89PNG")])
def test_the_preview_is_a_figure(admin, stored, form, start):
    answer = admin.get(stored["links"]["preview"], format=form)

    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"].startswith(f"image/{form}")
    assert answer.content.startswith(start)
    assert len(answer.content) > 5000
    assert admin.get(stored["links"]["preview"], format="gif").status_code == 422


def test_the_download_is_what_is_stored_and_comes_back_as_the_same_dataset(admin, stored):
    answer = admin.get(stored["links"]["download"])

    assert answer.status_code == 200
    assert answer.content == admin.store.read_dataset_file(stored["id"], "runs.parquet")
    assert int(answer.headers["content-length"]) == len(answer.content)
    assert answer.headers["content-disposition"] == 'attachment; filename="stored.parquet"'
    assert len(read_parquet(answer.content).runs) == 3
    again = upload_raw(admin, answer.content)
    assert (again.status_code, again.json()["id"]) == (200, stored["id"])


@pytest.mark.processes
def test_a_dataset_that_nobody_names_can_be_deleted_and_uploaded_again(admin):
    taken = upload(admin, archive(seed=0.08)).json()
    own = taken["links"]["self"]

    assert admin.client.delete(f"{DATASETS}/{taken['id'][:12]}").status_code == 422
    deleted = admin.client.delete(own)
    assert (deleted.status_code, deleted.content) == (204, b"")
    assert admin.get(own).status_code == 404
    assert admin.client.delete(own).status_code == 404
    assert taken["id"] not in admin.store.dataset_ids()
    assert upload(admin, archive(seed=0.08)).status_code == 201


@pytest.mark.processes
def test_a_dataset_that_a_version_was_trained_on_stays(admin):
    taken = upload(admin, archive(seed=0.09)).json()
    version = publish_version(admin.store, "trained-on-it")
    manifest = admin.store.manifest("trained-on-it", version)
    files = {"weights.safetensors": admin.store.read_file(manifest, "weights.safetensors")}
    said = {name: getattr(manifest, name) for name in ManifestDraft.model_fields}
    admin.store.publish("trained-on-it", files, ManifestDraft(**said | {"lineage": Lineage(datasets=[taken["id"]])}))

    refused = admin.client.delete(taken["links"]["self"])

    assert refused.status_code == 409
    assert refused.json()["type"] == "urn:rover-twin:problem:dataset-in-use"
    assert refused.json()["used_by"] == {"versions": ["trained-on-it@2"], "jobs": []}
    assert admin.get(taken["links"]["self"]).json()["used_by"]["versions"] == ["trained-on-it@2"]
    assert taken["id"] in admin.store.dataset_ids()


@pytest.mark.processes
def test_a_dataset_that_a_job_waits_for_stays_until_the_job_has_ended(admin):
    taken = upload(admin, archive(seed=0.13)).json()
    queue = JobQueue.open(Settings(store_url=str(admin.folder)).jobs_url(), 16)
    job, _ = queue.submit(TrainingJobRequest(model="viper-lunar", datasets=(taken["id"],)), actor="tests")

    refused = admin.client.delete(taken["links"]["self"])

    assert refused.status_code == 409, refused.text
    assert refused.json()["used_by"] == {"versions": [], "jobs": [job.id]}
    assert admin.get(taken["links"]["self"]).json()["used_by"]["jobs"] == [job.id]
    queue.cancel(job.id)
    queue.close()
    assert admin.client.delete(taken["links"]["self"]).status_code == 204


@pytest.mark.processes
def test_without_the_jobs_database_nothing_is_changed(serve, store, tmp_path):
    """It has the audit log: what cannot be put on record is not done. What is there can be looked at."""
    there = put_dataset(store, "unit", stored_runs())
    database = tmp_path / "no-folder" / "jobs.sqlite"
    database.parent.write_text("a file where a folder belongs")
    service = serve(admin_token=TOKEN, start_worker=False, jobs_database_url=f"sqlite:///{database}")
    service.client.headers["Authorization"] = f"Bearer {TOKEN}"

    assert service.get(f"{DATASETS}/{there}").json()["used_by"]["jobs"] is None
    for answer in (upload(service, archive()), service.client.delete(f"{DATASETS}/{there}")):
        assert answer.status_code == 503, answer.text
        assert answer.json()["type"] == "urn:rover-twin:problem:audit-unavailable"
    assert service.store.dataset_ids() == [there]


@pytest.mark.processes
def test_what_is_damaged_in_the_store_is_told_and_never_arrives_whole(serve, store, tmp_path):
    service = serve(admin_token=TOKEN, start_worker=False)
    service.client.headers["Authorization"] = f"Bearer {TOKEN}"
    first, second = (upload(service, archive(seed=seed)).json() for seed in (0.1, 0.11))
    runs = tmp_path / "store/datasets" / first["id"] / "runs.parquet"
    data = runs.read_bytes()
    runs.write_bytes(data[:-20] + b"x" * 20)
    (tmp_path / "store/datasets" / second["id"] / "dataset.json").write_text("{")

    listed = {each["id"]: each for each in service.get(DATASETS).json()["datasets"]}
    assert listed[second["id"]]["unreadable"]
    assert listed[first["id"]]["unreadable"] is None
    assert service.get(second["links"]["self"]).status_code == 503
    assert service.get(first["links"]["preview"]).status_code == 503
    with pytest.raises(httpx.RemoteProtocolError):
        service.get(first["links"]["download"])
    runs.unlink()
    assert service.get(first["links"]["download"]).status_code == 503
    assert service.client.delete(second["links"]["self"]).status_code == 204


@pytest.mark.processes
def test_predictions_go_on_while_an_upload_is_read(admin):
    move_alias(admin.store, publish_version(admin.store))
    admin.wait_ready()

    with ThreadPoolExecutor(1) as pool:
        running = pool.submit(upload, admin, archive(runs=40, seed=0.12))
        answers = []
        while not running.done():
            answers.append(admin.predict().status_code)

    assert running.result().status_code == 201
    assert len(answers) > 5
    assert set(answers) == {200}


@pytest.mark.processes
def test_an_archive_that_holds_an_archive_is_refused(admin):
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as out:
        out.writestr("inner.zip", archive())

    assert upload(admin, packed.getvalue()).status_code == 422
