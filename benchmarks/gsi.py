"""Point-distributed targets of GSI: views, sizes, centres, lights, AHF, time and false positives.

The first tables follow Wang et al., Remote Sens. 2022, 14, 5377: twenty targets in 4288 x 2848 px
at their scale (dots of 6 mm are 5.1 px there) by angle of view (Figures 6 and 12), and targets of
3 mm and of mixed sizes (Tables 7 and 8). The detector `gsi_published`, which is their method,
stands beside `gsi` in every table. Recall counts distinct IDs within 5 px of their targets; seeds
from 101 on are for tests, those below for development.

    python -m benchmarks.gsi [--tables views sizes ...] [--seeds 101] [--json FILE]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros.families import create_detector
from ahf_ros.files.image_files import read_image
from ahf_ros.scenes.evaluation import score
from ahf_ros.scenes.scene import SceneSettings, render
from benchmarks import report
from benchmarks.report import number, table
from benchmarks.rows import Case, Row, Scene, detector, measured, rendered
from benchmarks.speed import in_turns
from support import PHOTOS
from support.pictures.textures import dot_grid, rough_image, text_page, weave

PAPER = SceneSettings(
    family='gsi',
    width=4288,
    height=2848,
    targets=20,
    dot_radius=5.1,
    polarity='bright',
    focal_length=8.0,
)
"""Targets of 6 mm as Wang et al. photographed them; so far away, all are seen at about one angle.

Table 3 has the scale: 37.4 px from B to C, where dots of 6 mm are 22 mm apart.
"""

LARGE = SceneSettings(family='gsi', dot_radius=10.0)
"""54 targets in 3984 x 2656 px."""

METHODS = {name: detector(name) for name in ('gsi', 'gsi_published')}
DRIVEN = {
    'gsi_published': METHODS['gsi_published'],
    'gsi_published with AHF': detector('gsi_published', ahf=True),
}


def without_targets() -> Iterator[Case]:
    """Yield images that show no target of GSI."""

    def case(name: str, make: Callable[[int], Scene]) -> Case:
        return Case('no targets', name, make, 'gsi')

    yield case('regular grid of 2,000 dots', lambda seed: (dot_grid(seed), ()))
    for light in ('lattice', 'dense_lattice'):
        scene = replace(LARGE, targets=0, light=light)
        yield rendered('no targets', f'{light} 0.3', scene)
    yield rendered('no targets', '100 distractors', replace(LARGE, targets=0, distractors=100))
    for count in range(10):
        yield case(f'texture {count}', partial(_drawn, rough_image, count))
    for count in range(4):
        yield case(f'page of print {count}', partial(_drawn, text_page, count))
        yield case(f'woven fibre {count}', partial(_drawn, weave, count))
    for path in sorted((PHOTOS / 'panel').glob('*.png')):
        yield case(f'photograph {path.stem}', partial(_photograph, path))


def _drawn(draw: Callable[[int], np.ndarray], count: int, seed: int) -> Scene:
    return draw(100 * seed + count), ()


def _photograph(path: Path, _: int) -> Scene:
    return read_image(path), ()


SEARCHED = replace(LARGE, light='stripe', targets=20, width=2400, height=1600)
"""Stripes for the search of filters."""

SIZES: dict[str, dict[str, Any]] = {
    '3 mm': {'dot_radius': PAPER.dot_radius / 2},
    '3 mm, at half the distance': {},
    '3, 6 and 12 mm': {'sizes': '0.5, 1, 2'},
}

TABLES = {
    'Twenty targets of 6 mm by angle of view (Figures 6 and 12)': [
        rendered('views', f'{tilt} deg', replace(PAPER, tilt=float(tilt)))
        for tilt in (0, 10, 20, 30, 40, 50, 60, 65, 70, 75, 80)
    ],
    'Targets of 3 mm and of mixed sizes (Tables 7 and 8)': [
        rendered('sizes', f'{name}, {tilt:.0f} deg', replace(PAPER, tilt=tilt, **changes))
        for name, changes in SIZES.items()
        for tilt in (0.0, 30.0, 60.0)
    ],
    'Centres in clean light, dots of 10 px': [
        rendered(
            'centres',
            f'{polarity}, {tilt:.0f} deg',
            replace(LARGE, polarity=polarity, tilt=tilt, focal_length=3.0, targets=40),
        )
        for polarity, tilt in (('dark', 0.0), ('bright', 0.0), ('dark', 45.0))
    ],
    '54 targets in 3984 x 2656 px, dots of 10 px, by light': [
        rendered('lights', f'{light} {ambient:g}', replace(LARGE, light=light, ambient=ambient))
        for light in ('stripe', 'lattice', 'fringe', 'shadow')
        for ambient in (0.3, 0.12, 0.04)
    ],
    '`gsi_published` without AHF and with it, under stripes': [
        rendered('ahf', f'stripe {ambient:g}', replace(SEARCHED, ambient=ambient))
        for ambient in (0.3, 0.12, 0.04)
    ],
    'Images without targets': list(without_targets()),
}
"""Cases by the titles of their tables; the names of tables are their groups."""


def speed(seed: int) -> list[dict[str, Any]]:
    """Return the times of `gsi` and `ring` on 60 targets in images of one size, in turns."""
    rows = []
    for light in ('normal', 'stripe'):
        shown = replace(LARGE, targets=60, light=light, seed=seed)
        rings = replace(shown, family='metashape12', dot_radius=20.0)
        works, right = [], []
        for rendering in map(render, (shown, rings)):
            made = create_detector(family=rendering.settings.family)
            right.append(score(rendering, made(rendering.image)).right)
            works.append(partial(made, rendering.image))
        own, other = in_turns(works, clock=time.process_time)
        rows.append({'name': light, 'right': right, 'gsi': own, 'ring': other})
    return rows


def speed_lines(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return the table of times."""
    cells = (
        (
            *(row['name'], row['right'][0], number(row['gsi'], 2)),
            *(row['right'][1], number(row['ring'], 2), number(row['gsi'] / row['ring'], 2)),
        )
        for row in rows
    )
    return table(('light', '`gsi` right', 's', '`ring` right', 's', 'ratio'), cells)


