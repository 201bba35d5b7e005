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

import argparse
from collections.abc import Iterable, Iterator
from itertools import pairwise

import numpy as np
from rich.progress import track

from ahf_ros.codes.ring import canonical, family
from ahf_ros.detectors.contract import DetectorSettings
from ahf_ros.detectors.ring.confidence import confidence
from ahf_ros.detectors.ring.detector import find_hypotheses
from ahf_ros.detectors.ring.regression import terms
from ahf_ros.imaging.image import as_gray
from benchmarks.conditions import COMMON, Scene, scenes
from benchmarks.weights import write_weights

NEAR = 5.0
"""Largest distance of a target from its truth, px."""

CLASSES = (0.0, 0.5, 0.9, 0.95, 0.98, 0.99, 0.999, 1.0)
"""Bounds of the classes of confidence in the table."""

RARE = 0.1
"""Weight of a reading under a condition that is not common, in the fit."""

_PRIOR = 3.0  # inverse variance of scaled weights
_LONGEST_STEP = 4.0  # of a scaled weight, in one iteration
_MINIMUM_MARGIN = np.log1p(1.0)  # of readings that count
_TRACE = np.log1p(1.0)  # what is unexplained where something leaves a trace


def readings(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Return the features of all plausible readings, and which are right.

    Returns
    -------
    features : ndarray of float64, shape (k, n)
    right : ndarray of bool, shape (k,)
    """
    code = family(scene.family)
    read = find_hypotheses(as_gray(scene.image), DetectorSettings(family=code.name))
    read = read.select(read.words > 0)
    _, ids = canonical(read.words, code)
    true = [(target.x, target.y, target.id) for target in scene.truth]
    x, y, number = np.array(true).reshape(-1, 3).T
    near = np.hypot(read.frames[:, :1, 2] - x, read.frames[:, 1:2, 2] - y) < NEAR
    right = (near & (ids[:, None] == number)).any(axis=1)
    seen = near.any(axis=1) | (not scene.others)
    return read.features[seen], right[seen]


def gathered(seeds: Iterable[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the readings of the scenes of some seeds, and the condition of each."""
    parts = []
    for seed in seeds:
        for scene in track(scenes(seed), f'seed {seed}', total=None):
            part = readings(scene)
            parts.append((*part, np.full(len(part[0]), scene.condition)))
    features, right, condition = (np.concatenate(part) for part in zip(*parts, strict=True))
    return features, right, condition


def logistic_regression(
    features: np.ndarray, right: np.ndarray, counts: np.ndarray | None = None, prior: float = 1.0
) -> np.ndarray:
    """Return intercept and weights with the highest likelihood, under a weak prior.

    Parameters
    ----------
    features : ndarray of float, shape (k, n)
    right : ndarray of bool, shape (k,)
    counts : ndarray of float, shape (k,), optional
        How often each row counts; once where None.
    prior : float
        Inverse variance of the weights of scaled features.
    """
    counts = np.ones(len(features)) if counts is None else counts
    mean, spread = features.mean(axis=0), features.std(axis=0)
    basis = np.column_stack([np.ones(len(features)), (features - mean) / spread])
    curve = np.diag([0.0] + [prior] * features.shape[1])
    weights = np.zeros(basis.shape[1])
    for _ in range(100):
        probability = 1 / (1 + np.exp(-basis @ weights))
        gradient = basis.T @ (counts * (probability - right)) + curve @ weights
        curvature = (basis.T * (counts * probability * (1 - probability))) @ basis + curve
        step = np.linalg.solve(curvature, gradient)
        weights -= step * min(1, _LONGEST_STEP / np.abs(step).max())
    slopes = weights[1:] / spread
    return np.concatenate([[weights[0] - slopes @ mean], slopes])


def fitted(seeds: Iterable[int]) -> dict[str, np.ndarray]:
    """Return the numbers of the regression on the scenes of some seeds, by their names."""
    features, right, condition = gathered(seeds)
    margin, unexplained, hidden = features[:, :3].T
    # A cover without a trace cannot be told, nor can a word that is printed alike in two families.
    no_trace = ~right & (unexplained < _TRACE) & (hidden == 0)
    told = (margin > _MINIMUM_MARGIN) & ~no_trace
    features, right, condition = features[told], right[told], condition[told]
    means, deviations = (np.round(of(features, axis=0), 3) for of in (np.mean, np.std))
    counts = np.where(np.isin(condition, COMMON), 1.0, RARE)
    weights = logistic_regression(terms(features, means, deviations)[:, 1:], right, counts, _PRIOR)
    return {'means': means, 'deviations': deviations, 'weights': np.round(weights, 3)}


def reliability(seeds: Iterable[int]) -> Iterator[str]:
    """Yield the lines of the table of confidences and how often they are right."""
    features, right, condition = gathered(seeds)
    stated = confidence(features)
    yield '| condition | confidence | readings | mean confidence | share right |'
    yield '|---|---|---|---|---|'
    for name in dict.fromkeys(condition):
        for low, high in pairwise(CLASSES):
            within = (condition == name) & (stated >= low) & (stated < high)
            if within.any():
                yield (
                    f'| {name} | {low} to {high} | {within.sum()} | {stated[within].mean():.4f} '
                    f'| {right[within].mean():.4f} |'
                )


def main() -> None:
    """Write weights, or print their reliability as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--fit', type=int, nargs='+', metavar='SEED', help='fit the weights anew')
    parser.add_argument('--seeds', type=int, nargs='+', default=[101, 102])
    options = parser.parse_args()
    if options.fit:
        write_weights('confidence', options.fit, fitted(options.fit))
    else:
        print('\n'.join(reliability(options.seeds)))


if __name__ == '__main__':
    main()
