"""Which dots are worth reading."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ahf_ros.codes.ring import family
from ahf_ros.detectors import DetectorSettings
from ahf_ros.detectors.ring import proposals
from ahf_ros.detectors.ring.circles import REACH
from ahf_ros.detectors.ring.detector import find_hypotheses, report
from ahf_ros.detectors.ring.proposals import may_be_targets
from ahf_ros.features.circle_fit import Fit, fit_dots
from ahf_ros.features.frame import affine_frames
from ahf_ros.synthetic.scene import SceneSettings, render

FAMILIES = [family(name) for name in ('aicon14', 'metashape12')]


def dots(gray: np.ndarray, x: list[float], y: list[float], radius: float, polarity: int) -> Fit:
    size = np.full(len(x), radius)
    frames = affine_frames(np.array(x), np.array(y), size, size, 0 * size)
    return fit_dots(gray, frames, np.full(len(x), polarity), rays=24, reach=REACH, rounds=1)


@pytest.mark.parametrize('polarity', ['dark', 'bright'])
@pytest.mark.parametrize('light', ['normal', 'stripe', 'lattice'])
@pytest.mark.parametrize('edge_shift', [-1.0, 0.0, 1.0])
def test_middles_of_targets_are_worth_reading(
    light: str, polarity: str, edge_shift: float
) -> None:
    scene = SceneSettings(
        width=900,
        height=600,
        targets=4,
        light=light,
        polarity=polarity,
        edge_shift=edge_shift,
        texture=0.0,
        seed=5,
    )
    rendering = render(scene)
    gray = rendering.image.astype(np.float32)
    x, y = zip(*((it.x, it.y) for it in rendering.targets), strict=True)
    sign = 1 if polarity == 'dark' else -1
    middles = dots(gray, list(x), list(y), scene.dot_radius + sign * edge_shift, sign)
    assert may_be_targets(gray, middles, FAMILIES).all()
    assert may_be_targets(gray, middles.select(slice(0)), FAMILIES).shape == (0,)


@pytest.mark.parametrize(('ink', 'paper'), [(50, 200), (200, 50)])
@pytest.mark.parametrize('x', [150.0, 50.0])
def test_a_dot_without_a_band_is_not_worth_reading(ink: int, paper: int, x: float) -> None:
    columns, rows = np.meshgrid(np.arange(300), np.arange(200))
    gray = np.where(np.hypot(columns - x, rows - 100) < 12, ink, paper).astype(np.float32)
    alone = dots(gray, [x], [100.0], 12.0, 1 if ink < paper else -1)
    assert not may_be_targets(gray, alone, FAMILIES).any()


@pytest.mark.parametrize(
    'scene',
    [
        SceneSettings(light='lattice', ambient=0.3, seed=3),
        SceneSettings(light='stripe', ambient=0.12, dot_radius=10.0, distractors=6, seed=4),
    ],
    ids=['lattice', 'stripe'],
)
def test_a_glance_saves_time_and_changes_nothing(
    scene: SceneSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    changes = {'width': 800, 'height': 600, 'targets': 6}
    image, settings = render(replace(scene, **changes)).image, DetectorSettings()
    few = find_hypotheses(image, settings)
    monkeypatch.setattr(proposals, '_HOPEFUL', -np.inf)
    all_dots = find_hypotheses(image, settings)
    assert len(all_dots.words) > 1.2 * len(few.words)
    targets, expected = report(few, settings), report(all_dots, settings)
    assert len(targets) >= 5
    assert [it.key for it in targets] == [it.key for it in expected]
    for one, other in zip(targets, expected, strict=True):
        assert (one.x, one.y) == pytest.approx((other.x, other.y), abs=0.02)
