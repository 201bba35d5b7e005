"""How well N is estimated from images.

Under all lights, as in `benchmarks.identification`, and on walls without targets. Seeds from 101
on are for tests, those below for development.

    python -m benchmarks.counting [--seeds 101]
"""

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from statistics import mean, median

import numpy as np

from ahf_ros.families.contract import DetectorSettings
from ahf_ros.families.ring.counting import estimate_count
from ahf_ros.families.ring.detector import RingDetector
from ahf_ros.scenes.scene import SceneSettings, render
from benchmarks import report
from benchmarks.report import number, table
from support.pictures.lights import LIT

EMPTY = (('normal', 0.3), ('stripe', 0.3), ('stripe', 0.04), ('lattice', 0.3), ('lattice', 0.04))
"""Lights on walls without targets."""

DISTRACTORS = 100
"""Marks on those that are no targets."""


def counted(seeds: Sequence[int]) -> list[str]:
    """Return the table of estimates, and what they come to."""
    rows, errors = [], []
    ratios: list[float] = []
    usual, empty = SceneSettings(), SceneSettings(targets=0, distractors=DISTRACTORS)
    cases = [(usual, *light) for light in LIT]
    cases += [(empty, *light) for light in EMPTY]
    for kind, light, ambient in report.progress(cases, 'scenes'):
        scene = replace(kind, light=light, ambient=ambient)
        seen = [measured(render(replace(scene, seed=seed)).image) for seed in seeds]
        estimates, times = zip(*seen, strict=True)
        errors += [abs(estimate - scene.targets) for estimate in estimates]
        ratios += times
        told = ', '.join(map(str, estimates))
        rows.append((f'{light} {ambient:g}', scene.targets, told, number(median(times), 2)))
    exact = sum(error == 0 for error in errors)
    return [
        *table(('light', 'N', 'estimates', 'times `ring`'), rows),
        '',
        f'abs(estimate - N): mean {mean(errors):.2f}, at most {max(errors)}, 0 in {exact} of '
        f'{len(errors)}. Time: {median(ratios):.2f} identifications by `ring` (median).',
    ]


def measured(image: np.ndarray) -> tuple[int, float]:
    """Return the estimate, and its time in those of an identification by `ring`."""
    settings = DetectorSettings(family='metashape12')
    started = time.perf_counter()
    RingDetector(settings)(image)
    identified = time.perf_counter()
    estimate = estimate_count(image, settings)
    return estimate, (time.perf_counter() - identified) / (identified - started)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table as Markdown."""
    return report.run(
        report.parser(__doc__),
        lambda options: {'table': counted(options.seeds)},
        lambda figures: '\n'.join([report.about_text(figures), '', *figures['table']]),
        arguments,
    )


if __name__ == '__main__':
    sys.exit(main())
