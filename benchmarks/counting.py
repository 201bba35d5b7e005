"""How well N is estimated from images, what AHF does with it, and the weights that it rests on.

The first table is of scenes under all lights, as in benchmarks/identification.py, and of walls
without targets. The second one compares AHF with N given and with N estimated. With --fit, scenes
of all kinds and sizes are rendered instead, some targets half covered, and a logistic regression
is fitted to their dots, and written to the file of fitted weights. Seeds from 101 on are for
tests, those below for development.

    python -m benchmarks.counting [--seeds 101] [--detector traditional]
    python -m benchmarks.counting --fit 1 2 3 4 5 6 7 8
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from statistics import mean, median

import cv2
import numpy as np
from rich.console import Console
from rich.progress import track

from ahf_ros.codes.ring import FAMILY_NAMES, family
from ahf_ros.detectors import DetectorSettings, create_detector
from ahf_ros.detectors.ring.counting import estimate_count
from ahf_ros.detectors.ring.detector import RingDetector, find_hypotheses
from ahf_ros.detectors.ring.surroundings import target_features, terms
from ahf_ros.evaluation import score
from ahf_ros.features import frame
from ahf_ros.imaging.image import as_gray
from ahf_ros.session import identify
from ahf_ros.synthetic.patterns import benchmark_lights
from ahf_ros.synthetic.scene import Rendering, SceneSettings, render
from benchmarks.confidence import logistic_regression
from benchmarks.filter import machine
from benchmarks.weights import write_weights

SEARCHED = (('normal', 0.3), ('stripe', 0.3), ('stripe', 0.12), ('lattice', 0.3))
"""Lights under which AHF is driven."""

SEARCHING = ('traditional', 'ring')
"""Detectors of ring targets, which AHF drives."""

EMPTY = (('normal', 0.3), ('stripe', 0.3), ('stripe', 0.04), ('lattice', 0.3), ('lattice', 0.04))
"""Lights on walls without targets."""

DISTRACTORS = 100
"""Marks on those that are no targets."""

NEAR = 0.25
"""Largest distance of the middle of a target from its truth, semi-minor axes of its dot."""

LEAST_NEAR = 2.0
"""The same for small dots, px."""

ALIKE = 0.3
"""Largest difference of the sizes of a dot and of the true one, of ln."""

SIZES = (5.0, 7.0, 10.0, 14.0, 20.0, 20.0)
"""Radii of dots in the scenes that weights are fitted to, px."""


def training_scenes(seed: int) -> Iterator[SceneSettings]:
    """Yield small scenes under all lights: half with the usual targets, half with any."""
    for number, (light, ambient) in enumerate(benchmark_lights()):
        generator = np.random.default_rng([seed, number])
        kind = generator.choice(['empty', 'mixed', 'full'], p=[0.15, 0.3, 0.55])
        most = {'empty': 0, 'mixed': 14, 'full': 14}[str(kind)]
        scene = SceneSettings(
            width=1600,
            height=1066,
            targets=int(generator.integers(3, 14)) if kind == 'mixed' else most,
            distractors=0 if kind == 'full' else int(generator.integers(0, 15)),
            light=light,
            ambient=ambient,
            seed=seed,
        )
        if generator.random() < 0.5:
            radius = float(generator.choice(SIZES))
            steepest = {5.0: 30.0, 7.0: 45.0}.get(radius, 60.0)
            scene = replace(
                scene,
                family=str(generator.choice(FAMILY_NAMES)),
                polarity=str(generator.choice(['dark', 'bright'])),
                dot_radius=radius,
                tilt=min(float(generator.choice([0, 0, 30, 45, 60])), steepest),
                distractors=scene.distractors if kind == 'empty' else 0,
                focal_length=3.0,
            )
        yield scene


def half_covered(scene: Rendering) -> np.ndarray:
    """Return the image with sheets of paper of any gray over parts of a quarter of the bands."""
    image = scene.image.copy()
    generator = np.random.default_rng(scene.settings.seed)
    reach = family(scene.settings.family).band_outer * 1.1
    for target in scene.targets:
        covered, angle = generator.random() < 0.25, generator.uniform(0, 2 * np.pi)
        near, half_width = generator.uniform(1.3, 2.6), generator.uniform(0.8, 3.0)
        gray = int(generator.integers(10, 250))
        if covered:
            towards = np.array([np.cos(angle), np.sin(angle)])
            along = half_width * np.array([-towards[1], towards[0]])
            corners = np.array([near * towards - along, near * towards + along])
            corners = np.concatenate([corners, corners[::-1] + reach * towards])
            corners = np.array([target.x, target.y]) + target.semi_major * corners
            cv2.fillPoly(image, [np.rint(corners).astype(np.int32)], gray)
    return image


def dots(scene: Rendering) -> tuple[np.ndarray, np.ndarray]:
    """Return the features, shape (k, n), of all dots, and whether each is a target's middle."""
    image = half_covered(scene)
    code = family(scene.settings.family)
    found = find_hypotheses(as_gray(image), DetectorSettings(family=code.name))
    major, minor, _ = frame.ellipse_axes(found.frames)
    true = [(target.x, target.y, target.semi_major) for target in scene.targets]
    x, y, size = np.array(true).reshape(-1, 3).T
    distance = np.hypot(found.frames[:, :1, 2] - x, found.frames[:, 1:2, 2] - y)
    near = distance < np.maximum(LEAST_NEAR, NEAR * minor)[:, None]
    near &= np.abs(np.log(major[:, None] / size)) < ALIKE
    return target_features(image.astype(np.float32), found, code), near.any(axis=1)


