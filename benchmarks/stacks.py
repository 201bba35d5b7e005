"""Four phases of projected light as one identification, without a search.

Rows are sizes and patterns, with ambient light of 0.02 of the projected one. They compare the
first image alone, the stack, and the same scene in normal light. Seeds from 101 on are for tests.

    python -m benchmarks.stacks [--lights stripe ...] [--radii 6 20] [--seeds 101] [--phases 4]
        [--output FILE]
"""

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from ahf_ros.base.target import Identification
from ahf_ros.identification.session import create_identifier
from ahf_ros.identification.session_settings import StackSettings
from ahf_ros.identification.stream import identify_parts
from ahf_ros.scenes.patterns import LIGHT_NAMES
from ahf_ros.scenes.scene import SceneSettings, render
from benchmarks import report
from benchmarks.report import number
from benchmarks.rows import Row

LIGHTS = ('stripe', 'fine_stripe', 'lattice', 'dense_lattice')
COLUMNS = ('first image', 'stack', 'normal light')
AMBIENT = 0.02


def measure(options: argparse.Namespace) -> report.Report:
    """Return the figures of all sizes and lights."""
    rows = list(records(options))
    return {'phases': options.phases, 'targets': options.targets, 'rows': rows}


def records(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Yield the figures of each size and light: of one image, of the stack, in normal light."""
    cells = [*product(options.radii, options.lights)]
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

    def counts(column: str) -> report.Column:
        keys = ('right', 'wrong', 'false_positives')
        return lambda row: ' / '.join(f'{row[column][key]}' for key in keys)

    columns: dict[str, report.Column] = {
        'radius': lambda row: f'{row["radius"]:g}',
        'light': 'light',
        **{column: counts(column) for column in COLUMNS},
        'parts': 'parts',
        'RMSE px': lambda row: number(row['stack']['rmse_xy'], 4),
        'in normal light': lambda row: number(row['normal light']['rmse_xy'], 4),
        'NEES': lambda row: number(row['stack']['nees'], 1),
        's': lambda row: number(row['stack']['seconds'], 1),
        'combination': lambda row: ', '.join(sorted(row['combinations'])),
    }
    about = (
        f'{figures["phases"]} phases, ambient light {AMBIENT:g}, {figures["targets"]} targets an '
        f'image; right / wrong / false. {report.about_text(figures)}'
    )
    return '\n'.join([about, '', *report.record_table(figures['rows'], columns)])


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print."""
    made, usual = report.parser(__doc__), SceneSettings()
    made.add_argument('--lights', nargs='+', choices=LIGHT_NAMES, default=LIGHTS)
    made.add_argument('--radii', nargs='+', type=float, default=[6.0, 20.0])
    made.add_argument('--phases', type=int, default=4)
    for name in ('targets', 'width', 'height'):
        made.add_argument(f'--{name}', type=int, default=getattr(usual, name))
    return report.run(made, measure, markdown, arguments)


if __name__ == '__main__':
    sys.exit(main())
