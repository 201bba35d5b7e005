"""Which measured edges are a target's own.

Edges of light that cross a target do not look like its own: the gray values beside them have
another ratio, or the profile is not a step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.features.profiles import Edges
from ahf_ros.imaging.logarithm import LOG_OFFSET

_LEAST_CONTRAST = 0.3  # of an edge, in steps of ln of the usual edge of the target
_RATIO_DOUBT = 1.5  # times the usual error of the ratio of the levels that halves the trust
_LEAST_RATIO_ERROR = 0.01  # that counts as usual
_RESIDUAL_DOUBT = 0.4  # times the usual residual, on top of it, that halves the trust
_LEAST_RESIDUAL = 0.3  # that counts as usual, gray values


@dataclass(frozen=True, slots=True)
class Trust:
    """How much the edges of k targets at m points each look like those of the targets.

    Attributes
    ----------
    seen : ndarray of bool, shape (k, m)
        Whether there is an edge of about the usual height.
    trust : ndarray of float64, shape (k, m)
        0 to 1, by the ratio of the levels beside it and by how much it is a step.
    contrast : ndarray of float64, shape (k,)
        Usual gray value of the dark side of an edge over that of the bright side.
    """

    seen: np.ndarray
    trust: np.ndarray
    contrast: np.ndarray


def trust_edges(edges: Edges) -> Trust:
    """Tell edges of targets from those of light, each target by its own usual edge."""
    dark, bright = np.maximum(edges.dark, 0), np.maximum(edges.bright, 0)
    step = np.log((bright + LOG_OFFSET) / (dark + LOG_OFFSET))
    usual = median(step, edges.visible)[:, None]
    seen = edges.visible & (step > _LEAST_CONTRAST * usual) & (step > 0)
    ratio = dark / np.maximum(bright, 1.0)
    contrast = median(ratio, seen)
    return Trust(seen, seen * _trust(ratio - contrast[:, None], edges.residual, seen), contrast)


def _trust(ratio_errors: np.ndarray, residuals: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Return how much edges look like those of the target, 0 to 1, shape (k, m)."""
    errors = np.abs(ratio_errors)
    usual = np.maximum(1.4826 * median(errors, seen), _LEAST_RATIO_ERROR)[:, None]
    trust = 1 / (1 + (errors / (_RATIO_DOUBT * usual)) ** 2)
    usual = np.maximum(median(residuals, seen), _LEAST_RESIDUAL)[:, None]
    excess = np.maximum(residuals / usual - 1, 0)
    return trust / (1 + (excess / _RESIDUAL_DOUBT) ** 2)


def median(values: np.ndarray, chosen: np.ndarray, nothing: float = 1.0) -> np.ndarray:
    """Return the medians of the chosen values, shape (k, m), `nothing` without any, shape (k,)."""
    count = chosen.sum(axis=1)
    ordered = np.sort(np.where(chosen, values, np.inf), axis=1)
    middle = np.take_along_axis(ordered, np.maximum(count - 1, 0)[:, None] // 2, axis=1)[:, 0]
    return np.where(count > 0, middle, nothing)
