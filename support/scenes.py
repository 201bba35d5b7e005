"""Scenes that tests share, each rendered once, and what is identified in them."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from ahf_ros.detectors import create_detector
from ahf_ros.evaluation import Score, score
from ahf_ros.synthetic.scene import Rendering, SceneSettings, render
from ahf_ros.target import Target

SMALL = SceneSettings(width=700, height=500, targets=6, dot_radius=18.0, seed=5)

rendered = lru_cache(render)


def identified(image: np.ndarray, detector: str = 'ring', **settings: Any) -> list[Target]:
    return create_detector(detector, **settings)(image)


def scored(scene: Rendering, detector: str = 'ring') -> Score:
    """Return the figures of what is identified in a scene."""
    return score(scene, identified(scene.image, detector, family=scene.settings.family))


def counts(figures: Score) -> tuple[int, int, int]:
    return figures.right, figures.wrong, figures.false_positives


def errors_of(figures: Score) -> list[float]:
    """Return the distances from the truth, px, the largest last."""
    return sorted(np.linalg.norm(figures.errors, axis=1).tolist())
