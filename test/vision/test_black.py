"""Ink that is blacker than ink: clipped images, and drawings that were never printed."""

import numpy as np
import pytest

from ahf_ros.scenes.scene import SceneSettings, render
from ahf_ros.vision.black import black_lift, lifted
from support.scenes import scored


@pytest.mark.lasting
@pytest.mark.parametrize(
    ('family', 'polarity', 'dot_radius', 'targets'),
    [
        ('metashape12', 'bright', 8.0, 20),
        ('metashape20', 'dark', 12.0, 10),
        ('metashape20', 'bright', 12.0, 10),
        ('gsi', 'dark', 5.0, 6),
        ('gsi', 'bright', 5.0, 6),
    ],
)
def test_black_ink_is_read(family: str, polarity: str, dot_radius: float, targets: int) -> None:
    print_of = {'family': family, 'polarity': polarity, 'dot_radius': dot_radius, 'black': 0.0}
    scene = SceneSettings(width=800, height=600, targets=targets, seed=7, **print_of)
    figures = scored(render(scene), 'auto')
    assert figures.right >= targets - 1
    assert figures.wrong == figures.false_positives == 0


def test_black_is_lifted_to_that_of_prints() -> None:
    bright, contrast = np.full(4, 200.0), np.array([0.0, 0.1, 0.2, 0.5])
    lift = black_lift(contrast, bright)
    assert (lift[:2] > 0).all()
    assert (lift[2:] == 0).all()
    ratio = lifted(contrast * bright, lift) / lifted(bright, lift)
    assert ratio == pytest.approx([0.25, 0.225, 0.2, 0.5])
