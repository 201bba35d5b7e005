"""Rings of dots: how many are identified, how exactly and how fast, by every way of doing it.

The detectors `dots` and `dots_published` identify the same rendered scenes, with AHF and without
it. A cell has the targets with the right ID, wrong IDs and false positives, and the RMSE of the
centres in px. Then follow images without targets, the reliability of the confidence, and the time
that `dots` takes beside `ring` in the same run. Seeds from 101 on are for tests: nothing in the
package was chosen by looking at them.

    python -m benchmarks.dots [--parts scenes ...] [--seeds 101] [--json FILE]
"""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ahf_ros.families import create_detector
from ahf_ros.scenes.scene import SceneSettings, render
from benchmarks import report
from benchmarks.confidence import reliability
from benchmarks.report import number, table
from benchmarks.rows import detector, measured, rendered
from benchmarks.speed import in_turns
from support.pictures.dot_conditions import PER_RADIUS
from support.pictures.textures import SIZE, lookalikes, textured_image

METHODS = (('dots', False), ('dots_published', False), ('dots', True), ('dots_published', True))
"""Detectors, without and with AHF."""

WIDTHS = (24, 29, 36, 48, 60, 90)
"""Of targets in clean light, px."""

PARTS = ('scenes', 'textures', 'confidence', 'time')
TEXTURES, LOOKALIKES = 800, 100
FIRST_TEXTURE = 100_000
"""Seed of the first textured image; those of development are below."""

ROUNDS = 5
_BASE = SceneSettings(family='dots', width=1600, height=1200, targets=30, dot_radius=14.0)


def scenes() -> Iterator[tuple[str, str, SceneSettings]]:
    """Yield group, name and scene of every row."""
    for width in WIDTHS:
        scene = replace(_BASE, dot_radius=width / PER_RADIUS, radius_spread=0.0)
        yield 'width', f'{width} px', scene
    for light in ('stripe', 'lattice', 'fringe', 'shadow'):
        for ambient in (0.3, 0.12, 0.04):
            yield 'light', f'{light} {ambient}', replace(_BASE, light=light, ambient=ambient)
    for light in ('stripe', 'lattice'):
        for ambient in (0.3, 0.12):
            scene = replace(_BASE, light=light, ambient=ambient, dot_radius=60 / PER_RADIUS)
            yield 'light, 60 px', f'{light} {ambient}', scene
    for tilt in (30.0, 45.0, 60.0, 70.0):
        yield 'tilt', f'{tilt:g} deg', replace(_BASE, tilt=tilt, focal_length=3.0, targets=20)
    for blur in (1.5, 2.0):
        yield 'blur', f'{blur} px', replace(_BASE, blur=blur, dot_radius=10.0)
    for electrons in (1000.0, 300.0):
        scene = replace(_BASE, full_well=electrons, dot_radius=10.0)
        yield 'noise', f'full well of {electrons:g} electrons', scene
    for light in ('normal', 'stripe', 'lattice'):
        yield 'bright', f'{light} 0.3', replace(_BASE, polarity='bright', light=light)
    for light in ('normal', 'stripe', 'lattice'):
        marks = replace(_BASE, targets=0, distractors=40, light=light)
        yield 'no targets', f'{light} 0.3', marks


def scene_rows(seeds: Sequence[int], methods: Sequence[tuple[str, bool]]) -> list[dict[str, Any]]:
    """Render and identify every scene with every seed, by some of the methods."""
    runs = {str(number): detector(name, ahf=ahf) for number, (name, ahf) in enumerate(methods)}
    cases = [rendered(*case) for case in scenes()]
    return [
        {'detector': name, 'ahf': ahf, **row.record()}
        for by_method in measured(cases, seeds, runs)
        for (name, ahf), row in zip(methods, by_method.values(), strict=True)
    ]


