from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ahf_ros.detectors import create_detector
from ahf_ros.synthetic.scene import SceneSettings, render


@pytest.mark.parametrize(
    ('changes', 'deviation'),
    [
        ({'targets': 30, 'dot_radius': 14}, 0.02),
        ({'targets': 30, 'dot_radius': 14, 'light': 'fringe'}, 0.06),
        ({'targets': 4, 'dot_radius': 10, 'family': 'gsi'}, 0.04),
        ({'targets': 8, 'dot_radius': 14, 'family': 'dots'}, 0.04),
    ],
)
def test_centres_of_soft_targets_are_as_right_as_they_say(
    changes: dict[str, Any], deviation: float
) -> None:
    rendering = render(SceneSettings(width=1400, height=1000, blur=2, seed=31, **changes))
    truth = {target.id: target for target in rendering.targets}
    found = create_detector(family=rendering.settings.family)(rendering.image)
    assert len(found) >= len(truth) - 2
    assert {it.id for it in found} <= set(truth)
    errors = np.array([(it.x - truth[it.id].x, it.y - truth[it.id].y) for it in found])
    covariances = np.array([it.covariance for it in found]).reshape(-1, 2, 2)
    assert np.sqrt((errors**2).sum(axis=1).mean()) < deviation
    squares = np.einsum('ki,kij,kj->k', errors, np.linalg.inv(covariances), errors)
    assert 0.2 < squares.mean() < 4
