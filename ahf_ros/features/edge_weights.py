"""Which measured edges are a target's own.

Edges of light that cross a target do not look like its own: the gray values beside them have
another ratio, or the profile is not a step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.features.profiles import Edges
from ahf_ros.features.robust import cauchy, median, spread
from ahf_ros.imaging.logarithm import LOG_OFFSET

_MINIMUM_CONTRAST = 0.3  # of an edge, in steps of ln of the usual edge of the target
_RATIO_DOUBT = 1.5  # times the usual error of the ratio of the levels that halves the weight
_MINIMUM_RATIO_ERROR = 0.01  # that counts as usual
_RESIDUAL_DOUBT = 0.4  # times the usual residual, on top of it, that halves the weight
_MINIMUM_RESIDUAL = 0.3  # that counts as usual, gray values
_MINIMUM_BRIGHT = 1.0  # gray value that ratios are taken to


@dataclass(frozen=True, slots=True)
class EdgeWeights:
    """How much the edges of k targets at m points each look like edges of targets.

    Attributes
    ----------
    seen : ndarray of bool, shape (k, m)
        Whether there is an edge of about the usual height.
    weights : ndarray of float64, shape (k, m)
        0 to 1, by the ratio of the levels beside it and by how much it is a step.
    contrast : ndarray of float64, shape (k,)
        Usual gray value of the dark side of an edge, divided by the bright side's.
    """

    seen: np.ndarray
    weights: np.ndarray
    contrast: np.ndarray


def weigh_edges(edges: Edges) -> EdgeWeights:
    """Separate edges of targets from edges of light, by the usual edge of each target."""
    dark, bright = np.maximum(edges.dark, 0), np.maximum(edges.bright, 0)
    step = np.log((bright + LOG_OFFSET) / (dark + LOG_OFFSET))
    usual = median(step, edges.visible)[:, None]
    seen = edges.visible & (step > _MINIMUM_CONTRAST * usual) & (step > 0)
    ratio = dark / np.maximum(bright, _MINIMUM_BRIGHT)
    contrast = median(ratio, seen)
    errors = np.abs(ratio - contrast[:, None])
    by_ratio = cauchy(1.0, errors / (_RATIO_DOUBT * spread(errors, seen, _MINIMUM_RATIO_ERROR)))
    usual = np.maximum(median(edges.residual, seen), _MINIMUM_RESIDUAL)[:, None]
    excess = np.maximum(edges.residual / usual - 1, 0)
    return EdgeWeights(seen, seen * cauchy(by_ratio, excess / _RESIDUAL_DOUBT), contrast)
