"""How far the confidence of ring targets can be trusted, and the weights that it rests on.

Scenes under every condition of `benchmarks.conditions` are rendered, and every plausible reading
of the ring detector is compared with the truth. The table shows the reliability of the weights in
force by condition. With --fit, a logistic regression is fitted to the readings instead, and
written to the file of fitted weights. Seeds from 101 on are for tests, those below for
development.

    python -m benchmarks.confidence [--seeds 101 102]
    python -m benchmarks.confidence --fit 1 2 3
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ahf_ros.codes.ring import Family, canonical
from ahf_ros.detectors.ring.confidence import WEIGHTS, confidence, features
from ahf_ros.detectors.ring.contests import overlapping
from ahf_ros.detectors.ring.detector import find_hypotheses
from ahf_ros.detectors.ring.hypotheses import Hypotheses
from ahf_ros.imaging.image import as_gray
from benchmarks.conditions import COMMON, FOREIGN, Scene, scenes
from benchmarks.reliability import NEAR, Parts, gathered, reliability_table, run

COVERED = ('cover', 'cover like paper', 'another target')
"""Conditions under which something lies on targets."""

MARGIN, CODED = 0, 1
"""Places of some features."""

RARE = 0.3
"""Weight of a reading of a target under a condition that is not common, in the fit."""

_PRIOR = 1.0  # inverse variance of scaled weights
_ITERATIONS = 3000
_NO_SPREAD = 1e-9
_MINIMUM_MARGIN = np.log1p(2.0)  # of readings that count: others are not certain in any case
_HIDDEN, _TRACE = 0.03, -1.4  # share of the band, and feature of arcs, without a trace of covers


def readings(seed: int) -> Parts:
    """Yield condition, features, rightness and covers of all plausible readings of each scene."""
    return map(readings_of, scenes(seed))


def readings_of(scene: Scene) -> tuple[np.ndarray, ...]:
    """Return condition, features, rightness and covers of the plausible readings of a scene.

    Those of targets that nobody is asked for are left out.
    """
    code = scene.settings.codes(Family)[0]
    read = find_hypotheses(as_gray(scene.image), scene.settings)
    read = read.select(read.words > 0)
    _, ids = canonical(read.words, code)
    true = [(of.x, of.y, of.id, getattr(of, 'confirmed', True)) for of in scene.truth]
    x, y, number, asked = np.array(true).reshape(-1, 4).T
    near = np.hypot(read.frames[:, :1, 2] - x, read.frames[:, 1:2, 2] - y) < NEAR
    right = (near & (ids[:, None] == number)).any(axis=1)
    seen = near.any(axis=1) | (not scene.others)
    seen &= right | ~_below_right_ones(read, right)
    seen &= ~near[:, asked == 0].any(axis=1)
    condition = np.full(seen.sum(), scene.condition)
    return condition, features(read.select(seen)), right[seen], read.hidden[seen]


def _below_right_ones(read: Hypotheses, right: np.ndarray) -> np.ndarray:
    """Return which readings overlap the target of a right one with a larger margin, bool, (k,).

    These are not reported, whatever their confidence is.
    """
    over, margin = overlapping(read), read.margin
    below = [(over(it) & right & (margin > margin[it])).any() for it in range(len(right))]
    return np.array(below, bool)


def rising_regression(
    features: np.ndarray, right: np.ndarray, counts: np.ndarray
) -> tuple[float, np.ndarray]:
    """Return intercept and weights of a logistic regression, none of which is negative.

    Accelerated projected gradients (Nesterov 1983; Beck and Teboulle 2009) find those with the
    highest likelihood under a weak prior.

    Parameters
    ----------
    features : ndarray of float, shape (k, n)
    right : ndarray of bool, shape (k,)
    counts : ndarray of float, shape (k,)
        How often each row counts.
    """
    mean, spread = features.mean(axis=0), features.std(axis=0) + _NO_SPREAD
    basis = np.column_stack([np.ones(len(features)), (features - mean) / spread])
    prior = np.append(0.0, np.full(features.shape[1], _PRIOR))
    steepest = np.linalg.eigvalsh((basis.T * counts / 4) @ basis)[-1] + _PRIOR
    weights = ahead = np.zeros(basis.shape[1])
    momentum = 1.0
    for _ in range(_ITERATIONS):
        probability = 1 / (1 + np.exp(-np.clip(basis @ ahead, -30, 30)))
        gradient = basis.T @ (counts * (probability - right)) + prior * ahead
        after = ahead - gradient / steepest
        after[1:] = np.maximum(after[1:], 0)
        faster = (1 + np.sqrt(1 + 4 * momentum**2)) / 2
        ahead = after + (momentum - 1) / faster * (after - weights)
        weights, momentum = after, faster
    slopes = weights[1:] / spread
    return weights[0] - slopes @ mean, slopes


def fitted(seeds: Sequence[int]) -> dict[str, np.ndarray]:
    """Return the numbers of the regression on the scenes of some seeds, by their names."""
    condition, values, right, hidden = gathered(readings, seeds)
    # A cover without a trace cannot be told.
    no_trace = ~right & np.isin(condition, COVERED) & (hidden < _HIDDEN)
    no_trace &= values[:, CODED] > _TRACE
    told = (values[:, MARGIN] > _MINIMUM_MARGIN) & ~no_trace
    counts = np.where(np.isin(condition, COMMON + FOREIGN), 1.0, RARE)[told]
    intercept, weights = rising_regression(values[told], right[told], counts)
    return {'intercept': np.round([intercept], 3), 'weights': np.round(weights, 3)}


def reliability(seeds: Sequence[int]) -> list[str]:
    """Return the lines of the table of the scenes of some seeds."""
    condition, values, right, _ = gathered(readings, seeds)
    return reliability_table(condition, confidence(values), right)


if __name__ == '__main__':
    run('confidence', __doc__, fitted, reliability, WEIGHTS)
