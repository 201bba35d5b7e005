"""How often what is read at a stated confidence is right, on four makers of pictures.

Rendered scenes of `support.pictures.conditions`, by this package, by the second maker of bent
sheets, and with the processing of a phone; and photographs by strangers, whose truth is that of
`benchmarks.photographs`. Readings of rings count from a confidence of 0.5 on, reported or not; of
other families, rendered in all lights of `benchmarks.bent` by the first two makers, those that
are reported. The expected number is the sum of their confidences.
Seeds from 101 on are for tests.

    python -m benchmarks.makers [FOLDER] [--seeds 301] [--output FILE]

FOLDER has clones of the repositories of the photographs, see `benchmarks.photographs`.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from itertools import chain, pairwise, product
from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros.families import create_detector
from ahf_ros.families.ring.confidence import confidence
from ahf_ros.prints import RING_NAMES
from ahf_ros.prints.families import FAMILY_NAMES, print_in
from ahf_ros.scenes.bent.picture import render_bent
from ahf_ros.scenes.evaluation import RIGHT, judge
from ahf_ros.scenes.scene import SceneSettings, render
from benchmarks import report
from benchmarks.confidence import readings_of
from support.pictures.bent import DOT_SHARES, HEIGHT, LIGHTS, WIDTH, settings
from support.pictures.conditions import Scene, lit, photographed, sheets_bent, small
from support.strangers import TRUTH, photographs, picture, targets_of

BOUNDS = (0.5, 0.7, 0.9, 0.97, 1.0)
"""Of the classes of confidence."""

FAMILIES = ('gsi', 'dots', 'cctag3', 'aruco_4x4_50', 'apriltag_36h11')
"""Those beside rings."""

RADIUS = 8.0
"""Of dots of these, or of targets as large as rings with such dots, px."""

Readings = tuple[str, str, np.ndarray, np.ndarray]
"""Maker, kind, stated confidences and what is right, of the readings of one image."""


def rings(seed: int) -> Iterator[Readings]:
    """Yield all readings of rings in rendered pictures."""
    ours = (Scene('', of.image, of.targets, of.settings.family) for of in map(render, lit(seed)))
    makers = {
        'this package': chain(ours, small(seed)),
        'bent sheets': (it for it in sheets_bent(seed) if it.condition == 'bent'),
        'phone': (it for it in photographed(seed) if it.condition == 'phone'),
    }
    for maker, scenes in makers.items():
        yield from (_read(maker, scene) for scene in scenes)


def _read(maker: str, scene: Scene) -> Readings:
    _, values, right, _ = readings_of(scene)
    return maker, 'ring', confidence(values), right


def strangers(folder: Path) -> Iterator[Readings]:
    """Yield all readings of the photographs that show rings."""
    for shown in photographs():
        name = shown['family']
        if name in RING_NAMES or name not in FAMILY_NAMES:
            file = None if name in RING_NAMES else TRUTH / f'{name}.json'
            scene = Scene('', picture(folder, shown), targets_of(shown), name, file=file)
            yield _read('photographs', scene)


def others(seed: int) -> Iterator[Readings]:
    """Yield what is reported of families beside rings, by both makers."""
    for family, light in product(FAMILIES, LIGHTS):
        pattern, ambient = light.split()
        plain = SceneSettings(
            width=WIDTH,
            height=HEIGHT,
            targets=24,
            family=family,
            dot_radius=RADIUS * DOT_SHARES.get(family, 1.0),
            light=pattern,
            ambient=float(ambient),
            seed=seed,
        )
        sheets = settings(family, 'dark', light, RADIUS, seed, plain.targets)
        for maker, scene in (
            ('this package', render(plain)),
            ('bent sheets', render_bent(sheets)),
        ):
            found = create_detector(family=family)(scene.image)
            right = [it.kind == RIGHT for it in judge(scene.targets, found)]
            stated = np.array([it.confidence for it in found])
            yield maker, print_in(family).kind, stated, np.array(right, bool)


def records(readings: Iterator[Readings]) -> list[dict[str, Any]]:
    """Return the counts by kind, maker and class."""
    parts: dict[tuple[str, str], list[np.ndarray]] = {}
    for maker, kind, stated, right in readings:
        parts.setdefault((kind, maker), []).append(np.stack([stated, right]))
    rows = []
    for (kind, maker), some in parts.items():
        stated, right = np.concatenate(some, axis=1)
        for low, high in pairwise(BOUNDS):
            within = (stated >= low) & ((stated < high) | (high == BOUNDS[-1]))
            rows.append(
                {
                    'kind': kind,
                    'maker': maker,
                    'confidence': f'{low} to {high}',
                    'readings': int(within.sum()),
                    'right': int(right[within].sum()),
                    'expected': float(stated[within].sum()),
                }
            )
    return [row for row in rows if row['readings']]


def markdown(figures: report.Report) -> str:
    """Return the report as a table."""
    columns: dict[str, report.Column] = {
        **{name: name for name in ('kind', 'maker', 'confidence', 'readings', 'right')},
        'expected': ('expected', 1),
        'stated': lambda of: report.number(of['expected'] / of['readings'], 3),
        'share right': lambda of: report.number(of['right'] / of['readings'], 3),
    }
    table = report.record_table(figures['rows'], columns)
    return '\n'.join([report.about_text(figures), '', *table])


def measure(options: argparse.Namespace) -> report.Report:
    """Return the figures of all makers; photographs only where their folder is given."""
    drawn = (chain(rings(seed), others(seed)) for seed in options.seeds)
    found = chain(strangers(options.folder) if options.folder else (), *drawn)
    return {'rows': records(report.progress(found, 'images'))}


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print."""
    made = report.parser(__doc__)
    made.add_argument('folder', type=Path, nargs='?', help='with the clones, as owner/name')
    return report.run(made, measure, markdown, arguments)


if __name__ == '__main__':
    sys.exit(main())
