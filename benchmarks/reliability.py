"""How far stated confidences can be trusted, and the command line of the benchmarks that ask.

Each of `benchmarks.confidence`, `gsi_confidence` and `dots_confidence` renders scenes, compares
what a detector reads with the truth, and then either prints the reliability of the weights in
force or fits them anew.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.report import FIRST_TEST_SEED, table

NEAR = 5.0
"""Largest distance of a target from its truth, px."""

CLASSES = (0.0, 0.5, 0.9, 0.95, 0.98, 0.99, 0.999, 1.0)
"""Bounds of the classes of confidence in the table."""


Parts = Iterator[tuple[np.ndarray, ...]]
"""Conditions, features and what is right of the readings of one image after the other."""


def gathered(readings: Callable[[int], Parts], seeds: Sequence[int]) -> tuple[np.ndarray, ...]:
    """Return the readings of the scenes of some seeds, joined; each seed has a process."""
    with ProcessPoolExecutor(min(len(seeds), os.cpu_count() or 1)) as pool:
        parts = [part for of in pool.map(partial(_listed, readings), seeds) for part in of]
    return tuple(np.concatenate(column) for column in zip(*parts, strict=True))


def _listed(readings: Callable[[int], Parts], seed: int) -> list[tuple[np.ndarray, ...]]:
    return list(readings(seed))


def reliability_table(
    condition: Sequence[str] | np.ndarray, stated: np.ndarray, right: np.ndarray
) -> list[str]:
    """Return the lines of the table of confidences and how often they are right.

    Parameters
    ----------
    condition : sequence of k str
        Under which each reading was made; 'all' stands for all of them at the end.
    stated : ndarray of float, shape (k,)
        Their confidence.
    right : ndarray of bool, shape (k,)
    """
    condition = np.asarray(condition)
    rows = []
    for name in (*dict.fromkeys(condition.tolist()), 'all'):
        here = (condition == name) | (name == 'all')
        for low, high in pairwise(CLASSES):
            within = here & (stated >= low) & ((stated < high) | (high == CLASSES[-1]))
            if within.any():
                shares = (f'{of[within].mean():.4f}' for of in (stated, right))
                rows.append((name, f'{low} to {high}', within.sum(), *shares))
    return table(('condition', 'confidence', 'readings', 'mean confidence', 'share right'), rows)


def write_weights(
    purpose: str,
    seeds: Sequence[int],
    weights: Mapping[str, np.ndarray],
    path: Path,
) -> None:
    """Replace one set of a file, and say from which seeds and at which commit it was fitted.

    Parameters
    ----------
    purpose : str
        Name of the set, and of the benchmark that fits it.
    seeds : sequence of int
    weights : mapping of str to ndarray
    path : Path
        The file.
    """
    sets = json.loads(path.read_text(encoding='utf-8'))
    commit = subprocess.run(
        ['git', 'describe', '--always', '--dirty'],
        cwd=path.parent,
        check=True,
        capture_output=True,
        text=True,
    )
    sets[purpose].update(
        command=f'python -m benchmarks.{purpose} --fit {" ".join(map(str, seeds))}',
        seeds=list(seeds),
        commit=commit.stdout.strip(),
        **{name: values.tolist() for name, values in weights.items()},
    )
    text = json.dumps(sets, indent=2)
    text = re.sub(r'\[\s+([^]]*?)\s+\]', lambda row: f'[{" ".join(row[1].split())}]', text)
    path.write_text(text + '\n', encoding='utf-8')
    print(f'{path}: weights of the {purpose}')


def run(
    purpose: str,
    description: str,
    fitted: Callable[[Sequence[int]], Mapping[str, np.ndarray]],
    reliability: Callable[[Sequence[int]], list[str]],
    path: Path,
) -> None:
    """Write weights with --fit, or print their reliability as Markdown.

    Parameters
    ----------
    purpose : str
        Name of the benchmark, and of its set of weights.
    description : str
        Its first line is that of the help.
    fitted : callable
        Returns the weights that suit the scenes of some seeds.
    reliability : callable
        Returns the lines of the table of the scenes of some seeds.
    path : Path
        The file of weights.
    """
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument('--fit', type=int, nargs='+', metavar='SEED', help='fit the weights anew')
    parser.add_argument('--seeds', type=int, nargs='+', default=[FIRST_TEST_SEED])
    options = parser.parse_args()
    if options.fit:
        write_weights(purpose, options.fit, fitted(options.fit), path)
    else:
        print('\n'.join(reliability(options.seeds)))
