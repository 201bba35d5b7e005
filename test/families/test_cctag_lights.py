"""The light about CCTags, and what blur mixes of it with their ink."""

import numpy as np
import pytest

from ahf_ros.families.cctag import light as module
from ahf_ros.families.cctag.light import Lights, lit
from ahf_ros.scenes.scene import SceneSettings, render
from ahf_ros.vision.ellipse_targets import frames_of


@pytest.mark.parametrize('radius', [7.0, 10.0, 16.0])
def test_light_that_blur_mixes_with_ink_is_taken_out_at_all_sizes(
    radius: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    size = {'dot_radius': radius, 'width': int(90 * radius), 'height': int(60 * radius)}
    scene = SceneSettings(
        **size, family='cctag3', targets=12, light='stripe', ambient=0.12, gamma=1.0, seed=3
    )
    shown = render(scene)
    gray, frames = shown.image.astype(np.float32), frames_of(shown.targets)

    def left() -> float:
        """Return by how much rays differ in their own light, the median."""
        lights = Lights.about(gray, frames)
        rays = lit(gray, lights.moved, lights).values
        return float(np.median(np.abs(rays - np.median(rays, axis=1, keepdims=True))))

    lens, own = module._LENS, left()
    for other in (0.3, 1.7):
        monkeypatch.setattr(module, '_LENS', other * lens)
        assert left() > 1.02 * own
