"""How well N is estimated from images, and what AHF does with it.

The first table is of scenes under all lights, as in benchmarks/identification.py, and of walls
without targets. The second one compares AHF with N given and with N estimated. Seeds from 101 on
are for tests, those below for development.

    python -m benchmarks.counting [--seeds 101] [--detector traditional]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from statistics import mean, median

import numpy as np
from rich.console import Console
from rich.progress import track

from ahf_ros.detectors import create_detector
from ahf_ros.detectors.ring.counting import estimate_count
from ahf_ros.detectors.ring.detector import RingDetector
from ahf_ros.evaluation import score
from ahf_ros.session import identify
from ahf_ros.synthetic.patterns import benchmark_lights
from ahf_ros.synthetic.scene import SceneSettings, render
from benchmarks.filter import machine

SEARCHED = (('normal', 0.3), ('stripe', 0.3), ('stripe', 0.12), ('lattice', 0.3))
"""Lights under which AHF is driven."""

SEARCHING = ('traditional', 'ring')
"""Detectors of ring targets, which AHF drives."""

EMPTY = (('normal', 0.3), ('stripe', 0.3), ('stripe', 0.04), ('lattice', 0.3), ('lattice', 0.04))
"""Lights on walls without targets."""

DISTRACTORS = 100
"""Marks on those that are no targets."""


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
        truth = scene.targets
        plain = score(truth, detector(scene.image))
        cells = [f'{light} {ambient:g}', str(len(truth)), str(plain.right)]
        times = []
        for expected in (len(truth), 0):
            found = identify(
                scene.image,
                detector=detector,
                expected_targets=expected,
                estimate_expected=True,
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
    """Print the tables as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--seeds', type=int, nargs='+', default=[101])
    parser.add_argument('--detector', nargs='*', choices=SEARCHING, default=SEARCHING[:1])
    options = parser.parse_args()
    facts = machine()
    seeds = ', '.join(map(str, options.seeds))
    print(f'Seeds: {seeds}. {facts["processor"]}, {facts["cores"]} cores.\n')
    print('\n'.join(counted(options.seeds)))
    for name in options.detector:
        print('\n' + '\n'.join(searched(options.seeds, name)))


if __name__ == '__main__':
    main()
