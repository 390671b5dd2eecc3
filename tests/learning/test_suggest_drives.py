"""Suggested drives: inside the domain, unlike each other, where the outcome is open; a real, shipped model is asked."""

from __future__ import annotations

import numpy as np
import pytest

import model_store
from model_store import ModelStore
from service.errors import InvalidValueError
from service.learning.doubt.outcomes import entropy
from service.learning.drive.model import DriveModel
from service.learning.suggest_drives import Change, SuggestedDrive, meeting_of, suggest_drives
from service.twin import Twin
from service.twin.load import load_twin


@pytest.fixture(scope="module")
def twin() -> Twin:
    store = ModelStore.open(next(iter(model_store.__path__)))
    return load_twin(store, "viper-lunar", store.alias("viper-lunar", "champion").version)


@pytest.mark.slow
def test_drives_are_inside_the_domain_and_their_outcomes_are_open(twin):
    assert isinstance(twin.model, DriveModel)
    spans = twin.domain.spans
    few, more = (suggest_drives(twin.model, twin.doubt, spans, count) for count in (3, 8))

    assert more[:3] == few
    assert len({(each.mass_kg, each.slope_deg, each.torque_nm) for each in more}) == 8
    for each in more:
        assert spans["mass_kg"][0] <= each.mass_kg <= spans["mass_kg"][1]
        for field, pair in (("slope_deg", each.slope_deg), ("torque_nm", each.torque_nm)):
            assert all(spans[field][0] - 0.05 <= value <= spans[field][1] + 0.05 for value in pair)
        assert sum(each.chances) == pytest.approx(1.0)
        motors_outweigh(twin, each)
    assert np.mean([entropy(np.array(each.chances)) for each in more]) > 0.3


def motors_outweigh(twin: Twin, drive: SuggestedDrive) -> None:
    """On the slopes and with the torques that it drives with."""
    rover, gravity = twin.model.prior.rover, twin.model.prior.regolith.gravity_m_s2
    slopes = drive.slope_deg if drive.change is Change.SLOPE else drive.slope_deg[:1]
    torques = drive.torque_nm[:1] if drive.change is Change.SLOPE else drive.torque_nm
    pull = drive.mass_kg * gravity * max(abs(np.sin(np.radians(slope))) for slope in slopes)
    assert rover.wheels * min(torques) / rover.wheel_radius_m > pull


def test_what_is_met_on_the_way_is_what_was_suggested(twin):
    for each in suggest_drives(twin.model, twin.doubt, twin.domain.spans, 6):
        meeting, positions = meeting_of(twin.model, each)
        assert np.degrees(meeting.slope_rad[0]) == pytest.approx(each.slope_deg[0])
        assert meeting.torque_nm[0] == each.torque_nm[0]
        assert meeting.brake.any() == (each.change is Change.STOP)
        assert positions.x_m.shape == (1, len(meeting.time_s))


@pytest.mark.parametrize("count", [0, 65])
def test_other_counts_are_refused(twin, count):
    with pytest.raises(InvalidValueError, match="n is"):
        suggest_drives(twin.model, twin.doubt, twin.domain.spans, count)
