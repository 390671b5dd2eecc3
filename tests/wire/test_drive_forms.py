"""Every form of one drive and of many, read back by the libraries that users have."""

from __future__ import annotations

import io
import json

import numpy as np
import pyarrow as pa
import pytest

from service.twin import Frame, Loaded
from service.twin.drives import DriveQuestion, Ground, Wanted, controls_of
from service.wire.batch_forms import BATCH_ENCODERS, BatchFormat
from service.wire.drives.answer import DriveAnswer
from service.wire.drives.ask import driven
from service.wire.drives.batch_answer import DriveBatchAnswer
from service.wire.drives.batch_subject import DriveBatchSubject
from service.wire.drives.subject import DriveSubject
from service.wire.forms import ENCODERS, Format
from service.wire.forms.plot import figure_of
from tests.api.readings import DATA_FORMS, about_in, columns_in, stage_of
from tests.digits import TEXT_FORMS, in_text
from tests.twin.drives.made import champion

QUESTION = DriveQuestion(
    430.0,
    Ground.of_slopes([0, 1.5, 2.5, 4], [10, 22, 34, 12]),
    controls_of([0, 4, 5], [70, 0, 90], [False, True, False]),
    horizon_s=12.0,
)
SHORT = DriveQuestion(500.0, Ground.constant(12), controls_of([0], [60]), until_distance_m=2.0)


def subject_of(frame: Frame, *, band: bool = False) -> DriveSubject:
    wanted = Wanted(dt_s=0.25, frame=frame, band=band, wheel_speed=True)
    return driven(QUESTION, wanted, False, Loaded(champion(), "champion"))


@pytest.mark.parametrize("form", DATA_FORMS)
@pytest.mark.parametrize("frame", Frame)
def test_every_data_form_has_every_column(form, frame):
    subject = subject_of(frame, band=frame is Frame.SLOPE)
    body = ENCODERS[Format(form)].encode(subject)
    expected, columns = subject.columns(), columns_in(form, body)
    expected = in_text(expected) if form in TEXT_FORMS else expected

    assert set(columns) == set(expected)
    for name, column in expected.items():
        np.testing.assert_array_equal(columns[name].astype(float), column.astype(float), err_msg=name)


def test_the_json_answer_is_what_its_model_says():
    for band in (True, False):
        document = json.loads(ENCODERS[Format.JSON].encode(subject_of(Frame.SLOPE, band=band)))
        answer = DriveAnswer.model_validate(document)
        assert answer.model_dump(exclude_unset=True, mode="json") == document
        assert document["trajectory"]["brake"][16:21] == [True, True, True, True, False]
        assert not document["domain"]["inside"]
        assert [each["event"] for each in document["events"]] == [each.event for each in answer.events]


@pytest.mark.parametrize("form", ["npz", "arrow", "parquet", "usda"])
def test_tables_carry_what_is_no_column(form):
    subject = subject_of(Frame.SLOPE, band=True)
    about = about_in(form, ENCODERS[Format(form)].encode(subject))
    answer = json.loads(ENCODERS[Format.JSON].encode(subject))

    for name in ("model", "drive", "frame", "events", "summary", "domain"):
        assert about[name] == answer[name]
    assert about["units"]["slope_deg"] == "deg"
    assert about["units"]["torque_nm"] == "N m"
    assert about["units"]["front_wheel_speed_rad_s"] == "rad/s"


def test_the_stage_pitches_the_rover_with_the_slope_under_it():
    subject = subject_of(Frame.SLOPE)
    stage = stage_of(ENCODERS[Format.USDA].encode(subject))
    orient = stage.GetDefaultPrim().GetAttribute("xformOp:orient")
    turns = [orient.Get(code) for code in orient.GetTimeSamples()]
    pitch = np.degrees([2.0 * np.arctan2(-turn.GetImaginary()[1], turn.GetReal()) for turn in turns])

    np.testing.assert_allclose(pitch, subject.drive.trajectory["slope_deg"], atol=1e-4)


@pytest.mark.parametrize("frame", Frame)
def test_the_stage_is_the_world_in_both_frames(frame):
    stage = stage_of(ENCODERS[Format.USDA].encode(subject_of(frame)))

    assert stage.GetRootLayer().customLayerData["roverTwin"]["frame"] == "world"


