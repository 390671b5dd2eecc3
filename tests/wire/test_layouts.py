"""What pictures draw has room: nothing is cut off at the edge, no text stands on another one or on a line."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pytest
from matplotlib.contour import QuadContourSet
from matplotlib.text import Text

from model_store import ModelStore
from service.settings import Settings
from service.twin import Loaded
from service.twin.drives import DriveQuestion, Ground, Wanted, controls_of
from service.twin.load import load_twin
from service.twin.mobility import mobility_map
from service.wire.drives.ask import driven
from service.wire.forms.plot import figure_of
from service.wire.mobility_picture import figure_of_map
from service.wire.versions.comparison import ComparisonInputs, Two, compared
from service.wire.versions.comparison_picture import figure_of_comparison
from tests.twin.drives.made import champion

TRACKS = {
    "of the heights": Ground.of_elevations([0, 4, 8], [0, 0.7, 2]),
    "ever steeper": Ground.of_slopes([0, 4, 8], [10, 28, 36]),
    "downhill": Ground.of_slopes([0, 4, 8], [-25, -28, -10]),
    "a ramp": Ground.constant(20),
}


@pytest.mark.parametrize("ground", TRACKS.values(), ids=TRACKS)
@pytest.mark.parametrize("horizon_s", [2.0, 20.0])
def test_the_rover_at_the_end_of_its_drive_is_within_the_axes(ground, horizon_s):
    question = DriveQuestion(430.0, ground, controls_of([0], [70]), horizon_s=horizon_s)
    view = figure_of(driven(question, Wanted(), False, Loaded(champion(), None))).axes[0]
    (left, right), (low, high) = view.get_xlim(), view.get_ylim()

    assert len(view.patches) == 3  # body and wheels
    parts = [each.get_path().get_extents(each.get_patch_transform()).get_points() for each in view.patches]
    drawn = np.concatenate([*parts, *(line.get_xydata() for line in view.lines)])
    assert left < drawn[:, 0].min() < drawn[:, 0].max() < right
    assert low < drawn[:, 1].min() < drawn[:, 1].max() < high


@pytest.mark.slow
@pytest.mark.parametrize(
    ("torques", "slopes", "mass_kg", "named"),
    [
        ((30, 120, 10), (0, 35, 36), 430, 8),
        ((30, 120, 40), (-20, 40, 40), 430, 8),
        ((10, 200, 20), (-45, 45, 40), 300, 7),
        ((60, 61, 2), (25, 26, 2), 430, 0),
    ],
)
def test_names_of_contours_stand_free(torques, slopes, mass_kg, named):
    found = mobility_map(champion(), mass_kg, np.linspace(*torques), np.linspace(*slopes), 10, 0.9)
    figure = figure_of_map(Loaded(champion(), None), found)
    (axes,) = figure.axes
    names = [name for each in axes.collections if isinstance(each, QuadContourSet) for name in each.labelTexts]
    lines = [axes.transData.transform(line.get_xydata()) for line in axes.lines]
    (steepest, *_) = sorted(lines, key=len, reverse=True)
    path = [a + (b - a) * part for a, b in pairwise(steepest) for part in np.linspace(0, 1, 40)]

    assert len(names) >= named
    assert "-" not in "".join(name.get_text() for name in names)
    for one, other in combinations([*names, *axes.texts], 2):
        if one is not other:
            assert not within(grid(one), other).any(), (one, other)
    for name in names:
        assert not within(np.array(path), name).any(), name


@pytest.mark.slow
def test_the_footnote_of_a_comparison_stands_free():
    store = ModelStore.open(Settings().store_url)
    first = load_twin(store, "viper-lunar", 1)
    two = Two(champion().manifest, first.manifest, (champion(), first))
    figure = figure_of_comparison(compared(store, two, ComparisonInputs.model_validate({})))
    (note,) = [text for text in figure.findobj(Text) if text.get_text().startswith("* outside")]
    box, whole = note.get_window_extent(), figure.bbox

    assert whole.x0 <= box.x0 < box.x1 <= whole.x1
    assert whole.y0 <= box.y0 < box.y1 <= whole.y1
    for text in figure.findobj(Text):
        if text is not note and text.get_text() and text.get_visible():
            assert not text.get_window_extent().overlaps(box), text


def corners(text: Text) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The middle of a text in pixels, and half its length and half its height as vectors, less a pixel of air."""
    turn = text.get_rotation()
    middle = text.get_window_extent().get_points().mean(axis=0)
    text.set_rotation(0)
    size = np.diff(text.get_window_extent().get_points(), axis=0)[0] / 2 - 1
    text.set_rotation(turn)
    ahead = np.array([np.cos(np.radians(turn)), np.sin(np.radians(turn))])
    return middle, size[0] * ahead, size[1] * np.array([-ahead[1], ahead[0]])


def grid(text: Text) -> np.ndarray:
    """Points all over a text, (point, 2)."""
    middle, along, up = corners(text)
    return np.array([middle + a * along + b * up for a in np.linspace(-1, 1, 41) for b in np.linspace(-1, 1, 9)])


def within(points: np.ndarray, text: Text) -> np.ndarray:
    """Which of the points are on the text."""
    middle, along, up = corners(text)
    away = points - middle
    return (np.abs(away @ along) <= along @ along) & (np.abs(away @ up) <= up @ up)
