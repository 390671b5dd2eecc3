"""The shipped champion, and drives to ask it for."""

from __future__ import annotations

from functools import cache

from hypothesis import strategies as st

from model_store import ModelStore
from service.settings import Settings
from service.twin import Twin
from service.twin.drives import DriveQuestion, Ground, controls_of
from service.twin.load import load_twin


@cache
def champion() -> Twin:
    """The twin that ships."""
    store = ModelStore.open(Settings().store_url)
    return load_twin(store, "viper-lunar", store.alias("viper-lunar", "champion").version)


@st.composite
def grounds(draw: st.DrawFn, steepest_deg: float = 32.0) -> Ground:
    """Tracks of one to a dozen knots, some behind the start."""
    count = draw(st.integers(1, 12))
    gaps = draw(st.lists(st.floats(0.05, 5.0), min_size=count, max_size=count))
    distances = [draw(st.floats(-5.0, 3.0))]
    for gap in gaps[1:]:
        distances.append(distances[-1] + gap)
    slopes = draw(st.lists(st.floats(-steepest_deg, steepest_deg), min_size=count, max_size=count))
    return Ground.of_slopes(distances, slopes)


@st.composite
def questions(draw: st.DrawFn) -> DriveQuestion:
    """Drives of up to 30 s, with brakes, free wheels and start speeds."""
    count = draw(st.integers(1, 6))
    gaps = draw(st.lists(st.floats(0.05, 8.0), min_size=count, max_size=count))
    times = [0.0]
    for gap in gaps[1:]:
        times.append(times[-1] + gap)
    torques = draw(st.lists(st.one_of(st.just(0.0), st.floats(5.0, 150.0)), min_size=count, max_size=count))
    brakes = draw(st.lists(st.sampled_from([False, False, False, True]), min_size=count, max_size=count))
    return DriveQuestion(
        mass_kg=draw(st.floats(250.0, 950.0)),
        ground=draw(grounds()),
        controls=controls_of(times, torques, brakes),
        start_speed_m_s=draw(st.one_of(st.none(), st.floats(-1.0, 1.0))),
        horizon_s=draw(st.floats(0.2, 30.0)),
        until_distance_m=draw(st.one_of(st.none(), st.none(), st.floats(0.1, 12.0))),
    )
