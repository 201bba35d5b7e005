"""Where the light ends: small, oblique, blurred and shifted targets, without a search.

Rows are views and light, columns are patterns. A cell has the targets with the right ID, of N,
then wrong IDs and false positives where there are any, and the NEES of the right ones: 2 on
average where covariances are right. Groups of rows are `light`; `edge shift`, prints whose ink is
larger or smaller on every edge, in half of the image as well; and `exposure`, photographs that are
exposed several times too long. The scenes are those of `benchmarks.identification` and, in two
other settings, scenes that nothing in the package was fitted to. `other` has finer patterns in
another direction, a wider lens, more noise, and another gamma; `strange` has coarser patterns, a
long lens with distortion, a noisy camera with a flat gamma, gray ink on coarse paper, and targets
on white cards before a darker wall. Seeds from 101 on are for tests.

    python -m benchmarks.limits [--detector ring] [--family gsi] [--setting other]
        [--group 'edge shift'] [--rows 'radius 6, 0.12' ...] [--lights stripe ...] [--seeds 101]
        [--output FILE]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from rich.console import Console
from rich.progress import track

from ahf_ros.codes.families import FAMILY_NAMES
from ahf_ros.detectors import DETECTOR_NAMES
from ahf_ros.synthetic.patterns import LIGHT_NAMES
from ahf_ros.synthetic.scene import Rendering, SceneSettings, render
from benchmarks.filter import machine
from benchmarks.identification import FIRST_TEST_SEED, Row, are_tests, with_detector
from benchmarks.output import add_output, publish

_VIEWS: dict[str, dict[str, Any]] = {
    'radius 20, 0.04': {'ambient': 0.04},
    'radius 20, 0.02': {'ambient': 0.02},
    'radius 10, 0.12': {'ambient': 0.12, 'dot_radius': 10.0},
    'radius 6, 0.3': {'ambient': 0.3, 'dot_radius': 6.0},
    'radius 6, 0.12': {'ambient': 0.12, 'dot_radius': 6.0},
    '55 deg, 0.12': {'ambient': 0.12, 'tilt': 55.0, 'focal_length': 3.0},
    '62 deg, 0.12': {'ambient': 0.12, 'tilt': 62.0, 'focal_length': 3.0},
    'blur 2 px, 0.12': {'ambient': 0.12, 'blur': 2.0},
}

_SHIFTS: dict[str, dict[str, Any]] = {
    f'radius {radius:g}, {shift:+g} px': {'dot_radius': radius, 'edge_shift': shift}
    for radius, shifts in (
        (20.0, (-1.5, -1.0, -0.5, 0.5, 1.0, 1.5)),
        (10.0, (-1.5, -1.0, -0.5, 0.5, 1.0, 1.5)),
        (5.0, (-0.5, 0.5)),
    )
    for shift in shifts
}
_HALVES: dict[str, dict[str, Any]] = {
    f'radius {radius:g}, -1 and +1 px': {'dot_radius': radius, 'edge_shift': -1.0}
    for radius in (20.0, 10.0)
}
_EXPOSURES: dict[str, dict[str, Any]] = {
    f'radius {radius:g}, {factor:g} times': {
        'dot_radius': radius,
        'overexposure': factor,
        'blur': 1.0,
    }
    for radius in (20.0, 10.0)
    for factor in (2.0, 4.0, 8.0)
}


@dataclass(frozen=True, slots=True)
class Group:
    """Rows that are one table.

    Attributes
    ----------
    rows : dict
        What differs from a scene of dots of 20 px, by the name of the row.
    lights : tuple of str
        The columns.
    """

    rows: dict[str, dict[str, Any]]
    lights: tuple[str, ...]


GROUPS = {
    'light': Group(_VIEWS, ('stripe', 'fine_stripe', 'lattice', 'dense_lattice')),
    'edge shift': Group(_SHIFTS | _HALVES, ('normal', 'fringe', 'stripe', 'lattice')),
    'exposure': Group(_EXPOSURES, ('normal',)),
}
"""The tables by their names."""

SETTINGS: dict[str, dict[str, Any]] = {
    'usual': {},
    'other': {
        'light_scale': 0.8,
        'light_turn': 37.0,
        'focal_length': 2.4,
        'full_well': 6000.0,
        'gamma': 1.8,
    },
    'strange': {
        'light_scale': 1.3,
        'light_turn': -64.0,
        'focal_length': 5.0,
        'distortion': -0.25,
        'full_well': 4000.0,
        'read_noise': 8.0,
        'gamma': 1.5,
        'black': 0.09,
        'texture': 0.04,
        'wall': 0.35,
    },
}
"""Settings of the renderer; nothing in the package was fitted to `other` and `strange`."""

DOT_SHARES = {'gsi': 0.5, 'dots': 0.7}
"""Radius of the dot over that of a ring target of about the same size."""


def scene(options: argparse.Namespace, row: str, light: str, seed: int) -> SceneSettings:
    """Return the scene of a row, a light and a seed."""
    changes = GROUPS[options.group].rows[row] | SETTINGS[options.setting]
    radius = changes.get('dot_radius', SceneSettings().dot_radius)
    changes['dot_radius'] = radius * DOT_SHARES.get(options.family, 1.0)
    return SceneSettings(
        family=options.family, targets=options.targets, light=light, seed=seed, **changes
    )


def photograph(options: argparse.Namespace, row: str, light: str, seed: int) -> Rendering:
    """Return the rendering of a row, a light and a seed; of some, each half has its own shift."""
    settings = scene(options, row, light, seed)
    rendering = render(settings)
    if row in _HALVES:
        other = render(replace(settings, edge_shift=-settings.edge_shift))
        right = slice(settings.width // 2, None)
        rendering.image[:, right] = other.image[:, right]
    return rendering


def measure(options: argparse.Namespace) -> Iterator[Row]:
    """Render and identify every scene with every seed; yield a row of each row and light."""
    run = with_detector(options)
    cells = [(row, light) for row in options.rows for light in options.lights]
    for row, light in track(cells, 'scenes', console=Console(stderr=True)):
        cell = Row(row, light)
        for seed in options.seeds:
            rendering = photograph(options, row, light, seed)
            truth = rendering.targets
            cell.add(rendering.image, truth, run(rendering.image, options.family, len(truth)))
        yield cell


def cell_text(record: dict[str, Any]) -> str:
    """Return a cell of the table."""
    text = f'{record["right"]}'
    if record['wrong'] or record['false_positives']:
        text += f', {record["wrong"]} wrong, {record["false_positives"]} false'
    return text if record['nees'] is None else f'{text} ({record["nees"]:.1f})'


def markdown(report: dict[str, Any]) -> str:
    """Return the report as a table."""
    facts = report['machine']
    kind = 'Test' if report['test'] else 'Development'
    records = {(of['group'], of['name']): of for of in report['rows']}
    rows, lights = (list(dict.fromkeys(keys)) for keys in zip(*records, strict=True))
    lines = [
        f'{report["method"]}, family {report["family"]}, setting `{report["setting"]}`. {kind} '
        f'seeds: {", ".join(map(str, report["seeds"]))}. {facts["processor"]}, {facts["cores"]} '
        f'cores, Python {facts["python"]}, numpy {facts["numpy"]}, OpenCV {facts["opencv"]}.',
        '',
        f'| right of N (NEES) | N | {" | ".join(lights)} | s |',
        '|---' * (len(lights) + 3) + '|',
    ]
    for row in rows:
        of_row = [records[row, light] for light in lights]
        cells = ' | '.join(map(cell_text, of_row))
        slowest = max(of['seconds'] for of in of_row)
        lines.append(f'| {row} | {of_row[0]["expected"]} | {cells} | {slowest:.2f} |')
    sums = [sum(of[name] for of in report['rows']) for name in ('right', 'expected')]
    false = [sum(of[name] for of in report['rows']) for name in ('wrong', 'false_positives')]
    lines += ['', '{} of {} right, {} wrong, {} false.'.format(*sums, *false)]
    return '\n'.join(lines)


def parser() -> argparse.ArgumentParser:
    """Return what can be chosen."""
    made = argparse.ArgumentParser(
        description=__doc__.split('\n\n')[0],
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    made.add_argument('--detector', choices=DETECTOR_NAMES, default='ring')
    made.add_argument('--family', choices=FAMILY_NAMES, default='metashape12')
    made.add_argument('--ahf', action='store_true', help='search for filters, N being given')
    made.add_argument('--setting', choices=tuple(SETTINGS), default='usual')
    made.add_argument('--group', choices=tuple(GROUPS), default='light')
    every = tuple(row for group in GROUPS.values() for row in group.rows)
    made.add_argument('--rows', nargs='+', choices=every, help='of the group; default: all')
    made.add_argument('--lights', nargs='+', choices=LIGHT_NAMES, help='default: of the group')
    made.add_argument('--targets', type=int, default=SceneSettings().targets)
    made.add_argument('--seeds', nargs='+', type=int, default=[FIRST_TEST_SEED])
    add_output(made)
    return made


def chosen(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Return the options, with the rows and lights of the group where none are given."""
    made = parser()
    options = made.parse_args(arguments)
    group = GROUPS[options.group]
    options.rows = options.rows or list(group.rows)
    options.lights = options.lights or list(group.lights)
    if foreign := [row for row in options.rows if row not in group.rows]:
        made.error(f'rows has {foreign[0]!r}, accepted are those of the group {options.group!r}')
    return options


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print."""
    options = chosen(arguments)
    try:
        test = are_tests(options.seeds)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    report: dict[str, Any] = {
        'method': options.detector + (' with AHF' if options.ahf else ''),
        'family': options.family,
        'setting': options.setting,
        'group': options.group,
        'seeds': options.seeds,
        'test': test,
        'machine': machine(),
    }
    report['rows'] = [row.record() for row in measure(options)]
    publish(report, markdown(report), options.output)
    return 0


if __name__ == '__main__':
    sys.exit(main())
