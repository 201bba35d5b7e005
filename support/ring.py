"""Dots of ring targets for tests of single steps of their detector."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ahf_ros.families.ring.circles import REACH
from ahf_ros.prints.ring import RingPrint
from ahf_ros.vision.circle_fit import Fit, fit_dots
from ahf_ros.vision.frame import affine_frames


def made_up(x: Sequence[float], share: float = 1.0, radius: float = 10.0) -> Fit:
    """Return dark dots in a row at y = 50, with edges that are usual."""
    count = len(x)
    return Fit(
        frames=affine_frames(
            np.array(x), *(np.full(count, it) for it in (50.0, radius, radius, 0.0))
        ),
        polarity=np.ones(count, int),
        contrast=np.full(count, 0.3),
        bright=np.full(count, 200.0),
        share=np.full(count, share),
        deviation=np.full(count, 0.5),
        covariance=np.tile(np.eye(2), (count, 1, 1)),
        blur=np.full(count, 0.8),
        edge_shift=np.full(count, -0.3),
        proportion=np.ones(count),
    )


def inked(x: np.ndarray, y: np.ndarray, word: int, code: RingPrint) -> np.ndarray:
    """Return where a target has ink, bool, from coordinates on it in dot radii, y down."""
    radius, angle = np.hypot(x, y), np.arctan2(-y, x) % (2 * np.pi)
    sector = np.minimum(angle / (2 * np.pi) * code.bits, code.bits - 1).astype(int)
    inner, outer = code.band
    band = (radius > inner) & (radius < outer) & (word >> sector & 1 == 1)
    return np.asarray((radius < 1) | band)


def measured(
    gray: np.ndarray,
    x: Sequence[float] | np.ndarray,
    y: Sequence[float] | np.ndarray,
    radius: float | np.ndarray,
    polarity: int = 1,
    **options: Any,
) -> Fit:
    """Return dots as an image shows them, shape (height, width), from about where they are."""
    radii = np.broadcast_to(radius, len(x))
    frames = affine_frames(np.array(x), np.array(y), radii, radii, np.zeros(len(x)))
    polarities = np.full(len(frames), polarity)
    return fit_dots(gray.astype(np.float32), frames, polarities, rays=24, reach=REACH, **options)


def lone_dot(ink: float = 50.0, paper: float = 200.0, x: float = 150.0) -> np.ndarray:
    """Return an image of a dot of 12 px at (x, 100) without a band."""
    columns, rows = np.meshgrid(np.arange(300), np.arange(200))
    return np.where(np.hypot(columns - x, rows - 100) < 12, ink, paper).astype(np.float32)
