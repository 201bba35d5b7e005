"""Targets of very different sizes in one image: which are identified, and how exactly.

Scenes of one target each lie side by side. A cell has the error of the centre in px, or a dash
where the target is not identified. No limits of size are set. Seeds from 101 on are for tests.

    python -m benchmarks.sizes [--families metashape12 gsi ...] [--lights normal stripe ...]
        [--seed 101] [--output FILE]
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from typing import Any

from rich.console import Console
from rich.progress import track

from ahf_ros.detectors import create_detector
from ahf_ros.evaluation import RIGHT, judge, score
from benchmarks.filter import machine
from benchmarks.identification import FIRST_TEST_SEED
from benchmarks.output import add_output, publish
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


def measure(families: Sequence[str], lights: Sequence[str], seed: int) -> Iterator[dict[str, Any]]:
    """Render and identify an image of each family, light and tilt; yield its row."""
    cells = [(family, light, tilt) for family in families for light in lights for tilt in TILTS]
    for family, light, tilt in track(cells, 'images', console=Console(stderr=True)):
        shown = collage(
            RADII[family], family, light=light, ambient=LIGHTS[light], tilt=tilt, seed=seed
        )
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


def markdown(report: dict[str, Any]) -> str:
    """Return the report as a table."""
    facts = report['machine']
    radii = sorted({float(radius) for row in report['rows'] for radius in row['errors']})
    columns = [f'{radius:g}' for radius in radii]
    kind = 'Test' if report['test'] else 'Development'
    lines = [
        f'{kind} seed: {report["seed"]}. {facts["processor"]}, {facts["cores"]} cores, Python '
        f'{facts["python"]}, numpy {facts["numpy"]}, OpenCV {facts["opencv"]}.',
        '',
        f'| family, px | light | MP | {" | ".join(columns)} | wrong | false |',
        '|---' * (len(columns) + 5) + '|',
    ]
    for row in report['rows']:
        cells = [_cell(row['errors'], radius) for radius in columns]
        ends = (row['wrong'], row['false_positives'])
        start = (row['family'], row['light'], f'{row["megapixels"]:.0f}')
        lines.append(f'| {" | ".join(map(str, (*start, *cells, *ends)))} |')
    return '\n'.join(lines)


def _cell(errors: dict[str, float | None], radius: str) -> str:
    """Return the error of a target, a dash where it is missed, nothing where there is none."""
    if radius not in errors:
        return ''
    error = errors[radius]
    return '-' if error is None else f'{error:.3f}'


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__.split('\n\n')[0],
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument('--families', nargs='+', choices=tuple(RADII), default=tuple(RADII))
    parser.add_argument('--lights', nargs='+', choices=tuple(LIGHTS), default=tuple(LIGHTS))
    parser.add_argument('--seed', type=int, default=FIRST_TEST_SEED)
    add_output(parser)
    options = parser.parse_args()
    report: dict[str, Any] = {
        'seed': options.seed,
        'test': options.seed >= FIRST_TEST_SEED,
        'machine': machine(),
        'rows': list(measure(options.families, options.lights, options.seed)),
    }
    publish(report, markdown(report), options.output)


if __name__ == '__main__':
    main()
