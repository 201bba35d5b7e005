"""The second reading of an image: its parts of faint contrast, stretched."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ahf_ros.detectors.ring.hypotheses import Hypotheses
from ahf_ros.features import frame
from ahf_ros.imaging.faint import faint_parts


def with_faint(
    gray: np.ndarray, found: Hypotheses, read: Callable[[np.ndarray], Hypotheses]
) -> Hypotheses:
    """Return the hypotheses of an image, and those that only its stretched parts show.

    Where an image was read with certainty as it is, nothing is added. Of what the stretched parts
    show, certain words are added and nothing else.

    Parameters
    ----------
    gray : ndarray of uint8 or float32, shape (height, width)
        Gray values from 0 to 255.
    found : Hypotheses
        Of the image as it is.
    read : callable
        Returns the hypotheses of an image, ndarray of float32, shape (height, width).
    """
    for part in faint_parts(gray):
        seen = read(part.gray)
        seen = seen.select(seen.certain)
        seen = replace(seen, frames=frame.translated(seen.frames, part.x, part.y))
        new = ~_on_dots(seen.frames, found.frames[found.certain])
        found = Hypotheses.joined([found, seen.select(new)])
    return found


def _on_dots(frames: np.ndarray, dots: np.ndarray) -> np.ndarray:
    """Return whether the centres of frames lie on dots, ndarray of bool, shape (k,)."""
    away = frames[:, None, :2, 2] - dots[:, :2, 2]
    return (np.hypot(away[..., 0], away[..., 1]) < frame.mean_radii(dots)).any(axis=1)
