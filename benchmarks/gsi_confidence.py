"""How far the confidence of point-distributed targets can be trusted, and the weights behind it.

Scenes of GSI's targets under all lights, of all sizes and views, with dots of all radii that the
detector takes, are rendered, also without any target, with targets that lack a decoding dot, which
have no right code, and textures. Every hypothesis of the detector `gsi` is compared with the
truth. The table shows the reliability of the weights in force, by condition. With --fit, a
logistic regression whose weights have the right sign is fitted to the hypotheses and written to
the file of fitted weights. Seeds from 101 on are for tests, those below for development.

    python -m benchmarks.gsi_confidence [--seeds 101 102]
    python -m benchmarks.gsi_confidence --fit 1 2 3 4
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ahf_ros.codes.gsi import GSI_LIBRARY, point_family
from ahf_ros.detectors import DetectorSettings, create_detector
from ahf_ros.detectors.gsi.detector import find_hypotheses
from ahf_ros.detectors.gsi.hypotheses import WEIGHTS, Hypotheses, probability
from ahf_ros.features.pyramid import image_pyramid
from ahf_ros.synthetic.patterns import LIGHT_NAMES
from ahf_ros.synthetic.scene import Rendering, SceneSettings, render
from ahf_ros.target import DottedTarget
from benchmarks.confidence import rising_regression
from benchmarks.gsi import texture
from benchmarks.reliability import NEAR, Parts, gathered, reliability_table, run

BASE = SceneSettings(
    family='gsi', width=1600, height=1200, targets=6, dot_radius=5.0, focal_length=6.0
)
"""A scene; the others differ from it."""

COVERED = 2
"""Targets of a scene that lack a decoding dot."""

TEXTURES = 6
"""Textured images of a seed, which show no target."""

RADII = (1.0, 1.5, 2.0, 2.5, 3.0, 3.6)
"""Of dots, in the unit of the printed design."""

SIGNS = np.array([1, 1, 1, -1, -1, -1, 1])
"""Of the weights: support, weakest dot, margin and edges that were found speak for a target."""


def design(folder: Path, radius: float) -> str:
    """Return a data file that describes GSI's targets with dots of another radius."""
    path = folder / f'gsi_{radius:g}.json'
    path.write_text(
        GSI_LIBRARY.read_text(encoding='utf-8').replace(
            f'"dot_radius": {point_family().dot_radius:g}', f'"dot_radius": {radius:g}'
        ),
        encoding='utf-8',
    )
    return str(path)


def scenes(seed: int, folder: Path) -> Iterator[tuple[str, SceneSettings]]:
    """Yield the condition and the settings of every scene of a seed."""
    generator = np.random.default_rng(seed)

    def printed(scene: SceneSettings) -> SceneSettings:
        """Return a scene whose dots have another radius, in targets of the same size."""
        radius = float(generator.choice(RADII))
        pixels = scene.dot_radius * radius / point_family().dot_radius
        return replace(scene, family_file=design(folder, radius), dot_radius=pixels, seed=seed)

    for light, ambient in product(LIGHT_NAMES[1:], (0.3, 0.12, 0.04)):
        radius = float(generator.choice([5.0, 6.0, 8.0, 10.0]))
        polarity = str(generator.choice(['dark', 'bright']))
        changes = {'dot_radius': radius, 'polarity': polarity}
        yield light, printed(replace(BASE, light=light, ambient=ambient, **changes))
    for tilt, radius in product((0.0, 45.0, 70.0, 80.0), (2.5, 4.0, 5.0)):
        polarity = str(generator.choice(['dark', 'bright']))
        scene = replace(BASE, tilt=tilt, dot_radius=radius, polarity=polarity, targets=12)
        yield 'even light', printed(scene)
    for light in ('normal', 'stripe', 'lattice'):
        clutter = replace(BASE, targets=0, distractors=30, dot_radius=8.0, light=light)
        yield 'no targets', replace(clutter, seed=seed)


def with_covered_dots(scene: Rendering, count: int) -> tuple[np.ndarray, set[int]]:
    """Return an image in which some targets lack a decoding dot, and their IDs.

    Parameters
    ----------
    scene : Rendering
    count : int
        Number of these targets, of those that are identified.
    """
    image, covered = scene.image.copy(), set()
    shown = {target.id for target in scene.targets}
    for target in create_detector(family='gsi')(image):
        if target.id in shown and len(covered) < count and isinstance(target, DottedTarget):
            covered.add(target.id)
            x, y, radius, *_ = target.dots[-len(covered)]
            half = round(1.6 * radius + 2)
            rows, columns = (slice(max(round(at) - half, 0), round(at) + half) for at in (y, x))
            patch = image[rows, columns]
            patch[...] = np.median(
                np.concatenate([patch[0], patch[-1], patch[:, 0], patch[:, -1]])
            )
    return image, covered


def hypotheses(scene: Rendering) -> tuple[np.ndarray, np.ndarray]:
    """Return the features of all hypotheses, and which are right."""
    image, covered = with_covered_dots(scene, COVERED)
    found = found_in(image)
    x, y = (found.homographies[:, :2, 2] / found.homographies[:, 2:, 2]).T
    right = np.zeros(len(found.words), bool)
    for target in scene.targets:
        if target.id not in covered:
            near = np.hypot(x - target.x, y - target.y) < NEAR
            right |= near & (found.words == target.code)
    return found.features, right


def found_in(image: np.ndarray) -> Hypotheses:
    """Return the hypotheses of the detector."""
    settings = DetectorSettings(family='gsi')
    pyramid = image_pyramid(image, settings.max_radius)
    return find_hypotheses(pyramid, settings, point_family())[0]


def readings(seed: int) -> Parts:
    """Yield condition, features and rightness of the hypotheses of each image."""
    with TemporaryDirectory() as folder:
        for condition, settings in scenes(seed, Path(folder)):
            features, right = hypotheses(render(settings))
            yield np.full(len(right), condition), features, right
    for number in range(TEXTURES):
        features = found_in(texture(100 * seed + number)[0]).features
        yield np.full(len(features), 'no targets'), features, np.zeros(len(features), bool)


def fitted(seeds: Sequence[int]) -> dict[str, np.ndarray]:
    """Return intercept and weights of the regression on the scenes of some seeds, shape (8,)."""
    _, features, right = gathered(readings, seeds)
    intercept, slopes = rising_regression(SIGNS * features, right, np.ones(len(right)))
    return {'weights': np.round(np.append(intercept, SIGNS * slopes), 3) + 0.0}


def reliability(seeds: Sequence[int]) -> list[str]:
    """Return the lines of the table of the scenes of some seeds."""
    conditions, features, right = gathered(readings, seeds)
    return reliability_table(conditions, probability(features), right)


if __name__ == '__main__':
    run('gsi_confidence', __doc__, fitted, reliability, WEIGHTS)
