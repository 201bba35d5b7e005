"""Dots that detectors of several kinds look for once."""

from dataclasses import replace

import numpy as np

from ahf_ros.scenes.scene import SceneSettings
from ahf_ros.vision.common_search import CommonSearch
from ahf_ros.vision.dot_search import voted_dots
from ahf_ros.vision.frame import circle_outlines, mean_radii
from ahf_ros.vision.pyramid import image_pyramid
from support.scenes import rendered

PYRAMID = image_pyramid(
    rendered(SceneSettings(width=480, height=360, targets=4, dot_radius=8, seed=3)).image, 60.0
)
DARK = voted_dots(PYRAMID, 4.0, 60.0, (1,))


def shared() -> tuple:
    """Return a pyramid whose dots are shared, and what its first detector finds."""
    common = replace(PYRAMID, common=CommonSearch(2.0, (1, -1)))
    return common, voted_dots(common, 4.0, 60.0, (1,))


def test_detectors_that_share_a_search_find_what_each_finds_alone() -> None:
    pyramid, first = shared()
    both = voted_dots(pyramid, 2.0, 60.0, (1, -1))
    for found, alone in ((first, DARK), (both, voted_dots(PYRAMID, 2.0, 60.0, (1, -1)))):
        assert len(alone.frames) > 3
        away = found.frames[:, None, :2, 2] - alone.frames[None, :, :2, 2]
        assert (np.hypot(*away.T).min(axis=1) < 1).all()
    assert set(first.polarity) == {1}
    assert set(both.polarity) == {1, -1}


def test_what_a_later_detector_has_explained_is_left_out() -> None:
    pyramid, first = shared()
    largest = mean_radii(first.frames).argmax()
    outline = circle_outlines(first.frames[[largest]], np.array([1.4]))
    rest = voted_dots(pyramid, 4.0, 60.0, (1,), outline)
    centres = {tuple(of) for of in rest.frames[:, :2, 2]}
    assert tuple(first.frames[largest, :2, 2]) not in centres
    assert len(centres) < len(first.frames)
