"""Scenes that tests share, each rendered once, and what is identified in them."""

from collections.abc import Sequence
from functools import cache, lru_cache
from typing import Any

import numpy as np

from ahf_ros.base.target import Target
from ahf_ros.families import create_detector
from ahf_ros.scenes.evaluation import Score, score
from ahf_ros.scenes.scene import Rendering, SceneSettings, render

SMALL = SceneSettings(width=700, height=500, targets=6, dot_radius=18.0, seed=5)

rendered = lru_cache(render)


def identified(image: np.ndarray, detector: str = 'ring', **settings: Any) -> list[Target]:
    return create_detector(detector, **{'family': 'metashape12', **settings})(image)


def scored(scene: Rendering, detector: str = 'ring') -> Score:
    """Return the figures of what is identified in a scene."""
    return score(scene, identified(scene.image, detector, family=scene.settings.family))


def counts(figures: Score) -> tuple[int, int, int]:
    return figures.right, figures.wrong, figures.false_positives


def errors_of(figures: Score) -> list[float]:
    """Return the distances from the truth, px, the largest last."""
    return sorted(np.linalg.norm(figures.errors, axis=1).tolist())


@cache
def rendering(**settings: Any) -> Rendering:
    return render(SceneSettings(**settings))


def counted(shown: Rendering, found: Sequence[Target]) -> tuple[int, int, int]:
    """Return how many targets are right, wrong, and false positives."""
    return counts(score(shown, found))


def errors(shown: Rendering, found: Sequence[Target]) -> np.ndarray:
    """Return the errors of centres, px, shape (k, 2)."""
    true = {target.id: target for target in shown.targets}
    return np.array([(it.x - true[it.id].x, it.y - true[it.id].y) for it in found])


def relative_errors(shown: Rendering, found: Sequence[Target]) -> np.ndarray:
    """Return the squares of the errors of centres by their covariances, shape (k,)."""
    covariances = np.array([it.covariance for it in found]).reshape(-1, 2, 2)
    error = errors(shown, found)[..., None]
    return (error.swapaxes(1, 2) @ np.linalg.solve(covariances, error))[:, 0, 0]


def around(x: float, y: float, half: float) -> tuple[slice, slice]:
    """Return rows and columns of a square about a place, px."""
    column, row, half = round(x), round(y), round(half)
    return np.s_[row - half : row + half + 1, column - half : column + half + 1]
