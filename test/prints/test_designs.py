"""Outlines of printed targets, against the ink of rendered ones."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ahf_ros.prints.designs import Arc, Contour, _outlines, contours
from ahf_ros.prints.families import print_in
from ahf_ros.scenes.covers import ink_cover
from support.square_markers import needs_square_markers

ROUND = ('metashape12', 'metashape20', 'aicon14', 'gsi', 'dots', 'cctag4')
SQUARE = ('aruco_4x4_50', 'aruco_original', 'apriltag_25h9')
SHARP = np.eye(2, dtype=np.float32) * np.float32(0.01)


RINGED = """
family: ringed
bits: 10
band: [2, [2.8, 3.2]]
pinhole: 0.1
polarity: bright
circles: [[1.3, 1.6], [4, 4.5]]
words: all
"""


def polygon(contour: Contour) -> np.ndarray:
    corners: list[tuple[float, float]] = []
    for part in contour:
        if isinstance(part, Arc):
            for angle in part.start + part.extent * np.linspace(0, 1, 181):
                x, y = math.cos(angle), math.sin(angle)
                corners.append((part.x + part.radius * x, part.y + part.radius * y))
        else:
            corners.append(part)
    return np.array(corners)


def inside(contours: tuple[Contour, ...], points: np.ndarray) -> np.ndarray:
    """Return which points are in an odd number of contours, by the crossings of a ray."""
    crossings = np.zeros(len(points), int)
    x, y = points.T[:, :, None]
    for contour in contours:
        first = polygon(contour)
        second = np.roll(first, -1, axis=0)
        across = (first[:, 1] > y) != (second[:, 1] > y)
        rise = np.where(first[:, 1] == second[:, 1], 1, second[:, 1] - first[:, 1])
        at = first[:, 0] + (y - first[:, 1]) * (second[:, 0] - first[:, 0]) / rise
        crossings += (across & (at > x)).sum(axis=1)
    return crossings % 2 == 1


@pytest.mark.parametrize(
    'name',
    [*ROUND, 'ringed', *(pytest.param(name, marks=needs_square_markers) for name in SQUARE)],
)
def test_outlines_hold_the_ink_of_rendered_targets(name: str, tmp_path: Path) -> None:
    pinhole, file = 0.2, str(tmp_path / 'ringed.yaml') if name == 'ringed' else ''
    (tmp_path / 'ringed.yaml').write_text(RINGED)
    printed = print_in(name, file).design
    every = printed.all_ids
    generator = np.random.default_rng(5)
    for number in (every[0], every[len(every) // 2], every[-1]):
        shapes, reach = printed.ink(printed.word(number), pinhole), printed.proportions.reach
        points = generator.uniform(-1.1, 1.1, (1500, 2)) * reach
        points[:100] /= 5 * reach  # in the dot, about its hole
        x, y = points.astype(np.float32).T
        ink = ink_cover(shapes, 0.0)(x[None], y[None], SHARP)[0]
        clear = np.abs(ink - 0.5) > 0.49
        assert clear.mean() > 0.8
        assert (inside(contours(shapes), points) == (ink > 0.5))[clear].all()
        assert 0.05 < (ink > 0.5).mean() < 0.7
        outside = np.hypot(*points.T) > 1.02 * reach
        assert not ink[outside].any()


@given(st.lists(st.lists(st.booleans(), min_size=4, max_size=4), min_size=1, max_size=5))
def test_outlines_of_cells_enclose_exactly_the_cells(rows: list[list[bool]]) -> None:
    cells = np.array(rows)
    polygons = [np.array(corners, float) for corners in _outlines(cells)]
    area = 0.0
    for corners in polygons:
        following = np.roll(corners, -1, axis=0)
        assert ((corners != following).sum(axis=1) == 1).all()
        area -= (corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0]).sum() / 2
    assert area == cells.sum()
    middles = np.argwhere(np.ones_like(cells))[:, ::-1] + 0.5
    contours = tuple(tuple(map(tuple, corners.tolist())) for corners in polygons)
    assert inside(contours, middles).tolist() == cells.ravel().tolist()


def test_proportions_of_a_family_that_tells_more(tmp_path: Path) -> None:
    file = tmp_path / 'ringed.yaml'
    file.write_text(RINGED)
    found = print_in('ringed', str(file)).design.proportions
    assert (found.pinhole, found.polarity, found.reach) == (0.1, 'bright', 4.5)
    assert found.quiet_zone == pytest.approx(5.4)
    assert found.radii['band_outer'] == pytest.approx(3)
    assert found.radii['circle_2_outer'] == 4.5
    usual = [print_in(name).design.proportions for name in ('metashape12', 'dots', 'gsi')]
    assert [(it.pinhole, it.polarity) for it in usual] == [
        (0.05, 'dark'),
        (0.05, 'dark'),
        (0.0, 'dark'),
    ]


def test_a_target_that_is_not_there_is_named() -> None:
    message = 'number is 162, accepted is an ID of metashape12 from 1 to 161'
    with pytest.raises(ValueError, match=re.escape(message)):
        print_in('metashape12').design.word(162)
