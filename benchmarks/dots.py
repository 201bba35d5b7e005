"""Rings of dots: how many are identified, how exactly and how fast, by every way of doing it.

The detectors `dots` and `dots_published` identify the same rendered scenes, with AHF and without
it. A cell has the targets with the right ID, wrong IDs and false positives, and the RMSE of the
centres in px. Then follow images without targets, the reliability of the confidence, and the time
that `dots` takes beside `ring` in the same run. Seeds from 101 on are for tests: nothing in the
package was chosen by looking at them.

    python -m benchmarks.dots [--parts scenes ...] [--seeds 101] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track

from ahf_ros.detectors import DetectorSettings, create_detector
from ahf_ros.session import identify
from ahf_ros.synthetic.scene import SceneSettings, render
from benchmarks.dots_confidence import PER_RADIUS, reliability
from benchmarks.filter import machine
from benchmarks.identification import FIRST_TEST_SEED, Row
from benchmarks.speed import seconds
from benchmarks.textures import SIZE, lookalikes, textured_image

METHODS = (
    ('dots', False),
    ('dots_published', False),
    ('dots', True),
    ('dots_published', True),
)
"""Detectors, without and with AHF."""

WIDTHS = (24, 29, 36, 48, 60, 90)
"""Of targets in clean light, px."""

PARTS = ('scenes', 'textures', 'confidence', 'time')
TEXTURES, LOOKALIKES = 800, 100
FIRST_TEXTURE = 100_000
"""Seed of the first textured image; those of development are below."""

ROUNDS = 5
FAMILY = DetectorSettings(family='dots')
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
    every = list(scenes())
    records = []
    for group, name, scene in track(every, 'scenes', console=Console(stderr=True)):
        rows = {method: Row(group, name) for method in methods}
        for seed in seeds:
            rendering = render(replace(scene, seed=seed))
            truth = rendering.targets
            for (detector, with_ahf), row in rows.items():
                expected = len(truth) if with_ahf else 0
                found = identify(
                    rendering.image,
                    detector=create_detector(detector, settings=FAMILY),
                    expected_targets=expected,
                )
                row.add(rendering.image, truth, (found.targets, found.filter.duration))
        records += [
            {'detector': detector, 'ahf': with_ahf, **row.record()}
            for (detector, with_ahf), row in rows.items()
        ]
    return records


def scene_table(records: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Yield the lines of the table of scenes."""
    methods = list(dict.fromkeys((of['detector'], of['ahf']) for of in records))
    names = [name + (' with AHF' if with_ahf else '') for name, with_ahf in methods]
    yield f'| | | N | {" | ".join(names)} | NEES of dots | s |'
    yield '|---' * (len(names) + 5) + '|'
    for start in range(0, len(records), len(methods)):
        row = records[start : start + len(methods)]
        cells = [
            f'{of["right"]}, {of["wrong"]} wrong, {of["false_positives"]} false'
            + ('' if of['rmse_xy'] is None else f' ({of["rmse_xy"]:.3f})')
            for of in row
        ]
        nees = '-' if row[0]['nees'] is None else f'{row[0]["nees"]:.1f}'
        head = (row[0]['group'], row[0]['name'], str(row[0]['expected']))
        duration = f'{row[0]["seconds"]:.2f}'
        yield f'| {" | ".join((*head, *cells, nees, duration))} |'


def reports(images: Callable[[int], np.ndarray], count: int) -> dict[str, int]:
    """Return the number of targets reported in images without any, by detector."""
    detectors = [create_detector(name, settings=FAMILY) for name in ('dots', 'dots_published')]
    found = {detector.name: 0 for detector in detectors}
    seeds = range(FIRST_TEXTURE, FIRST_TEXTURE + count)
    for seed in track(seeds, images.__name__, console=Console(stderr=True)):
        image = images(seed)
        for detector in detectors:
            found[detector.name] += len(detector(image))
    return found


def times(seed: int) -> Iterator[dict[str, Any]]:
    """Yield the median times of `dots` and `ring` on 60 targets in 10.6 MP, in turns."""
    for light in ('normal', 'stripe'):
        jobs = []
        for family in ('dots', 'metashape12'):
            scene = SceneSettings(family=family, targets=60, light=light, seed=seed)
            detector = create_detector(family=family)
            image = render(scene).image
            detector(image[:400, :400])  # tables that are made once are not timed
            jobs.append((detector, image, []))
        for _ in range(ROUNDS):
            for detector, image, durations in jobs:
                durations.append(seconds(lambda run=detector, of=image: run(of))[0])
        own, others = (median(durations) for _, _, durations in jobs)
        yield {'light': light, 'dots': own, 'ring': others, 'ratio': own / others}


def lines(report: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of the report as Markdown."""
    facts = report['machine']
    kind = 'Test' if report['test'] else 'Development'
    yield (
        f'Rings of dots, {_BASE.width} x {_BASE.height} px. {kind} seeds: '
        f'{", ".join(map(str, report["seeds"]))}. {facts["processor"]}, {facts["cores"]} cores, '
        f'Python {facts["python"]}, numpy {facts["numpy"]}, OpenCV {facts["opencv"]}.'
    )
    if 'rows' in report:
        yield from ('', 'Targets of 90 px width where the row does not say otherwise.', '')
        yield from scene_table(report['rows'])
    if 'textures' in report:
        width, height = SIZE
        for what, part in (
            (f'{TEXTURES} textured images', 'textures'),
            (f'{LOOKALIKES} images of rings in rings with dots', 'lookalikes'),
        ):
            told = ', '.join(f'`{name}` {count}' for name, count in report[part].items())
            yield from ('', f'Reports in {what} of {width} x {height} px: {told}.')
    if 'confidence' in report:
        yield from ('', 'Of the readings of `dots` with a confidence in the given range:', '')
        yield from report['confidence']
    if 'times' in report:
        yield from ('', '60 targets in 3984 x 2656 px, median time in s:', '')
        yield from ('| light | `dots` | `ring` | ratio |', '|---|---|---|---|')
        for of in report['times']:
            numbers = f'{of["dots"]:.2f} | {of["ring"]:.2f} | {of["ratio"]:.2f}'
            yield f'| {of["light"]} | {numbers} |'


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__.split('\n\n')[0],
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument('--parts', nargs='+', choices=PARTS, default=PARTS)
    parser.add_argument('--seeds', nargs='+', type=int, default=[FIRST_TEST_SEED])
    parser.add_argument(
        '--no-ahf', dest='ahf', action='store_false', help='scenes without AHF only, much faster'
    )
    parser.add_argument(
        '--json', type=Path, metavar='FILE', help='also write a JSON object; other parts stay'
    )
    options = parser.parse_args()
    seeds = options.seeds
    report: dict[str, Any] = {}
    if options.json and options.json.exists():
        report = json.loads(options.json.read_text())
    report.update(seeds=seeds, machine=machine(), test=min(seeds) >= FIRST_TEST_SEED)
    if 'time' in options.parts:
        report['times'] = list(times(seeds[0]))
    if 'scenes' in options.parts:
        methods = [it for it in METHODS if options.ahf or not it[1]]
        report['rows'] = scene_rows(seeds, methods)
    if 'textures' in options.parts:
        report['textures'] = reports(textured_image, TEXTURES)
        report['lookalikes'] = reports(lookalikes, LOOKALIKES)
    if 'confidence' in options.parts:
        report['confidence'] = list(reliability(seeds[:1]))
    if options.json:
        options.json.write_text(json.dumps(report, indent=1))
    print('\n'.join(lines(report)))


if __name__ == '__main__':
    main()
