"""Families of rings drawn at random: learnt from one image, and identified.

Bits, radii and rules of words, edges that have moved, sizes and colours are drawn anew for each
family. Seeds from 301 on are for tests, those below 100 for development.

    python -m benchmarks.random_families [--seeds 301 302]
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ahf_ros.families import DetectorSettings, create_detector
from ahf_ros.families.learning.rings import LearntFamily, learn_families
from ahf_ros.families.ring.bands import find_bands
from ahf_ros.prints.ring import RingPrint, conforming, ring_family
from ahf_ros.scenes.evaluation import Score, score, total
from benchmarks import report
from benchmarks.report import table
from support.pictures.drawn_families import LIGHTS, TARGETS, random_family, sheet

FAMILIES = 50
"""Families of each seed."""

LEARNT_FROM = (20, 54)
"""Targets in an image that a family is learnt from."""

RADII = (5.0, 30.0)
"""Smallest and largest radius of dots, px."""


def rules_right(found: LearntFamily, rule: dict[str, Any]) -> tuple[bool, bool]:
    """Return whether the most probable rules are right, and whether any that may hold are.

    Rules are the same if the same words follow them.
    """
    every = np.arange(1 << min(found.bits, 16))

    def same(rules: dict[str, Any]) -> bool:
        first, second = (conforming(every, found.bits, **of) for of in (rules, rule))
        return rules == rule or (found.bits <= 16 and np.array_equal(first, second))

    return same(found.rules), any(same(rules) for rules, _ in found.likely)


def learnt_rightly(image: np.ndarray, code: RingPrint, rule: dict[str, Any]) -> tuple[bool, ...]:
    """Return whether bits, radii, words, rule, or one that is named, were learnt from an image."""
    found = learn_families(find_bands([image], DetectorSettings()))
    if not found or found[0].bits != code.bits:
        return (False,) * 5
    radii = np.abs(np.subtract(found[0].band, code.band)).max() < 0.03
    words = set(found[0].words.tolist()) <= set(code.words.tolist())
    return True, bool(radii), words, *rules_right(found[0], rule)


def measured(seed: int, file: Path) -> tuple[dict[int, list[tuple[bool, ...]]], dict[str, Score]]:
    """Return what was learnt rightly of each family, and what was identified by light.

    The first is by the number of targets in the image that it is learnt from.
    """
    learnt: dict[int, list[tuple[bool, ...]]] = {count: [] for count in LEARNT_FROM}
    scores: dict[str, list[Score]] = {light: [] for light in LIGHTS}
    for index in report.progress(range(FAMILIES), f'families of seed {seed}'):
        generator = np.random.default_rng([seed, index])
        rule = random_family(file, generator)
        code = ring_family(str(file))
        values = {
            'dot_radius': float(np.exp(generator.uniform(*np.log(RADII)))),
            'edge_shift': float(generator.choice([-0.5, 0.0, 0.5])),
            'polarity': str(generator.choice(['dark', 'bright'])),
        }
        detector = create_detector(family='mine', family_file=str(file))
        for light in LIGHTS:
            shown = sheet(file, TARGETS, light, index, values)
            scores[light].append(score(shown, detector(shown.image)))
        for count in LEARNT_FROM:
            shown = sheet(file, count, LIGHTS[0], index, values)
            learnt[count].append(learnt_rightly(shown.image, code, rule))
    return learnt, {light: total(of) for light, of in scores.items()}


def measure(options: argparse.Namespace) -> report.Report:
    """Return both tables of all seeds: what was learnt, and what was identified."""
    learnt: dict[int, list[tuple[bool, ...]]] = {count: [] for count in LEARNT_FROM}
    scores: dict[str, list[Score]] = {light: [] for light in LIGHTS}
    with TemporaryDirectory() as folder:
        for seed in options.seeds:
            of_seed, by_light = measured(seed, Path(folder, 'mine.json'))
            for count, rows in of_seed.items():
                learnt[count] += rows
            for light, of in by_light.items():
                scores[light].append(of)
    sums = ((light, total(of)) for light, of in scores.items())
    return {
        'learnt': table(
            (
                *('targets', 'families', 'bits right', 'radii within 0.03', 'all words right'),
                *('rule right', 'or named'),
            ),
            [
                (count, len(rows), *(sum(of) for of in zip(*rows, strict=True)))
                for count, rows in learnt.items()
            ],
        ),
        'identified': table(
            ('light', 'targets', 'right', 'wrong', 'false positives'),
            [(light, of.expected, of.right, of.wrong, of.false_positives) for light, of in sums],
        ),
    }


def markdown(figures: report.Report) -> str:
    """Return both tables as a page."""
    lines = [report.about_text(figures), '', *figures['learnt'], '', *figures['identified']]
    return '\n'.join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print."""
    return report.run(report.parser(__doc__), measure, markdown, arguments)


if __name__ == '__main__':
    sys.exit(main())
