"""Targets of any size and blur: none is passed over, and centres are those of sharp edges."""

from typing import Any

import numpy as np
import pytest

from ahf_ros.families import DetectorSettings, create_detector
from ahf_ros.families.ring.counting import estimate_count
from ahf_ros.prints import VENDOR_NAMES
from ahf_ros.scenes.evaluation import score
from ahf_ros.scenes.scene import SceneSettings, render
from support.collage import Collage, collage
from support.scenes import counted, counts, errors, identified, rendering
from support.square_markers import needs_square_markers

pytestmark = pytest.mark.lasting

MAXIMUM_ERROR = 0.05
"""Of a centre of any size, px."""

SQUARE = 'aruco_4x4_50'
VENDORS = ','.join(VENDOR_NAMES)


def check(shown: Collage, family: str) -> None:
    """Assert that all targets are identified, with good centres, and nothing else."""
    figures = score(shown.truth, identified(shown.image, 'auto', family=family))
    assert counts(figures) == (len(shown.truth), 0, 0)
    assert np.abs(figures.errors).max() < MAXIMUM_ERROR


@pytest.mark.parametrize(
    ('printed', 'radii', 'read'),
    [
        ('metashape12', [300.0, 100.0, 65.0, 20.0, 8.0, 4.0], 'metashape12'),
        ('aicon14', [115.0, 95.0], VENDORS),
        ('dots', [185.0, 95.0, 20.0, 8.0], 'dots'),
        ('gsi', [60.0, 20.0, 5.0], 'gsi'),
        ('cctag4', [200.0, 90.0, 60.0, 20.0], 'cctag3,cctag4'),
        pytest.param(SQUARE, [150.0, 20.0, 6.0], SQUARE, marks=needs_square_markers),
    ],
)
def test_dots_of_any_size_in_one_image(printed: Any, radii: list[float], read: Any) -> None:
    check(collage(radii, printed, seed=5 if read == VENDORS else 0), read)


@pytest.mark.parametrize(('light', 'polarity'), [('stripe', 'bright'), ('lattice', 'dark')])
def test_large_dots_in_projected_light_that_are_seen_from_the_side(
    light: str, polarity: str
) -> None:
    shown = collage(
        [150.0, 65.0, 20.0], light=light, ambient=0.12, tilt=40.0, polarity=polarity, seed=3
    )
    check(shown, 'metashape12')
    assert estimate_count(shown.image, DetectorSettings(family='metashape12')) == len(shown.truth)


@pytest.mark.parametrize(
    ('family', 'radius', 'blur', 'size'),
    [
        ('metashape12', 60.0, 9.0, (1500, 1100)),
        ('dots', 60.0, 6.0, (1500, 1100)),
        ('gsi', 20.0, 5.0, (2000, 1500)),
    ],
)
def test_edges_that_are_softer_than_profiles_are_measured_in_halves(
    family: str, radius: float, blur: float, size: tuple[int, int]
) -> None:
    width, height = size
    shown = rendering(
        family=family, dot_radius=radius, blur=blur, width=width, height=height, targets=2, seed=4
    )
    found = create_detector(family=family)(shown.image)
    assert counted(shown, found) == (2, 0, 0)
    assert np.abs(errors(shown, found)).max() < 0.07


@needs_square_markers
def test_soft_square_markers_are_as_uncertain_as_they_say() -> None:
    family, size = 'apriltag_36h11', {'width': 2600, 'height': 1820, 'dot_radius': 80.0}
    shown = rendering(family=family, **size, blur=6.0, targets=2, seed=5)
    found = create_detector(family=family)(shown.image)
    assert counted(shown, found) == (2, 0, 0)
    truth = {it.id: (it.x, it.y) for it in shown.targets}
    for it in found:
        away = np.subtract((it.x, it.y), truth[it.id])
        assert np.hypot(*away) < 0.03
        assert away @ np.linalg.inv(np.reshape(it.covariance, (2, 2))) @ away < 9


def test_limits_are_obeyed_at_every_size() -> None:
    shown = collage([100.0, 50.0, 20.0])
    ids = [target.id for target in shown.truth]
    for limits, expected in (
        ({'max_radius': 80.0}, ids[1:]),
        ({'min_radius': 80.0}, ids[:1]),
        ({'min_radius': 30.0, 'max_radius': 80.0}, ids[1:2]),
        ({'min_radius': 2000.0}, []),
    ):
        found = identified(shown.image, **limits)
        assert sorted(target.id for target in found) == sorted(expected)


@pytest.mark.parametrize(
    ('changes', 'missed', 'deviation', 'least'),
    [
        ({'targets': 40, 'dot_radius': 14, 'tilt': 45.0, 'blur': 0.7}, 0, 0.02, 1.0),
        ({'targets': 30, 'dot_radius': 14}, 2, 0.02, 0.2),
        ({'targets': 30, 'dot_radius': 14, 'light': 'fringe'}, 2, 0.06, 0.2),
        ({'targets': 4, 'dot_radius': 10, 'family': 'gsi'}, 2, 0.04, 0.2),
        ({'targets': 8, 'dot_radius': 14, 'family': 'dots'}, 2, 0.04, 0.2),
    ],
    ids=['oblique', 'soft', 'under fringes', 'gsi', 'dots'],
)
def test_centres_are_as_right_as_they_say(
    changes: Any, missed: int, deviation: float, least: float
) -> None:
    scene = render(
        SceneSettings(**{'width': 1400, 'height': 1000, 'blur': 2, 'seed': 31} | changes)
    )
    truth = {target.id: target for target in scene.targets}
    found = identified(scene.image, 'auto', family=scene.settings.family)
    assert len(found) >= len(truth) - missed
    assert {it.id for it in found} <= set(truth)
    errors = np.array([(it.x - truth[it.id].x, it.y - truth[it.id].y) for it in found])
    covariances = np.array([it.covariance for it in found]).reshape(-1, 2, 2)
    assert np.sqrt((errors**2).sum(axis=1).mean()) < deviation
    assert np.hypot(*errors.T).max() < 5 * deviation
    squares = np.einsum('ki,kij,kj->k', errors, np.linalg.inv(covariances), errors)
    assert least < squares.mean() < 4  # 2 where covariances are right