def fitted(seeds: Iterable[int]) -> dict[str, np.ndarray]:
    """Return the numbers of the regression on the scenes of some seeds, by their names."""
    wanted = [scene for seed in seeds for scene in training_scenes(seed)]
    parts = [dots(render(scene)) for scene in progress(wanted)]
    features, of_target = (np.concatenate(part) for part in zip(*parts, strict=True))
    means, deviations = (np.round(of(features, axis=0), 3) for of in (np.mean, np.std))
    weights = logistic_regression(terms(features, means, deviations)[:, 1:], of_target)
    return {'means': means, 'deviations': deviations, 'weights': np.round(weights, 2)}


def counted(seeds: Sequence[int]) -> list[str]:
    """Return the table of estimates, and what they come to."""
    lines = ['| light | N | estimates | times `ring` |', '|---|---|---|---|']
    errors, ratios = [], []
    usual, empty = SceneSettings(), SceneSettings(targets=0, distractors=DISTRACTORS)
    rows = [(usual, *light) for light in benchmark_lights()]
    rows += [(empty, *light) for light in EMPTY]
    for kind, light, ambient in progress(rows):
        scene = replace(kind, light=light, ambient=ambient)
        seen = [measured(render(replace(scene, seed=seed)).image) for seed in seeds]
        estimates, times = zip(*seen, strict=True)
        errors += [abs(estimate - scene.targets) for estimate in estimates]
        ratios += times
        told = ', '.join(map(str, estimates))
        lines.append(f'| {light} {ambient:g} | {scene.targets} | {told} | {median(times):.2f} |')
    exact = sum(error == 0 for error in errors)
    lines += [
        '',
        f'abs(estimate - N): mean {mean(errors):.2f}, at most {max(errors)}, 0 in {exact} of '
        f'{len(errors)}. Time: {median(ratios):.2f} identifications by `ring` (median).',
    ]
    return lines


def measured(image: np.ndarray) -> tuple[int, float]:
    """Return the estimate, and its time in those of an identification by `ring`."""
    started = time.perf_counter()
    RingDetector()(image)
    identified = time.perf_counter()
    estimate = estimate_count(image)
    return estimate, (time.perf_counter() - identified) / (identified - started)


def searched(seeds: Sequence[int], name: str) -> list[str]:
    """Return the table of what AHF identifies with N given and with N estimated."""
    lines = [
        f'| light, `{name}` | N | d without AHF | d, N given | wrong | filters | d, N estimated '
        '| wrong | filters | times N given |',
        '|---' * 10 + '|',
    ]
    detector = create_detector(name)
    jobs = [(light, ambient, seed) for light, ambient in SEARCHED for seed in seeds]
    for light, ambient, seed in progress(jobs):
        scene = render(SceneSettings(light=light, ambient=ambient, seed=seed))
        truth = scene.truth
        plain = score(truth, detector(scene.image))
        cells = [f'{light} {ambient:g}', str(len(truth)), str(plain.right)]
        times = []
        for expected in (len(truth), 0):
            found = identify(
                scene.image, detector, expected_targets=expected, estimate_expected=True
            )
            figures = score(truth, found.targets)
            cells += [figures.right, figures.wrong + figures.false_positives]
            cells += [found.filter.evaluations]
            times.append(found.filter.duration)
        lines.append(f'| {" | ".join(map(str, cells))} | {times[1] / times[0]:.2f} |')
    return lines


def progress(jobs: Sequence) -> Iterable:
    """Return what goes through jobs and shows on standard error how far it is."""
    return track(jobs, 'scenes', console=Console(stderr=True))


def main() -> None:
    """Write weights, or print the tables as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--fit', type=int, nargs='+', metavar='SEED', help='fit the weights anew')
    parser.add_argument('--seeds', type=int, nargs='+', default=[101])
    parser.add_argument('--detector', nargs='*', choices=SEARCHING, default=SEARCHING[:1])
    options = parser.parse_args()
    if options.fit:
        write_weights('counting', options.fit, fitted(options.fit))
        return
    facts = machine()
    seeds = ', '.join(map(str, options.seeds))
    print(f'Seeds: {seeds}. {facts["processor"]}, {facts["cores"]} cores.\n')
    print('\n'.join(counted(options.seeds)))
    for name in options.detector:
        print('\n' + '\n'.join(searched(options.seeds, name)))


if __name__ == '__main__':
    main()
