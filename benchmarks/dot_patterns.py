"""Time and reports of `gsi` and `dots` in images of many dots that belong to no target.

A regular grid of 2,000 printed dots and lattices of projected spots, in 3984 x 2656 px.

    python -m benchmarks.dot_patterns [--seeds 101] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ahf_ros.detectors import create_detector
from ahf_ros.synthetic.scene import SceneSettings, render
from benchmarks.filter import machine
from benchmarks.identification import FIRST_TEST_SEED

FAMILIES = ('gsi', 'dots')
SIZE = (3984, 2656)
COLUMNS, ROWS = 50, 40
_PITCH = (64, 60)  # of the grid, px
_RADIUS = 8  # of its dots, px


def dot_grid(seed: int) -> np.ndarray:
    """Return an image of a regular grid of 2,000 dots, slightly turned and foreshortened."""
    generator = np.random.default_rng(seed)
    width, height = SIZE
    image = np.full((height, width), 215, np.uint8)
    turn = np.sin(np.deg2rad(generator.uniform(0, 5)))
    for column in range(COLUMNS):
        for row in range(ROWS):
            x, y = 300 + _PITCH[0] * column, 100 + _PITCH[1] * row
            centre = (x - 0.3 * turn * y, y + 0.02 * turn * x)
            place = tuple(round(16 * float(value)) for value in centre)
            cv2.circle(image, place, 16 * _RADIUS, 40, -1, cv2.LINE_AA, shift=4)
    noise = generator.normal(0, 2, image.shape)
    return np.clip(cv2.GaussianBlur(image, (0, 0), 0.8) + noise, 0, 255).astype(np.uint8)


def images(seed: int) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the name of each pattern, and its image."""
    yield f'regular grid of {COLUMNS * ROWS:,} dots', dot_grid(seed)
    for light in ('lattice', 'dense_lattice'):
        for ambient in (0.3, 0.04):
            scene = SceneSettings(family='gsi', targets=0, light=light, ambient=ambient, seed=seed)
            yield f'{light} {ambient:g}', render(scene).image


def measured(seeds: Sequence[int]) -> Iterator[dict[str, Any]]:
    """Yield the reports of each family in each pattern, and the longest processor time."""
    detectors = {family: create_detector(family=family) for family in FAMILIES}
    rows: dict[str, dict[str, Any]] = {}
    for seed in seeds:
        for name, image in images(seed):
            row = rows.setdefault(name, {'name': name})
            for family, detector in detectors.items():
                started = time.process_time()
                found = len(detector(image))
                duration = time.process_time() - started
                of = row.setdefault(family, {'reports': 0, 'seconds': 0.0})
                of.update(reports=of['reports'] + found, seconds=max(of['seconds'], duration))
    yield from rows.values()


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return the rows as Markdown."""
    lines = [
        f'| pattern | {" | ".join(f"`{family}`: reports | s" for family in FAMILIES)} |',
        '|---' * (1 + 2 * len(FAMILIES)) + '|',
    ]
    for row in rows:
        cells = [f'{row[it]["reports"]} | {row[it]["seconds"]:.2f}' for it in FAMILIES]
        lines.append(f'| {row["name"]} | {" | ".join(cells)} |')
    return '\n'.join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--seeds', nargs='+', type=int, default=[FIRST_TEST_SEED])
    parser.add_argument('--json', type=Path, metavar='FILE', help='also write a JSON object')
    options = parser.parse_args(arguments)
    rows = list(measured(options.seeds))
    print(table(rows))
    if options.json:
        report = {'seeds': options.seeds, 'machine': machine(), 'rows': rows}
        options.json.write_text(json.dumps(report, indent=1))


if __name__ == '__main__':
    main()
