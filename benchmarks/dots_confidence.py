"""How far the confidence of rings of dots can be trusted, and the weights that it rests on.

Scenes of all sizes, views, blurs and lights, with targets and with marks that are none, are
rendered, and every plausible reading of the detector `dots` is compared with the truth. The table
shows the reliability of the weights in force, by condition. With --fit, two logistic regressions
are fitted to the readings instead, and written to the file of fitted weights. Seeds from 101 on
are for tests, those below for development.

    python -m benchmarks.dots_confidence [--seeds 101 102]
    python -m benchmarks.dots_confidence --fit 1 2 3
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from ahf_ros.codes.dots import dot_family
from ahf_ros.detectors.contract import DetectorSettings
from ahf_ros.detectors.dots.detector import find_rings
from ahf_ros.detectors.dots.rings import WEIGHTS, target_probability, word_probability
from ahf_ros.features.pyramid import image_pyramid
from ahf_ros.imaging.image import as_gray
from ahf_ros.synthetic.patterns import LIGHT_NAMES
from ahf_ros.synthetic.scene import SceneSettings, render
from ahf_ros.target import Target
from benchmarks.reliability import NEAR, Parts, gathered, reliability_table, run
from benchmarks.textures import lookalikes

PER_RADIUS = 6.4
"""Width of a target in radii of its disc."""

WIDTHS = (22, 24, 26, 29, 36, 48, 60, 90)
"""Of targets in clean light, px."""

LOOKALIKES = 40
"""Images of rings that are no targets, for each seed."""

AMBIENT = (0.3, 0.12, 0.04, 0.02)
"""Ambient light, as a share of the projector's."""


def scenes(seed: int) -> Iterator[tuple[str, SceneSettings]]:
    """Yield conditions and scenes."""
    base = SceneSettings(family='dots', width=1500, height=1000, targets=20, seed=seed)
    for width in WIDTHS:
        yield 'size', replace(base, targets=40, dot_radius=width / PER_RADIUS)
    generator = np.random.default_rng(seed)
    for light, ambient in product(LIGHT_NAMES[1:], AMBIENT):
        radius = float(generator.choice([8, 11, 14, 18]))
        colour = str(generator.choice(['dark', 'bright']))
        count = round(3000 / radius**2)
        scene = replace(base, targets=count, dot_radius=radius, polarity=colour)
        yield f'ambient {ambient}', replace(scene, light=light, ambient=ambient)
    for tilt, radius in product((30.0, 45.0, 60.0, 70.0), (8.0, 14.0)):
        scene = replace(base, targets=12, tilt=tilt, focal_length=3.0, dot_radius=radius)
        yield 'oblique', scene
    for blur, radius in product((1.3, 1.8, 2.3), (7.0, 12.0)):
        yield 'blur', replace(base, blur=blur, dot_radius=radius)
    for electrons, radius in product((1000.0, 300.0, 100.0), (4.5, 9.0)):
        yield 'noise', replace(base, full_well=electrons, dot_radius=radius)
    for light in LIGHT_NAMES:
        marks = replace(base, targets=0, distractors=40, dot_radius=10.0, light=light)
        yield 'no targets', marks
    for family, light in product(('metashape12', 'aicon14'), ('normal', 'stripe', 'lattice')):
        yield 'no targets', replace(base, family=family, light=light, dot_radius=12.0)


def readings(seed: int) -> Parts:
    """Yield the plausible readings of each image: condition, features, of a target or not, right.

    There are features of a reading as that of a target, and as that of a word.
    """
    for condition, settings in scenes(seed):
        scene = render(settings)
        yield _compared(condition, scene.image, scene.targets if settings.family == 'dots' else ())
    for image in map(lookalikes, range(LOOKALIKES * seed, LOOKALIKES * (seed + 1))):
        yield _compared('lookalikes', image, ())


def _compared(
    condition: str, image: np.ndarray, targets: Sequence[Target]
) -> tuple[np.ndarray, ...]:
    settings, code = DetectorSettings(family='dots'), dot_family()
    pyramid = image_pyramid(as_gray(image), settings.max_radius)
    rings = find_rings(pyramid, settings, code)
    x, y, true = np.array([(it.x, it.y, it.id) for it in targets]).reshape(-1, 3).T
    near = np.hypot(rings.frames[:, :1, 2] - x, rings.frames[:, 1:2, 2] - y) < NEAR
    right = (near & (code.ids(rings.words)[:, None] == true)).any(axis=1)
    features = rings.target_features, rings.word_features
    return np.full(len(right), condition), *features, near.any(axis=1), right


def fitted(seeds: Sequence[int]) -> dict[str, np.ndarray]:
    """Return intercepts and weights of both regressions on the scenes of some seeds."""
    _, of_targets, of_words, shown, right = gathered(readings, seeds)
    return {
        'target': np.round(logistic_regression(of_targets, shown), 2),
        'word': np.round(logistic_regression(of_words[shown], right[shown]), 2),
    }


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


def reliability(seeds: Sequence[int]) -> list[str]:
    """Return the lines of the table of the scenes of some seeds."""
    conditions, of_targets, of_words, _, right = gathered(readings, seeds)
    stated = target_probability(of_targets) * word_probability(of_words)
    return reliability_table(conditions, stated, right)


if __name__ == '__main__':
    run('dots_confidence', __doc__, fitted, reliability, WEIGHTS)
