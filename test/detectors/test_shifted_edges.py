"""Ink that gained or lost at every edge, and images that have too much light."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from ahf_ros.detectors import create_detector
from ahf_ros.evaluation import Score, score
from ahf_ros.synthetic.scene import SceneSettings, render
from ahf_ros.target import Target


@lru_cache
def seen(
    edge_shift: float, polarity: str = 'dark', overexposure: float = 1.0
) -> tuple[Score, list[Target]]:
    """Return the figures and the targets of a scene with dots of 10 px."""
    scene = SceneSettings(
        width=900,
        height=640,
        targets=20,
        dot_radius=10.0,
        radius_spread=0.0,
        polarity=polarity,
        edge_shift=edge_shift,
        overexposure=overexposure,
        seed=21,
    )
    rendering = render(scene)
    targets = create_detector('ring')(rendering.image)
    return score(rendering, targets), targets


def rms(figures: Score) -> float:
    return float(np.sqrt(np.mean(np.square(figures.errors)) * 2))


@pytest.mark.parametrize('polarity', ['dark', 'bright'])
@pytest.mark.parametrize('edge_shift', [-1.0, -0.6, 0.6, 1.0])
def test_shifted_edges_cost_no_target_and_are_reported(edge_shift: float, polarity: str) -> None:
    (figures, targets), (plain, as_printed) = seen(edge_shift, polarity), seen(0.0, polarity)
    assert (figures.right, figures.wrong, figures.false_positives) == (20, 0, 0)
    assert rms(figures) < rms(plain) + 0.005
    # A camera's gamma shifts edges, too.
    without = {it.id: it.edge_shift for it in as_printed}
    more = np.array([it.edge_shift - without[it.id] for it in targets])
    assert more == pytest.approx(edge_shift, abs=0.15)


@pytest.mark.parametrize('overexposure', [2.0, 4.0])
def test_over_exposed_targets_are_all_read(overexposure: float) -> None:
    figures, targets = seen(0.0, overexposure=overexposure)
    assert (figures.right, figures.wrong, figures.false_positives) == (20, 0, 0)
    darker = np.median([it.edge_shift for it in seen(0.0)[1]])
    assert np.median([it.edge_shift for it in targets]) < darker - 0.1
