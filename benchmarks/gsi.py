"""Point-distributed targets of GSI: views, sizes, centres, lights, AHF, time and false positives.

The first tables follow Wang et al., Remote Sens. 2022, 14, 5377: twenty targets in 4288 x 2848 px
at their scale (dots of 6 mm are 5.1 px there) by angle of view (Figures 6 and 12), and targets of
3 mm and of mixed sizes (Tables 7 and 8). The detector `gsi_published`, which is their method,
stands beside `gsi` in every table. Recall counts distinct IDs within 5 px of their targets; seeds
from 101 on are for tests, those below for development.

    python -m benchmarks.gsi [--tables views sizes ...] [--seeds 101] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rich.console import Console
from rich.progress import track

from ahf_ros.detectors import create_detector
from ahf_ros.detectors.contract import Detector
from ahf_ros.evaluation import score
from ahf_ros.interchange.image_files import read_image
from ahf_ros.session import identify
from ahf_ros.synthetic.scene import SceneSettings, render
from ahf_ros.target import TrueTarget
from benchmarks.dot_patterns import dot_grid
from benchmarks.filter import machine
from benchmarks.identification import FIRST_TEST_SEED, Row
from support import PHOTOS

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

DETECTORS = ('gsi', 'gsi_published')

Scene = tuple[np.ndarray, Sequence[TrueTarget]]
Case = tuple[str, Callable[[int], Scene]]
"""A name, and what makes the image and its truth from a seed."""


def rendered(settings: SceneSettings) -> Callable[[int], Scene]:
    """Return what renders a scene with a seed."""

    def make(seed: int) -> Scene:
        rendering = render(replace(settings, seed=seed))
        return rendering.image, rendering.targets

    return make


def views() -> Iterator[Case]:
    """Yield twenty targets of 6 mm by angle of view."""
    for tilt in (0, 10, 20, 30, 40, 50, 60, 65, 70, 75, 80):
        yield f'{tilt} deg', rendered(replace(PAPER, tilt=float(tilt)))


def sizes() -> Iterator[Case]:
    """Yield targets of 3 mm and of mixed sizes by angle of view."""
    for name, changes in (
        ('3 mm', {'dot_radius': PAPER.dot_radius / 2}),
        ('3 mm, at half the distance', {}),
        ('3, 6 and 12 mm', {'sizes': '0.5, 1, 2'}),
    ):
        for tilt in (0.0, 30.0, 60.0):
            yield f'{name}, {tilt:.0f} deg', rendered(replace(PAPER, tilt=tilt, **changes))


def centres() -> Iterator[Case]:
    """Yield clean light and dots of 10 px."""
    for polarity, tilt in (('dark', 0.0), ('bright', 0.0), ('dark', 45.0)):
        scene = replace(LARGE, polarity=polarity, tilt=tilt, focal_length=3.0, targets=40)
        yield f'{polarity}, {tilt:.0f} deg', rendered(scene)


def lights() -> Iterator[Case]:
    """Yield projected light and hard shadow."""
    for light in ('stripe', 'lattice', 'fringe', 'shadow'):
        for ambient in (0.3, 0.12, 0.04):
            scene = replace(LARGE, light=light, ambient=ambient)
            yield f'{light} {ambient:g}', rendered(scene)


def filtered() -> Iterator[Case]:
    """Yield stripes for the search of filters."""
    for ambient in (0.3, 0.12, 0.04):
        scene = replace(LARGE, light='stripe', ambient=ambient, targets=20)
        yield f'stripe {ambient:g}', rendered(replace(scene, width=2400, height=1600))


def texture(seed: int) -> Scene:
    """Return noise of all wavelengths, with edges of any strength."""
    generator = np.random.default_rng(seed)
    image = np.zeros((1200, 1600))
    for width in (1, 2, 4, 8, 16):
        noise = cv2.GaussianBlur(generator.normal(size=image.shape), (0, 0), width)
        image += np.where(noise > noise.std(), 1.0, 0.0) * generator.uniform(0.3, 1)
    return (40 + 200 * image / image.max()).astype(np.uint8), ()


def photograph(path: Path) -> Callable[[int], Scene]:
    """Return what reads a photograph, which shows targets of another kind only."""
    return lambda _: (read_image(path), ())


def without_targets() -> Iterator[Case]:
    """Yield images that show no target of GSI."""
    yield 'regular grid of 2,000 dots', lambda seed: (dot_grid(seed), ())
    for light in ('lattice', 'dense_lattice'):
        yield f'{light} 0.3', rendered(replace(LARGE, targets=0, light=light))
    yield '100 distractors', rendered(replace(LARGE, targets=0, distractors=100))
    for number in range(10):
        yield f'texture {number}', lambda seed, number=number: texture(100 * seed + number)
    for path in sorted((PHOTOS / 'panel').glob('*.png')) if PHOTOS.exists() else ():
        yield f'photograph {path.stem}', photograph(path)


TABLES = {
    'views': ('Twenty targets of 6 mm by angle of view (Figures 6 and 12)', views),
    'sizes': ('Targets of 3 mm and of mixed sizes (Tables 7 and 8)', sizes),
    'centres': ('Centres in clean light, dots of 10 px', centres),
    'lights': ('54 targets in 3984 x 2656 px, dots of 10 px, by light', lights),
    'ahf': ('`gsi_published` without AHF and with it, under stripes', filtered),
    'no targets': ('Images without targets', without_targets),
}


def timed(detector: Detector, image: np.ndarray, expected: int = 0) -> tuple[Any, float]:
    """Return what is identified, driven by AHF where a number is expected, and the time, s."""
    started = time.perf_counter()
    found = identify(image, detector=detector, expected_targets=expected).targets
    return found, time.perf_counter() - started


def measured(name: str, cases: Iterator[Case], seeds: Sequence[int]) -> dict[str, list[Row]]:
    """Return the rows of a table, by detector."""
    columns = ('gsi_published', 'gsi_published with AHF') if name == 'ahf' else DETECTORS
    rows: dict[str, list[Row]] = {column: [] for column in columns}
    made = {column: create_detector(column.split()[0], family='gsi') for column in columns}
    for detector in made.values():
        detector(render(replace(LARGE, width=600, height=600, targets=1)).image)  # makes tables
    for case, make in track(list(cases), name, console=Console(stderr=True)):
        for column in columns:
            rows[column].append(Row(name, case))
        for seed in seeds:
            image, truth = make(seed)
            for column, detector in made.items():
                expected = len(truth) if column.endswith('AHF') else 0
                rows[column][-1].add(image, truth, timed(detector, image, expected))
    return rows


def speed(seed: int, rounds: int = 3) -> list[dict[str, Any]]:
    """Return the times of `gsi` and `ring` on 60 targets in images of one size, in turns."""
    rows = []
    for light in ('normal', 'stripe'):
        shown = replace(LARGE, targets=60, light=light, seed=seed)
        rings = replace(shown, family='metashape12', dot_radius=20.0)
        runs = [(create_detector(family=scene.family), render(scene)) for scene in (shown, rings)]
        times: list[list[float]] = [[], []]
        for _ in range(rounds + 1):
            for (detector, rendering), of_one in zip(runs, times, strict=True):
                started = time.process_time()
                found = detector(rendering.image)
                of_one.append(time.process_time() - started)
        right = [score(rendering, detector(rendering.image)).right for detector, rendering in runs]
        own, other = (min(of_one[1:]) for of_one in times)
        rows.append({'name': light, 'right': right, 'gsi': own, 'ring': other})
        del found
    return rows


def markdown(rows: dict[str, list[Row]]) -> str:
    """Return a table: recall, wrong and false reports, RMSE, s, of each detector."""
    cells = ('d of N', 'wrong', 'false', 'RMSE XY', 's')
    lines = [
        '| | '
        + ' | '.join(
            f'{name}: {cells[0]}' if cell == cells[0] else cell for name in rows for cell in cells
        )
        + ' |'
    ]
    lines.append('|---' * (1 + len(cells) * len(rows)) + '|')
    for of_case in zip(*rows.values(), strict=True):
        line = [of_case[0].name]
        for row in of_case:
            of = row.record()
            error = '-' if of['rmse_xy'] is None else f'{of["rmse_xy"]:.3f}'
            counts = f'{of["right"]} of {of["expected"]}'
            line += [counts, of['wrong'], of['false_positives'], error, f'{of["seconds"]:.2f}']
        lines.append(f'| {" | ".join(map(str, line))} |')
    return '\n'.join(lines)


def parser() -> argparse.ArgumentParser:
    """Return the options."""
    made = argparse.ArgumentParser(
        description=__doc__.split('\n\n')[0],
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    every = (*TABLES, 'speed')
    made.add_argument('--tables', nargs='+', choices=every, default=every)
    made.add_argument('--seeds', nargs='+', type=int, default=[FIRST_TEST_SEED])
    made.add_argument('--json', type=Path, metavar='FILE', help='also write a JSON object')
    return made


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print as Markdown."""
    options = parser().parse_args(arguments)
    facts, seeds = machine(), ', '.join(map(str, options.seeds))
    report: dict[str, Any] = {'seeds': options.seeds, 'machine': facts, 'tables': {}}
    print(
        f'Seeds: {seeds}. {facts["processor"]}, {facts["cores"]} cores, Python {facts["python"]}, '
        f'numpy {facts["numpy"]}, OpenCV {facts["opencv"]}. RMSE in px.',
        flush=True,
    )
    for name in options.tables:
        if name == 'speed':
            report['speed'] = rows = speed(options.seeds[0])
            print('\n## Time for 60 targets in 3984 x 2656 px, processor time\n')
            print(
                '| light | `gsi` right | s | `ring` right | s | ratio |\n|---|---|---|---|---|---|'
            )
            for row in rows:
                right, ratio = row['right'], row['gsi'] / row['ring']
                print(
                    f'| {row["name"]} | {right[0]} | {row["gsi"]:.2f} | {right[1]} '
                    f'| {row["ring"]:.2f} | {ratio:.2f} |',
                    flush=True,
                )
            continue
        title, cases = TABLES[name]
        table = measured(name, cases(), options.seeds)
        print(f'\n## {title}\n\n{markdown(table)}', flush=True)
        report['tables'][name] = {
            column: [row.record() for row in rows] for column, rows in table.items()
        }
    if options.json:
        options.json.write_text(json.dumps(report, indent=1))
    return 0


if __name__ == '__main__':
    sys.exit(main())