def test_a_picture_steps_from_torque_to_torque_and_shades_the_brake():
    subject = subject_of(Frame.SLOPE, band=True)
    _, *panels = figure_of(subject).axes  # the first one is the view from the side
    (torque,) = [line for line in panels[-1].lines if line.get_label() == "prediction"]

    assert torque.get_drawstyle() == "steps-post"
    assert panels[0].lines[0].get_drawstyle() == "default"
    for axes in panels:
        (shade,) = [each for each in axes.collections if each.get_label() == "brake"]
        assert all(shade.get_zorder() < each.get_zorder() for each in axes.collections if each is not shade)
        (path,) = shade.get_paths()
        assert (path.vertices[:, 0].min(), path.vertices[:, 0].max()) == (4.0, 5.0)
    free = DriveSubject(subject.loaded, driven(SHORT, Wanted(), False, subject.loaded).drive)
    assert not any(each.get_label() == "brake" for axes in figure_of(free).axes for each in axes.collections)


@pytest.mark.parametrize("form", ["svg", "png"])
def test_pictures_show_the_same_each_time(form):
    subject = subject_of(Frame.WORLD)

    assert ENCODERS[Format(form)].encode(subject) == ENCODERS[Format(form)].encode(subject)


@pytest.fixture(scope="module")
def batch() -> DriveBatchSubject:
    loaded = Loaded(champion(), None)
    found = [driven(each, Wanted(dt_s=0.5, band=True), False, loaded).drive for each in (QUESTION, SHORT)]
    failure = {"index": 1, "type": "urn:x", "title": "x", "status": 422, "detail": "x"}
    return DriveBatchSubject(loaded, Frame.SLOPE, found, np.array([0, 2]), [failure], 0.9)


def encoded(batch: DriveBatchSubject, form: BatchFormat) -> bytes:
    encode = BATCH_ENCODERS[form].encode
    assert encode is not None
    return encode(batch)


def test_a_batch_in_json_has_each_drive_alone(batch):
    document = json.loads(encoded(batch, BatchFormat.JSON))
    DriveBatchAnswer.model_validate(document)

    assert document["drives"]["index"] == [0, 2]
    for row in range(2):
        alone = json.loads(ENCODERS[Format.JSON].encode(batch.one(row)))
        for part in ("trajectory", "band"):
            for name, values in alone[part].items():
                assert name == "level" or document[part][name][row] == values, name
        assert document["events"][row] == alone["events"]
        assert document["stretches"][row] == alone["domain"]["stretches"]
        for name, value in alone["summary"].items():
            if name == "probabilities":
                for outcome, chance in value.items():
                    assert document["summary"][f"probability_{outcome}"][row] == chance
            else:
                assert document["summary"][name][row] == value


def test_a_batch_in_lines_has_each_drive_alone(batch):
    stream = BATCH_ENCODERS[BatchFormat.NDJSON].stream
    assert stream is not None
    lines = [json.loads(line) for line in b"".join(stream(batch)).splitlines()]

    assert [line["index"] for line in lines] == [0, 1, 2]
    for line, row in ((lines[0], 0), (lines[2], 1)):
        assert line == {"index": line["index"], **json.loads(ENCODERS[Format.JSON].encode(batch.one(row)))}


def test_a_batch_in_arrays_has_each_drive_alone(batch):
    with np.load(io.BytesIO(encoded(batch, BatchFormat.NPZ))) as archive:
        for row, drive in enumerate(batch.drives):
            points = archive["points"][row]
            for name, column in drive.trajectory.items():
                np.testing.assert_array_equal(archive[name][row][:points], column, err_msg=name)
        np.testing.assert_array_equal(archive["arrival_time_s_known"], [False, True])
        assert list(archive["outcome"]) == [str(each.summary.outcome) for each in batch.drives]
        assert len(json.loads(str(archive["metadata"]))["events"]) == 2


def test_a_batch_in_arrow_has_each_drive_alone(batch):
    with pa.ipc.open_stream(encoded(batch, BatchFormat.ARROW)) as stream:
        table = stream.read_all()
    index = table["drive"].to_numpy()

    for place, drive in zip(batch.indices, batch.drives, strict=True):
        for name, column in drive.trajectory.items():
            found = table[name].to_numpy()[index == place]
            np.testing.assert_array_equal(found, column, err_msg=name)
    assert json.loads(table.schema.metadata[b"summary"])["outcome"][1] == "passes"


@pytest.mark.parametrize("form", BATCH_ENCODERS)
def test_a_batch_of_failures_alone_can_be_written(batch, form):
    none = DriveBatchSubject(batch.loaded, Frame.SLOPE, [], np.empty(0, dtype=np.intp), batch.failures, 0.9)
    encoder = BATCH_ENCODERS[form]
    body = encoder.encode(none) if encoder.encode else b"".join(encoder.stream(none) if encoder.stream else ())

    assert body
