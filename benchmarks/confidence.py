"""How far the confidence of ring targets can be trusted, and the weights that it rests on.

Scenes under all lights are rendered, and every plausible reading of the ring detector is compared
with the truth. The table shows the reliability of the weights in force. With --fit, two logistic
regressions are fitted to the readings instead, and written to the file of fitted weights. Seeds
from 101 on are for tests, those below for development.

    python -m benchmarks.confidence [--seeds 101 102]
    python -m benchmarks.confidence --fit 1 2 3
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from itertools import pairwise, product

import numpy as np
from rich.progress import track

from ahf_ros.codes.ring import FAMILY_NAMES, canonical, family
from ahf_ros.detectors.contract import DetectorSettings
from ahf_ros.detectors.ring.confidence import OF_TARGET, confidence
from ahf_ros.detectors.ring.detector import find_hypotheses
from ahf_ros.imaging.image import as_gray
from ahf_ros.synthetic.patterns import LIGHT_NAMES, benchmark_lights
from ahf_ros.synthetic.scene import Rendering, SceneSettings, render
from benchmarks.weights import write_weights

NEAR = 5.0
"""Largest distance of a target from its truth, px."""

SHADOWS = (0.3, 0.08, 0.04, 0.02)
"""Ambient light of the smaller scenes, as a share of the projector's."""

CLASSES = (0.0, 0.5, 0.9, 0.95, 0.98, 0.99, 0.999, 1.0)
"""Bounds of the classes of confidence in the table."""


def readings(scene: Rendering) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the features of all plausible readings, and which are of targets, and right.

    Returns
    -------
    features : ndarray of float64, shape (k, n)
    of_target, right : ndarray of bool, shape (k,)
    """
    code = family(scene.settings.family)
    read = find_hypotheses(as_gray(scene.image), DetectorSettings(family=code.name))
    read = read.select(read.words > 0)
    _, ids = canonical(read.words, code)
    x, y, true = np.array([(target.x, target.y, target.id) for target in scene.targets]).T
    near = np.hypot(read.frames[:, :1, 2] - x, read.frames[:, 1:2, 2] - y) < NEAR
    return read.features, near.any(axis=1), (near & (ids[:, None] == true)).any(axis=1)


def scenes(seed: int) -> Iterator[SceneSettings]:
    """Yield scenes under all lights as in the figures, and smaller ones in deeper shadow."""
    for light, ambient in benchmark_lights():
        yield SceneSettings(light=light, ambient=ambient, seed=seed)
    generator = np.random.default_rng(seed)
    for light, ambient in product(LIGHT_NAMES[1:], SHADOWS):
        radius = float(generator.choice([9, 14, 20, 24]))
        yield SceneSettings(
            width=2000,
            height=1334,
            targets=round(6400 / radius**2),
            dot_radius=radius,
            family=str(generator.choice(FAMILY_NAMES)),
            polarity=str(generator.choice(['dark', 'bright'])),
            tilt=float(generator.choice([0, 30, 50])),
            light=light,
            ambient=ambient,
            seed=seed,
        )


def gathered(seeds: Iterable[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the readings of the scenes of some seeds."""
    wanted = [scene for seed in seeds for scene in scenes(seed)]
    parts = [readings(render(scene)) for scene in track(wanted, 'scenes')]
    features, of_target, right = (np.concatenate(part) for part in zip(*parts, strict=True))
    return features, of_target, right


def logistic_regression(features: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return intercept and weights with the highest likelihood, under a weak prior."""
    mean, spread = features.mean(axis=0), features.std(axis=0)
    basis = np.column_stack([np.ones(len(features)), (features - mean) / spread])
    prior = np.diag([0.0] + [1.0] * features.shape[1])
    weights = np.zeros(basis.shape[1])
    for _ in range(100):
        probability = 1 / (1 + np.exp(-basis @ weights))
        gradient = basis.T @ (probability - right) + prior @ weights
        curvature = (basis.T * (probability * (1 - probability))) @ basis + prior
        weights -= np.linalg.solve(curvature, gradient)
    slopes = weights[1:] / spread
    return np.concatenate([[weights[0] - slopes @ mean], slopes])


def fitted(seeds: Iterable[int]) -> dict[str, np.ndarray]:
    """Return intercepts and weights of both regressions on the scenes of some seeds."""
    features, of_target, right = gathered(seeds)
    return {
        'target': np.round(logistic_regression(features[:, :OF_TARGET], of_target), 2),
        'word': np.round(
            logistic_regression(features[of_target, OF_TARGET:], right[of_target]), 2
        ),
    }


def reliability(seeds: Iterable[int]) -> Iterator[str]:
    """Yield the lines of the table of confidences and how often they are right."""
    features, _, right = gathered(seeds)
    stated = confidence(features)
    yield '| confidence | readings | mean confidence | share right |'
    yield '|---|---|---|---|'
    for low, high in pairwise(CLASSES):
        within = (stated >= low) & (stated < high)
        if within.any():
            yield (
                f'| {low} to {high} | {within.sum()} | {stated[within].mean():.4f} '
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