def scene_table(records: Sequence[dict[str, Any]]) -> list[str]:
    """Return the lines of the table of scenes."""
    methods = list(dict.fromkeys((of['detector'], of['ahf']) for of in records))
    names = [name + (' with AHF' if ahf else '') for name, ahf in methods]
    rows = []
    for start in range(0, len(records), len(methods)):
        of_case = records[start : start + len(methods)]
        first = of_case[0]
        cells = [
            f'{of["right"]}, {of["wrong"]} wrong, {of["false_positives"]} false'
            + ('' if of['rmse_xy'] is None else f' ({of["rmse_xy"]:.3f})')
            for of in of_case
        ]
        ends = number(first['nees'], 1), number(first['seconds'], 2)
        rows.append((first['group'], first['name'], first['expected'], *cells, *ends))
    return table(('', '', 'N', *names, 'NEES of dots', 's'), rows)


def reports(images: Callable[[int], np.ndarray], count: int) -> dict[str, int]:
    """Return the number of targets reported in images without any, by detector."""
    made = [create_detector(name, family='dots') for name in ('dots', 'dots_published')]
    found = {one.name: 0 for one in made}
    seeds = range(FIRST_TEXTURE, FIRST_TEXTURE + count)
    for seed in report.progress(seeds, images.__name__):
        image = images(seed)
        for one in made:
            found[one.name] += len(one(image))
    return found


def times(seed: int) -> Iterator[dict[str, Any]]:
    """Yield the median times of `dots` and `ring` on 60 targets in 10.6 MP, in turns."""
    for light in ('normal', 'stripe'):
        works = []
        for family in ('dots', 'metashape12'):
            scene = SceneSettings(family=family, targets=60, light=light, seed=seed)
            works.append(partial(create_detector(family=family), render(scene).image))
            works[-1]()  # tables that are made once are not timed
        own, others = in_turns(works, ROUNDS)
        yield {'light': light, 'dots': own, 'ring': others, 'ratio': own / others}


def markdown(figures: report.Report) -> str:
    """Return the report as a page."""
    size = f'{_BASE.width} x {_BASE.height} px'
    lines = [f'Rings of dots, {size}. {report.about_text(figures)}']
    if 'rows' in figures:
        lines += ['', 'Targets of 90 px width where the row does not say otherwise.', '']
        lines += scene_table(figures['rows'])
    if 'textures' in figures:
        width, height = SIZE
        for what, part in (
            (f'{TEXTURES} textured images', 'textures'),
            (f'{LOOKALIKES} images of rings in rings with dots', 'lookalikes'),
        ):
            told = ', '.join(f'`{name}` {count}' for name, count in figures[part].items())
            lines += ['', f'Reports in {what} of {width} x {height} px: {told}.']
    if 'confidence' in figures:
        lines += ['', 'Of the readings of `dots` with a confidence in the given range:', '']
        lines += figures['confidence']
    if 'times' in figures:
        names = ('dots', 'ring', 'ratio')
        rows = [(of['light'], *(number(of[it], 2) for it in names)) for of in figures['times']]
        lines += ['', '60 targets in 3984 x 2656 px, median time in s:', '']
        lines += table(('light', '`dots`', '`ring`', 'ratio'), rows)
    return '\n'.join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print; parts that an earlier JSON object has and that are not asked for stay."""
    made = report.parser(__doc__)
    made.add_argument('--parts', nargs='+', choices=PARTS, default=PARTS)
    made.add_argument(
        '--no-ahf', dest='ahf', action='store_false', help='scenes without AHF only, much faster'
    )
    options = report.parsed(made, arguments)
    seeds = options.seeds
    figures: report.Report = {}
    if options.json and options.json.exists():
        figures = json.loads(options.json.read_text())
    figures |= report.about(seeds)
    if 'time' in options.parts:
        figures['times'] = list(times(seeds[0]))
    if 'scenes' in options.parts:
        methods = [it for it in METHODS if options.ahf or not it[1]]
        figures['rows'] = scene_rows(seeds, methods)
    if 'textures' in options.parts:
        figures['textures'] = reports(textured_image, TEXTURES)
        figures['lookalikes'] = reports(lookalikes, LOOKALIKES)
    if 'confidence' in options.parts:
        figures['confidence'] = reliability('dots', seeds[:1])
    report.publish(figures, markdown(figures), options)


if __name__ == '__main__':
    main()
