"""Four phases of projected light as one identification, without a search.

Rows are sizes and patterns, with ambient light of 0.02 of the projected one. They compare the
first image alone, the stack, and the same scene in normal light. Seeds from 101 on are for tests.

    python -m benchmarks.stacks [--lights stripe ...] [--radii 6 20] [--seeds 101] [--phases 4]
        [--json docs/figures/stacks.json]
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
from rich.console import Console
from rich.progress import track

import ahf_ros.blas  # noqa: F401  before numpy
from ahf_ros.sequence import StackSettings, identify_parts
from ahf_ros.session import create_identifier
from ahf_ros.synthetic.patterns import LIGHT_NAMES
from ahf_ros.synthetic.scene import SceneSettings, render
from benchmarks.filter import machine
from benchmarks.identification import FIRST_TEST_SEED, Row, are_tests

LIGHTS = ('stripe', 'fine_stripe', 'lattice', 'dense_lattice')
COLUMNS = ('first image', 'stack', 'normal light')
AMBIENT = 0.02


def measure(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Yield the figures of each size and light: of one image, of the stack, in normal light."""
    cells = [(radius, light) for radius in options.radii for light in options.lights]
    for radius, light in track(cells, 'scenes', console=Console(stderr=True)):
        rows = {column: Row(f'radius {radius:g}', light) for column in COLUMNS}
        chosen: Counter[str] = Counter()
        parts = 0
        for seed in options.seeds:
            base = SceneSettings(dot_radius=radius, seed=seed, targets=options.targets)
            scene = replace(base, light=light, ambient=AMBIENT, phases=options.phases)
            shown = [render(scene, phase) for phase in range(options.phases)]
            normal = render(base)
            for column, of in zip(COLUMNS, (shown[:1], shown, [normal]), strict=True):
                images = [rendering.image for rendering in of]
                identifier = create_identifier(expected_targets=options.targets, ahf=False)
                started = time.perf_counter()
                settings = StackSettings(stack=len(images))
                found = [it for _, _, it in identify_parts(identifier, images, settings)]
                seconds = time.perf_counter() - started
                rows[column].add(images[0], of[0].truth, (found[-1].targets, seconds))
                if len(of) > 1:
                    parts += len(found)
                    chosen[found[-1].combination] += 1
        records = {column: row.record() for column, row in rows.items()}
        yield {
            'radius': radius,
            'light': light,
            'parts': parts,
            'combinations': dict(chosen),
            **records,
        }


def markdown(report: dict[str, Any]) -> str:
    """Return the report as a table."""
    facts = report['machine']
    kind = 'Test' if report['test'] else 'Development'
    seeds = ', '.join(map(str, report['seeds']))
    head = ('radius', 'light', *COLUMNS, 'RMSE px', 'in normal light', 'NEES', 's', 'combination')
    lines = [
        f'{report["phases"]} phases, ambient light {AMBIENT:g}, {report["targets"]} targets an '
        f'image; right / wrong / false. {kind} seeds: {seeds}. {facts["processor"]}, Python '
        f'{facts["python"]}, numpy {facts["numpy"]}, OpenCV {facts["opencv"]}.',
        '',
        f'| {" | ".join(head)} |',
        '|---' * len(head) + '|',
    ]
    for row in report['rows']:
        counts = [
            f'{of["right"]} / {of["wrong"]} / {of["false_positives"]}'
            for of in (row[column] for column in COLUMNS)
        ]
        stack, normal = row['stack'], row['normal light']
        numbers = [
            '-' if value is None else f'{value:.{digits}f}'
            for value, digits in (
                (stack['rmse_xy'], 4),
                (normal['rmse_xy'], 4),
                (stack['nees'], 1),
                (stack['seconds'], 1),
            )
        ]
        names = ', '.join(sorted(row['combinations']))
        cells = (f'{row["radius"]:g}', row['light'], *counts, *numbers, names)
        lines.append(f'| {" | ".join(cells)} |')
    return '\n'.join(lines)


def parser() -> argparse.ArgumentParser:
    """Return what can be chosen."""
    made = argparse.ArgumentParser(description=__doc__.split('\n', 1)[0])
    made.add_argument('--lights', nargs='+', default=list(LIGHTS), choices=LIGHT_NAMES)
    made.add_argument('--radii', nargs='+', type=float, default=[6.0, 20.0])
    made.add_argument('--seeds', nargs='+', type=int, default=[FIRST_TEST_SEED])
    made.add_argument('--phases', type=int, default=4)
    made.add_argument('--targets', type=int, default=54)
    made.add_argument('--json', type=Path, help='Write the figures to this file, too.')
    return made


def main() -> int:
    """Measure and print."""
    options = parser().parse_args()
    cv2.setNumThreads(1)
    report = {
        'machine': machine(),
        'test': are_tests(options.seeds),
        'seeds': options.seeds,
        'phases': options.phases,
        'targets': options.targets,
        'rows': list(measure(options)),
    }
    print(markdown(report))
    if options.json:
        options.json.write_text(json.dumps(report, indent=1) + '\n')
    return 0


if __name__ == '__main__':
    sys.exit(main())
