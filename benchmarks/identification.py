"""How many targets are identified, how exactly and how fast: lights, families, views and sizes.

Every row is a kind of scene, rendered with the given seeds. The seeds from 101 on are for tests:
nothing in the package was chosen by looking at them. Those below are for development, and a table
is of one kind or the other. The panel is a set of photographs and is shown where it is there.

    python -m benchmarks.identification [--detector ring] [--ahf] [--quick] [--lights stripe ...]
    python -m benchmarks.identification --compare docs/figures/ring.json
    python -m benchmarks.identification --command 'my_detector --family {family} {image}'

A command is used as the detector `command` does; its time includes its start.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros.families import DETECTOR_NAMES, DetectorSettings, create_detector
from ahf_ros.files.image_files import read_image
from ahf_ros.files.truth_files import read_truth
from ahf_ros.prints.ring import FAMILY_NAMES
from ahf_ros.scenes.patterns import LIGHT_NAMES
from ahf_ros.scenes.scene import SceneSettings
from benchmarks import comparison, report
from benchmarks.report import number
from benchmarks.rows import Case, Identify, Row, Seen, detector, measured, rendered
from support import PHOTOS
from support.pictures.lights import EVERY_LIGHT, LIT

PATIENCE = 600.0
"""Longest time for one image, s, of a command."""

QUICK: dict[str, Any] = {'width': 1200, 'height': 900, 'targets': 6}

GROUPS = ('light', 'family', 'polarity', 'tilt', 'radius', 'no targets', 'photographs')


def scenes(options: argparse.Namespace) -> Iterator[tuple[str, str, SceneSettings]]:
    """Yield group, name and scene of every row that is asked for."""
    base = SceneSettings(**QUICK) if options.quick else SceneSettings()
    for light, ambient in LIT:
        yield 'light', f'{light} {ambient:g}', replace(base, light=light, ambient=ambient)
    for family in FAMILY_NAMES[1:]:
        yield 'family', f'{family} normal', replace(base, family=family)
        for light in ('stripe', 'lattice'):
            scene = replace(base, family=family, light=light, ambient=0.12)
            yield 'family', f'{family} {light} 0.12', scene
    for light in ('normal', 'stripe', 'lattice'):
        yield 'polarity', f'bright {light} 0.3', replace(base, polarity='bright', light=light)
    for tilt in (30, 45, 62, 70):
        yield 'tilt', f'{tilt} deg', replace(base, tilt=float(tilt), focal_length=3.0)
    for radius in (5, 7, 10, 30):
        yield 'radius', f'{radius} px', replace(base, dot_radius=float(radius))
    marks = 20 if options.quick else 100
    for light in ('normal', 'stripe', 'lattice'):
        scene = replace(base, targets=0, distractors=marks, light=light)
        yield 'no targets', f'{light} 0.3', scene


def chosen_cases(options: argparse.Namespace) -> list[Case]:
    """Return the rows of the groups and lights that are asked for."""
    return [
        rendered(group, name, scene)
        for group, name, scene in scenes(options)
        if group in options.groups and scene.light in options.lights
    ]


def with_command(command: str) -> Identify:
    """Return identification by another program."""

    def run(image: np.ndarray, family: str, expected: int) -> Seen:
        words = command.replace('{family}', family).replace('{expected}', str(expected))
        settings = DetectorSettings(command=words, detector_timeout=PATIENCE)
        made = create_detector('command', settings=settings)
        started = time.perf_counter()
        return made(image), time.perf_counter() - started

    return run


def panel_rows(folder: Path, run: Identify) -> list[Row]:
    """Identify the photographs of the panel, if they are there."""
    truth_path = folder / 'panel' / 'truth.csv'
    if not truth_path.exists():
        return []
    row = Row('photographs', 'panel aicon14')
    for name, targets in report.progress(read_truth(truth_path).items(), 'panel'):
        image = read_image(truth_path.parent / name)
        shown = sum(target.confirmed for target in targets)
        row.add(image, targets, run(image, 'aicon14', shown))
    return [row]


def markdown(figures: report.Report) -> str:
    """Return the report as a table."""
    head = ('', '', 'd of N', 'wrong', 'false', 'RMSE X', 'Y', 'XY', 'NEES', 's', '/ contours')
    size = f'{figures["width"]} x {figures["height"]} px'
    rows = (
        (
            row['group'],
            row['name'],
            f'{row["right"]} of {row["expected"]}',
            row['wrong'],
            row['false_positives'],
            *(number(row[name], 3) for name in ('rmse_x', 'rmse_y', 'rmse_xy')),
            number(row['nees'], 1),
            number(row['seconds'], 2),
            number(row['times_contours'], 1),
        )
        for row in figures['rows']
    )
    lines = [f'{figures["method"]}, {size}. {report.about_text(figures)}', '']
    return '\n'.join(lines + report.table(head, rows))


def parser() -> argparse.ArgumentParser:
    """Return what can be chosen."""
    made = report.parser(__doc__)
    method = made.add_mutually_exclusive_group()
    method.add_argument('--detector', choices=DETECTOR_NAMES, default='ring')
    method.add_argument('--command', help='another program; {image}, {family}, {expected}')
    made.add_argument('--ahf', action='store_true', help='search for filters, N being given')
    made.add_argument('--quick', action='store_true', help='small images with six targets')
    made.add_argument('--lights', nargs='+', choices=LIGHT_NAMES, default=EVERY_LIGHT)
    made.add_argument('--groups', nargs='+', choices=GROUPS, default=GROUPS)
    made.add_argument(
        '--compare', type=Path, metavar='FILE', help='an earlier JSON object to show beside'
    )
    return made


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print."""
    options = report.parsed(parser(), arguments)
    size = SceneSettings(**QUICK) if options.quick else SceneSettings()
    figures = report.about(
        options.seeds,
        method=options.command or options.detector + (' with AHF' if options.ahf else ''),
        width=size.width,
        height=size.height,
    )
    before: dict[str, Any] | None = None
    if options.compare:
        before = json.loads(options.compare.read_text())
        try:
            comparison.check_comparable(before, figures)
        except ValueError as error:
            parser().error(str(error))
    run = detector(options.detector, ahf=options.ahf)
    if options.command:
        run = with_command(options.command)
    rows = [by[''] for by in measured(chosen_cases(options), options.seeds, {'': run})]
    if 'photographs' in options.groups:
        rows += panel_rows(PHOTOS, run)
    figures['rows'] = [row.record() for row in rows]
    if before:
        report.publish(figures, comparison.markdown(before, figures), options)
        return int(bool(comparison.worse(before, figures)))
    report.publish(figures, markdown(figures), options)
    return 0


if __name__ == '__main__':
    sys.exit(main())
