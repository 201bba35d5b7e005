"""Which dots are worth reading."""

from __future__ import annotations

import numpy as np
import pytest

from ahf_ros.codes.ring import family
from ahf_ros.detectors.ring.glance import may_be_targets
from ahf_ros.features.frame import affine_frames
from ahf_ros.synthetic.scene import SceneSettings, render

FAMILIES = [family(name) for name in ('aicon14', 'metashape12')]


@pytest.mark.parametrize('many', [False, True])
@pytest.mark.parametrize('polarity', ['dark', 'bright'])
@pytest.mark.parametrize('light', ['normal', 'stripe'])
def test_middles_of_targets_are_worth_reading(light: str, polarity: str, many: bool) -> None:
    scene = SceneSettings(
        width=900, height=600, targets=4, light=light, polarity=polarity, texture=0.0, seed=5
    )
    rendering = render(scene)
    middles = np.array([(target.x, target.y) for target in rendering.targets])
    size = np.full(len(middles), scene.dot_radius)
    frames = affine_frames(*middles.T, size, size, 0 * size)
    gray = rendering.image.astype(np.float32)
    assert may_be_targets(gray, frames, FAMILIES, many=many).all()
    assert may_be_targets(gray, frames[:0], FAMILIES, many=many).shape == (0,)


@pytest.mark.parametrize('many', [False, True])
def test_a_dot_without_a_band_is_not_worth_reading(many: bool) -> None:
    x, y = np.meshgrid(np.arange(300), np.arange(200))
    gray = np.where(np.hypot(x - 150, y - 100) < 12, 50, 200).astype(np.float32)
    frames = affine_frames(*np.array([[150.0], [100.0], [12.0], [12.0], [0.0]]))
    assert not may_be_targets(gray, frames, FAMILIES, many=many).any()
    near_the_border = affine_frames(*np.array([[30.0], [100.0], [12.0], [12.0], [0.0]]))
    assert may_be_targets(gray, near_the_border, FAMILIES, many=many).all() != many