def markdown(rows: dict[str, list[Row]]) -> str:
    """Return a table: recall, wrong and false reports, RMSE, s, of each detector."""
    columns = ('d of N', 'wrong', 'false', 'RMSE XY', 's')
    head = [''] + [
        f'{name}: {column}' if column == columns[0] else column
        for name in rows
        for column in columns
    ]
    lines = []
    for of_case in zip(*rows.values(), strict=True):
        line = [of_case[0].name]
        for of in (row.record() for row in of_case):
            counts = f'{of["right"]} of {of["expected"]}'
            errors = number(of['rmse_xy'], 3), number(of['seconds'], 2)
            line += [counts, of['wrong'], of['false_positives'], *errors]
        lines.append(line)
    return '\n'.join(table(head, lines))


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print as Markdown."""
    tables = {cases[0].group: (title, cases) for title, cases in TABLES.items()}
    every = (*tables, 'speed')
    made = report.parser(__doc__)
    made.add_argument('--tables', nargs='+', choices=every, default=every)
    options = report.parsed(made, arguments)
    figures = report.about(options.seeds, tables={})
    print(report.about_text(figures), 'RMSE in px.', flush=True)
    for name in options.tables:
        if name == 'speed':
            figures['speed'] = speed(options.seeds[0])
            print('\n## Time for 60 targets in 3984 x 2656 px, processor time\n')
            print('\n'.join(speed_lines(figures['speed'])), flush=True)
        else:
            title, cases = tables[name]
            methods = DRIVEN if name == 'ahf' else METHODS
            rows = list(measured(cases, options.seeds, methods))
            by_method = {method: [row[method] for row in rows] for method in methods}
            print(f'\n## {title}\n\n{markdown(by_method)}', flush=True)
            figures['tables'][name] = {
                method: [row.record() for row in of] for method, of in by_method.items()
            }
    report.write(figures, options)
    return 0


if __name__ == '__main__':
    sys.exit(main())
