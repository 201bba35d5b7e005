"""Targets of very different sizes in one image: which are identified, and how exactly.

Scenes of one target each lie side by side. A cell has the error of the centre in px, or a dash
where the target is not identified. No limits of size are set. Seeds from 101 on are for tests.

    python -m benchmarks.sizes [--families metashape12 gsi ...] [--lights normal stripe ...]
        [--seed 101] [--output FILE]
"""

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

from ahf_ros.families import create_detector
from ahf_ros.scenes.evaluation import RIGHT, judge, score
from benchmarks import report
from benchmarks.report import FIRST_TEST_SEED, number
from support.collage import collage

RADII = {
    'metashape12': (500.0, 300.0, 150.0, 65.0, 20.0, 8.0, 4.0),
    'aicon14': (300.0, 150.0, 65.0, 20.0, 8.0, 4.0),
    'dots': (300.0, 150.0, 65.0, 20.0, 8.0, 4.0),
    'gsi': (150.0, 65.0, 20.0, 8.0, 4.0),
    'aruco_4x4_50': (500.0, 300.0, 150.0, 65.0, 20.0, 8.0),
    'apriltag_36h11': (300.0, 150.0, 65.0, 20.0, 12.0),
}
"""Radii of dots, or half sides of square markers, of each family, px."""

LIGHTS = {'normal': 0.3, 'stripe': 0.12, 'lattice': 0.12}
"""Ambient light of each light."""

TILTS = (0.0, 40.0)


def measure(options: argparse.Namespace) -> report.Report:
    """Return the figures of all families, lights and tilts."""
    return {'rows': list(records(options))}


def records(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Render and identify an image of each family, light and tilt; yield its row."""
    cells = [*product(options.families, options.lights, TILTS)]
    for family, light, tilt in report.progress(cells, 'images'):
        scene = {'light': light, 'ambient': LIGHTS[light], 'tilt': tilt}
        shown = collage(RADII[family], family, seed=options.seeds[0], **scene)
        found = create_detector(family=family)(shown.image)
        figures = score(shown.truth, found)
        errors = {
            verdict.target.id: math.dist(
                (target.x, target.y), (verdict.target.x, verdict.target.y)
            )
            for target, verdict in zip(found, judge(shown.truth, found), strict=True)
            if verdict.kind == RIGHT and verdict.target
        }
        yield {
            'family': family,
            'light': f'{light} {LIGHTS[light]:g}, {tilt:g} deg',
            'megapixels': shown.image.size / 1e6,
            'errors': {
                f'{radius:g}': errors.get(target.id)
                for radius, target in zip(RADII[family], shown.truth, strict=True)
            },
            'wrong': figures.wrong,
            'false_positives': figures.false_positives,
        }


def markdown(figures: report.Report) -> str:
    """Return the report as a table: a dash where a target is missed, nothing where none is."""
    radii = sorted({float(radius) for row in figures['rows'] for radius in row['errors']})
    columns = [f'{radius:g}' for radius in radii]
    rows = []
    for row in figures['rows']:
        errors = row['errors']
        cells = [number(errors[radius], 3) if radius in errors else '' for radius in columns]
        start = (row['family'], row['light'], number(row['megapixels'], 0))
        rows.append((*start, *cells, row['wrong'], row['false_positives']))
    head = ('family, px', 'light', 'MP', *columns, 'wrong', 'false')
    return '\n'.join([report.about_text(figures), '', *report.table(head, rows)])


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print."""
    made = report.parser(__doc__, seeds=False)
    made.add_argument('--families', nargs='+', choices=tuple(RADII), default=tuple(RADII))
    made.add_argument('--lights', nargs='+', choices=tuple(LIGHTS), default=tuple(LIGHTS))
    made.add_argument('--seed', type=int, default=[FIRST_TEST_SEED], nargs=1, dest='seeds')
    return report.run(made, measure, markdown, arguments)


if __name__ == '__main__':
    sys.exit(main())
