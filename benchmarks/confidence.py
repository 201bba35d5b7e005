"""The weights of `ahf_ros.decoding.confidence`, and how far confidences can be trusted.

Scenes under all lights are rendered, every plausible reading of the ring detector is compared with
the truth, and a logistic regression is fitted to the readings of the development seeds. The
reliability of the weights in force is that of the test seeds, which the fit never sees.

    python benchmarks/confidence.py [--development 1 2 3] [--test 101 102]
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from itertools import pairwise

import numpy as np
from rich.progress import track

from ahf_ros.codes.ring import family
from ahf_ros.decoding import canonical, confidence
from ahf_ros.detectors.ring import RingDetector
from ahf_ros.synthetic.lights import benchmark_lights
from ahf_ros.synthetic.scene import Rendering, SceneSettings, render

NEAR = 5.0
"""Largest distance of a target from its truth, px."""

CLASSES = (0.0, 0.5, 0.9, 0.95, 0.98, 0.99, 0.999, 1.0)
"""Bounds of the classes of confidence in the table."""


def readings(scene: Rendering) -> tuple[np.ndarray, np.ndarray]:
    """Return the features, shape (k, n), of all plausible readings, and whether each is right."""
    found = RingDetector().hypotheses(scene.image)
    found = found.chosen(found.words > 0)
    _, numbers = canonical(found.words, family(scene.settings.family))
    x, y, number = np.array([(target.x, target.y, target.id) for target in scene.targets]).T
    distance = np.hypot(found.frames[:, :1, 2] - x, found.frames[:, 1:2, 2] - y)
    return found.features, ((distance < NEAR) & (numbers[:, None] == number)).any(axis=1)


def gathered(seeds: Iterable[int]) -> tuple[np.ndarray, np.ndarray]:
    """Return the readings of the scenes of some seeds under all lights."""
    scenes = [(name, ambient, seed) for seed in seeds for name, ambient in benchmark_lights()]
    parts = [
        readings(render(SceneSettings(light=name, ambient=ambient, seed=seed)))
        for name, ambient, seed in track(scenes, 'scenes')
    ]
    return tuple(np.concatenate(part) for part in zip(*parts, strict=True))


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


def main() -> None:
    """Print the weights and the reliability as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--development', type=int, nargs='*', default=[1, 2, 3])
    parser.add_argument('--test', type=int, nargs='*', default=[101, 102])
    options = parser.parse_args()
    if options.development:
        fitted = logistic_regression(*gathered(options.development))
        print('Intercept and weights:', ', '.join(f'{weight:.2f}' for weight in fitted), '\n')
    if options.test:
        features, right = gathered(options.test)
        stated = confidence(features)
        print('| confidence | readings | mean confidence | share right |\n|---|---|---|---|')
        for low, high in pairwise(CLASSES):
            chosen = (stated >= low) & (stated < high)
            if chosen.any():
                print(
                    f'| {low} to {high} | {chosen.sum()} | {stated[chosen].mean():.4f} '
                    f'| {right[chosen].mean():.4f} |'
                )


if __name__ == '__main__':
    main()
