"""Covariances of centres that edges of light have moved: they say so."""

import numpy as np
import pytest

from ahf_ros.families import DetectorSettings, create_detector
from ahf_ros.scenes.scene import SceneSettings
from benchmarks.rows import normalised_squares
from support.scenes import rendered


@pytest.mark.parametrize(('light', 'radius'), [('fine_stripe', 6.0), ('normal', 6.0)])
def test_centres_are_within_what_their_covariances_say(light: str, radius: float) -> None:
    """The mean is 2 where covariances are right, one in 3000 is beyond 4 standard deviations."""
    squares = []
    for seed in (11, 12):
        scene = rendered(
            SceneSettings(
                width=1200, height=900, targets=40, dot_radius=radius, light=light, seed=seed
            )
        )
        detect = create_detector(settings=DetectorSettings(family='metashape12'))
        squares += normalised_squares(scene.targets, detect(scene.image))
    assert len(squares) > 70
    assert 1.0 < np.mean(squares) < 3.0
    assert np.mean(np.array(squares) > 16) < 0.02
