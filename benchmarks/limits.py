"""Where the light ends: small, oblique, blurred and shifted targets, without a search.

Rows are views and light, columns are patterns. A cell has the targets with the right ID, of N,
then wrong IDs and false positives where there are any, and the NEES of the right ones: 2 on
average where covariances are right. Groups of rows are `light`; `edge shift`, prints whose ink is
larger or smaller on every edge, in half of the image as well; and `exposure`, photographs that are
exposed several times too long. The scenes are those of `benchmarks.identification` and, in two
other settings, scenes that nothing in the package was fitted to. `other` has finer patterns in
another direction, a wider lens, more noise, and another gamma; `strange` has coarser patterns, a
long lens with distortion, a noisy camera with a flat gamma, gray ink on coarse paper, and targets
on white cards before a darker wall. `linear` is an industrial camera, whose gray values are light,
and black ink. Seeds from 101 on are for tests.

    python -m benchmarks.limits [--detector ring] [--family gsi] [--setting other]
        [--group 'edge shift'] [--rows 'radius 6, 0.12' ...] [--lights stripe ...] [--seeds 101]
        [--output FILE]
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Any

from ahf_ros.families import DETECTOR_NAMES
from ahf_ros.prints.families import FAMILY_NAMES
from ahf_ros.scenes.patterns import LIGHT_NAMES
from ahf_ros.scenes.scene import SceneSettings, render
from benchmarks import report
from benchmarks.report import number
from benchmarks.rows import Case, Scene, detector, measured
from support.pictures.bent import DOT_SHARES

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


GROUPS = {
    'light': (_VIEWS, ('stripe', 'fine_stripe', 'lattice', 'dense_lattice')),
    'edge shift': (_SHIFTS | _HALVES, ('normal', 'fringe', 'stripe', 'lattice')),
    'exposure': (_EXPOSURES, ('normal',)),
}
"""By its name, what differs in each row of a table from a scene of dots of 20 px, and the lights
that are its columns."""

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
    'linear': {'gamma': 1.0, 'black': 0.04},
}
"""Settings of the renderer; nothing in the package was fitted to `other` and `strange`."""


def scene(options: argparse.Namespace, row: str, light: str, seed: int) -> SceneSettings:
    """Return the scene of a row, a light and a seed."""
    changes = GROUPS[options.group][0][row] | SETTINGS[options.setting]
    radius = changes.get('dot_radius', SceneSettings().dot_radius)
    changes['dot_radius'] = radius * DOT_SHARES.get(options.family, 1.0)
    return SceneSettings(
        family=options.family, targets=options.targets, light=light, seed=seed, **changes
    )


def case(options: argparse.Namespace, row: str, light: str) -> Case:
    """Return a cell of the table; in some, each half of an image has its own shift."""

    def make(seed: int) -> Scene:
        settings = scene(options, row, light, seed)
        rendering = render(settings)
        if row in _HALVES:
            other = render(replace(settings, edge_shift=-settings.edge_shift))
            right = slice(settings.width // 2, None)
            rendering.image[:, right] = other.image[:, right]
        return rendering.image, rendering.targets

    return Case(row, light, make, options.family)


def cells(options: argparse.Namespace) -> list[tuple[str, str]]:
    """Return rows and lights of a group: those that are asked for, or all."""
    rows, lights = GROUPS[options.group]
    if foreign := [row for row in options.rows or () if row not in rows]:
        raise report.Unacceptable(
            f'rows has {foreign[0]!r}, accepted are those of the group {options.group!r}'
        )
    return list(product(options.rows or rows, options.lights or lights))


def measure(options: argparse.Namespace) -> report.Report:
    """Return the figures of the chosen rows under the chosen lights."""
    run = detector(options.detector, ahf=options.ahf)
    cases = [case(options, *cell) for cell in cells(options)]
    measures = measured(cases, options.seeds, {'': run})
    return {
        'method': options.detector + (' with AHF' if options.ahf else ''),
        **{name: getattr(options, name) for name in ('family', 'setting', 'group')},
        'rows': [by[''].record() for by in measures],
    }


def cell_text(record: dict[str, Any]) -> str:
    """Return a cell of the table."""
    text = f'{record["right"]}'
    if record['wrong'] or record['false_positives']:
        text += f', {record["wrong"]} wrong, {record["false_positives"]} false'
    return text if record['nees'] is None else f'{text} ({record["nees"]:.1f})'


def markdown(figures: report.Report) -> str:
    """Return the report as a table."""
    records = {(of['group'], of['name']): of for of in figures['rows']}
    names, lights = (list(dict.fromkeys(keys)) for keys in zip(*records, strict=True))
    rows = []
    for name in names:
        of_row = [records[name, light] for light in lights]
        slowest = number(max(of['seconds'] for of in of_row), 2)
        rows.append((name, of_row[0]['expected'], *map(cell_text, of_row), slowest))
    lines = [
        f'{figures["method"]}, family {figures["family"]}, setting `{figures["setting"]}`. '
        + report.about_text(figures),
        '',
        *report.table(('right of N (NEES)', 'N', *lights, 's'), rows),
        '',
        report.summary(figures['rows']),
    ]
    return '\n'.join(lines)


def parser() -> argparse.ArgumentParser:
    """Return what can be chosen."""
    made = report.parser(__doc__)
    made.add_argument('--detector', choices=DETECTOR_NAMES, default='ring')
    made.add_argument('--family', choices=FAMILY_NAMES, default='metashape12')
    made.add_argument('--ahf', action='store_true', help='search for filters, N being given')
    made.add_argument('--setting', choices=tuple(SETTINGS), default='usual')
    made.add_argument('--group', choices=tuple(GROUPS), default='light')
    every = tuple(row for rows, _ in GROUPS.values() for row in rows)
    made.add_argument('--rows', nargs='+', choices=every, help='of the group; default: all')
    made.add_argument('--lights', nargs='+', choices=LIGHT_NAMES, help='default: of the group')
    made.add_argument('--targets', type=int, default=SceneSettings().targets)
    return made


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print."""
    return report.run(parser(), measure, markdown, arguments)


if __name__ == '__main__':
    sys.exit(main())
