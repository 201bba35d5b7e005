"""A glance finds outermost circles from any circle of a CCTag, and none about a disc."""

import numpy as np
import pytest

from ahf_ros.families.cctag.glance import Circles, likely_rings
from ahf_ros.prints.cctag import circle_family
from ahf_ros.scenes.scene import Rendering
from ahf_ros.vision import frame
from ahf_ros.vision.dots import Dots
from support.scenes import rendering

BOUNDS = (4.0, 90.0)


def scene(family: str, dot_radius: float = 24.0) -> Rendering:
    return rendering(
        width=240, height=200, targets=1, dot_radius=dot_radius, seed=2, family=family
    )


def frames_from(shown: Rendering, radius: float, polarity: int) -> np.ndarray:
    """Return the frames that are found from one circle, in radii of the dot of the only target."""
    [target] = shown.targets
    size = radius * target.semi_major
    start = frame.affine_frames(*np.array([[target.x, target.y, size, size, 0.0]]).T)
    circles = Circles.at(
        shown.image.astype(np.float32), Dots(start, np.array([polarity]), np.ones(1))
    )
    [[found]] = likely_rings(circles, [BOUNDS], [(1, circle_family('cctag4'))])
    return found


@pytest.mark.parametrize('index', [0, 1, 3, 5, 7])
def test_the_outermost_circle_is_found_from_any(index: int) -> None:
    shown = scene('cctag4')
    [target] = shown.targets
    radius = circle_family('cctag4').radii(np.array([target.id]))[0, index]
    [found] = frames_from(shown, radius, -1 if index % 2 else 1)
    assert frame.mean_radii(found[None]) == pytest.approx(target.semi_major, rel=0.05)


def test_a_disc_has_none() -> None:
    assert len(frames_from(scene('metashape12', 10.0), 1.0, 1)) == 0
