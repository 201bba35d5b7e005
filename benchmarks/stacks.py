"""Four phases of projected light as one identification, without a search.

Rows are sizes and patterns, with ambient light of 0.02 of the projected one. They compare the
first image alone, the stack, and the same scene in normal light. Seeds from 101 on are for tests.

    python -m benchmarks.stacks [--lights stripe ...] [--radii 6 20] [--seeds 101] [--phases 4]
        [--output FILE]
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ahf_ros.session import create_identifier
from ahf_ros.session_settings import StackSettings
from ahf_ros.stream import identify_parts
from ahf_ros.synthetic.patterns import LIGHT_NAMES
from ahf_ros.synthetic.scene import SceneSettings, render
from ahf_ros.target import Identification
from benchmarks import report
from benchmarks.report import number
from benchmarks.rows import Row

LIGHTS = ('stripe', 'fine_stripe', 'lattice', 'dense_lattice')
COLUMNS = ('first image', 'stack', 'normal light')
AMBIENT = 0.02


def measure(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Yield the figures of each size and light: of one image, of the stack, in normal light."""
    cells = [(radius, light) for radius in options.radii for light in options.lights]
    for radius, light in report.progress(cells, 'scenes'):
        rows = {column: Row(f'radius {radius:g}', light) for column in COLUMNS}
        chosen: Counter[str] = Counter()
        parts = 0
        for seed in options.seeds:
            base = SceneSettings(
                width=options.width,
                height=options.height,
                dot_radius=radius,
                targets=options.targets,
                seed=seed,
            )
            scene = replace(base, light=light, ambient=AMBIENT, phases=options.phases)
            shown = [render(scene, phase) for phase in range(options.phases)]
            for column, of in zip(COLUMNS, (shown[:1], shown, [render(base)]), strict=True):
                found, seconds = identified([it.image for it in of], options.targets)
                rows[column].add(of[0].image, of[0].targets, (found[-1].targets, seconds))
                if len(of) > 1:
                    parts += len(found)
                    chosen[found[-1].combination] += 1
        yield {
            'radius': radius,
            'light': light,
            'parts': parts,
            'combinations': dict(chosen),
            **{column: row.record() for column, row in rows.items()},
        }


def identified(images: list[np.ndarray], expected: int) -> tuple[list[Identification], float]:
    """Return what was identified in each part of a stack, and the time that it took, s."""
    identifier = create_identifier(family='metashape12', expected_targets=expected, ahf=False)
    started = time.perf_counter()
    parts = identify_parts(identifier, images, StackSettings(stack=len(images)))
    found = [identification for _, _, identification in parts]
    return found, time.perf_counter() - started


def markdown(figures: report.Report) -> str:
    """Return the report as a table."""
    numbers = ('RMSE px', 'in normal light', 'NEES', 's')
    head = ('radius', 'light', *COLUMNS, 'parts', *numbers, 'combination')
    rows = []
    for row in figures['rows']:
        counts = [
            f'{of["right"]} / {of["wrong"]} / {of["false_positives"]}'
            for of in (row[column] for column in COLUMNS)
        ]
        stack, normal = row['stack'], row['normal light']
        errors = number(stack['rmse_xy'], 4), number(normal['rmse_xy'], 4)
        others = number(stack['nees'], 1), number(stack['seconds'], 1)
        names = ', '.join(sorted(row['combinations']))
        start = (f'{row["radius"]:g}', row['light'])
        rows.append((*start, *counts, row['parts'], *errors, *others, names))
    lines = [
        f'{figures["phases"]} phases, ambient light {AMBIENT:g}, {figures["targets"]} targets an '
        f'image; right / wrong / false. {report.about_text(figures)}',
        '',
        *report.table(head, rows),
    ]
    return '\n'.join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print."""
    made, usual = report.parser(__doc__), SceneSettings()
    made.add_argument('--lights', nargs='+', choices=LIGHT_NAMES, default=LIGHTS)
    made.add_argument('--radii', nargs='+', type=float, default=[6.0, 20.0])
    made.add_argument('--phases', type=int, default=4)
    made.add_argument('--targets', type=int, default=usual.targets)
    made.add_argument('--width', type=int, default=usual.width)
    made.add_argument('--height', type=int, default=usual.height)
    options = report.parsed(made, arguments)
    figures = report.about(options.seeds, phases=options.phases, targets=options.targets)
    figures['rows'] = list(measure(options))
    report.publish(figures, markdown(figures), options)
    return 0


if __name__ == '__main__':
    sys.exit(main())
