"""What is identified in the pictures in a folder with one gate open; see `benchmarks.gates`.

    python -m benchmarks.opened_gate FOLDER [MODULE:NAME EXPRESSION]

A line of JSON comes for each picture as soon as it is identified, so that those that were done
count where an open gate takes too long.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.changed_constant import change

NEAR = 5.0
"""Largest distance of a target from its true place, px."""

Shown = tuple[str, float | None, float | None]
"""A target of a picture: its ID, or 'code' and its code, and its place, if that is known."""


def verdicts(targets: Sequence[Any], truth: Sequence[Shown]) -> tuple[set[int], int, int]:
    """Return which targets of the truth are right, and the numbers of wrong and false reports.

    A report is right if it has the ID of the nearest place, wrong with another one or again, and
    false farther away. Where places are not known it is right or false.
    """
    right: set[int] = set()
    wrong = false = 0
    for target in targets:
        if target.id < 0:
            continue
        names = {str(target.id), f'code {target.code}'}
        placed = [
            (((x - target.x) ** 2 + (y - target.y) ** 2) ** 0.5, index)
            for index, (_, x, y) in enumerate(truth)
            if x is not None and y is not None
        ]
        if placed:
            away, nearest = min(placed)
            if away > NEAR:
                false += 1
            elif truth[nearest][0] in names and nearest not in right:
                right.add(nearest)
            else:
                wrong += 1
        else:
            named = [index for index, (name, _, _) in enumerate(truth) if name in names]
            free = [index for index in named if index not in right]
            right.update(free[:1])
            false += not free
    return right, wrong, false


def main() -> None:
    """Print a line for each picture."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('folder', type=Path)
    parser.add_argument('change', nargs='*', metavar='MODULE:NAME EXPRESSION')
    options = parser.parse_args()
    if options.change:
        change(*options.change)
    # Imported only now, so that the gate is open already.
    import cv2
    import numpy as np

    from ahf_ros import create_identifier
    from support.calls import calls_of

    cv2.setNumThreads(1)
    warm: set[str] = set()
    for path in sorted(options.folder.glob('*.npz')):
        with np.load(path) as picture:
            image, family = picture['image'], str(picture['family'])
            truth = json.loads(str(picture['truth']))
        identifier = create_identifier(family=family, threads=1)
        if family not in warm:  # tables that are made once do not count
            warm.add(family)
            identifier.identify(image[:400, :400])
        found: list[Any] = []
        started = time.process_time()
        calls = calls_of(lambda: found.append(identifier.identify(image)))  # noqa: B023
        seconds = time.process_time() - started
        right, wrong, false = verdicts(found[0].targets, truth)
        seen = {'right': sorted(right), 'wrong': wrong, 'false': false}
        seen |= {'calls': calls, 'seconds': seconds}
        print(json.dumps({'picture': path.stem, **seen}), flush=True)
    if options.change and options.change[0].partition(':')[0] not in sys.modules:
        raise SystemExit(f'{options.change[0]} is not in a module that is imported')


if __name__ == '__main__':
    main()
