"""Targets in faint contrast, as haze and gloss leave it, and washed-out prints, of any family."""

import numpy as np
import pytest

from ahf_ros.families import create_detector
from ahf_ros.scenes.evaluation import score
from ahf_ros.scenes.scene import SceneSettings, render
from support.square_markers import needs_square_markers

RADII = {
    'metashape12': 10.0,
    'gsi': 5.0,
    'dots': 10.0,
    'cctag3': 24.0,
    'aruco_4x4_50': 15.0,
    'apriltag_36h11': 15.0,
}
GRAY, RANGE, NOISE = 110, 24, 0.7  # gray value of black, and of white more than that


@pytest.mark.parametrize(
    'family',
    [
        pytest.param(it, marks=needs_square_markers if it.startswith(('aruco', 'april')) else ())
        for it in RADII
    ],
)
def test_faint_targets_of_all_families_are_read_where_they_are(family: str) -> None:
    """Of the families without rings of arcs, none was read."""
    settings = SceneSettings(
        width=800, height=600, targets=4, family=family, dot_radius=RADII[family], seed=104
    )
    scene = render(settings)
    noise = NOISE * np.random.default_rng(1).standard_normal(scene.image.shape)
    faint = np.rint(GRAY + scene.image / 255 * RANGE + noise).astype(np.uint8)
    found = create_detector(family=family)(faint)
    seen = score(scene.targets, found)
    assert (seen.right, seen.wrong, seen.false_positives) == (4, 0, 0)
    places = {it.id: (it.x, it.y) for it in scene.targets}
    deviations = [np.sqrt(np.trace(np.reshape(it.covariance, (2, 2)))) for it in found]
    errors = [np.hypot(it.x - places[it.id][0], it.y - places[it.id][1]) for it in found]
    assert max(errors) < 0.1
    assert (np.array(errors) < 4 * np.array(deviations)).all()
