"""How much the results of `ring` depend on its constants: each one halved, and doubled.

    python -m benchmarks.sensitivity [MODULE.NAME ...] [--count 10]

Without names, all named numbers of `ring` and `features` that are not integers are screened: on
small scenes under little ambient light, some with shifted edges, and on some of those that
`benchmarks.confidence` is fitted to, with covers, glare, other families and marks that are no
targets. Those whose change costs most are then measured on more and larger scenes, and the first
of these are printed. All scenes have development seeds.
"""

from __future__ import annotations

import argparse
import ast
import math
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib import import_module
from itertools import chain, islice
from pathlib import Path

import numpy as np

from ahf_ros.scenes.scene import SceneSettings, render
from benchmarks.changed import assigned
from benchmarks.gates import PACKAGE, Gate, Picture, seen
from benchmarks.gates import written as written_pictures
from benchmarks.report import progress, table
from support.pictures.conditions import Scene, disturbed, strange

ROOT = Path(__file__).resolve().parent.parent
ROOMS = ('ahf_ros.vision.', 'ahf_ros.families.ring.')
BOUNDED = {'CERTAIN', '_STRAIGHT', 'WHOLE', '_MINIMUM_AGREEMENT'}
"""Constants that are meaningful up to 1 only: their distance from 1 is halved and doubled."""

LIGHTS = ('stripe', 'fine_stripe', 'lattice', 'dense_lattice')
FACTORS = (0.5, 2.0)
SMALL = [
    SceneSettings(
        width=1600,
        height=1066,
        targets=12,
        distractors=4,
        dot_radius=radius,
        light=light,
        ambient=ambient,
        edge_shift=shift,
    )
    for radius, ambient, shift in ((20.0, 0.04, 0.0), (7.0, 0.12, 0.0), (12.0, 0.12, -0.8))
    for light in LIGHTS
]
"""For screening."""

EVERY = 7
"""One of so many disturbed scenes is for screening."""

LARGE = [
    SceneSettings(
        width=2000,
        height=1500,
        targets=20,
        distractors=8,
        light=light,
        ambient=ambient,
        seed=seed,
    )
    for light in LIGHTS
    for ambient in (0.04, 0.12)
    for seed in (1, 2)
]
"""For the table."""


@dataclass(frozen=True)
class Outcome:
    """What was identified in all scenes; None where the detector does not work any more."""

    right: int | None = None
    wrong: int | None = None
    false: int | None = None
    rmse: float | None = None

    def loss(self) -> float:
        """Return one number by which outcomes compare: a wrong ID is as bad as three missed."""
        if self.right is None or self.wrong is None or self.false is None:
            return -math.inf
        return 3.0 * (self.wrong + self.false) - self.right + 10.0 * (self.rmse or 0.0)

    def __str__(self) -> str:
        """Return the cell of a table."""
        if self.right is None:
            return 'fails'
        others = [(self.wrong, 'wrong'), (self.false, 'false')]
        words = [str(self.right), *(f'{count} {word}' for count, word in others if count)]
        return ', '.join(words) + (f' ({self.rmse:.3f})' if self.rmse is not None else '')


def constants() -> Iterator[tuple[str, float]]:
    """Yield the name and the value of every constant of `ring` that is one number."""
    for module in modules():
        loaded = import_module(module)
        for name in assigned(ast.parse(Path(str(loaded.__file__)).read_text())):
            value = getattr(loaded, name)
            if re.fullmatch('_?[A-Z][A-Z0-9_]*', name) and isinstance(value, float):
                yield f'{module}.{name}', value


def modules() -> list[str]:
    """Return the modules in the rooms of `ring` that it imports, as a new process reports."""
    names = 'import sys, ahf_ros.families.ring.detector; print(*sorted(sys.modules))'
    done = subprocess.run(
        [sys.executable, '-c', names], cwd=ROOT, check=True, capture_output=True, text=True
    )
    return [name for name in done.stdout.split() if name.startswith(ROOMS)]


def rendered(scenes: Sequence[SceneSettings]) -> Iterator[Scene]:
    """Yield scenes under light."""
    for settings in scenes:
        rendering = render(settings)
        yield Scene('light', rendering.image, rendering.targets, settings.family)


def screened() -> Iterator[Scene]:
    """Yield the scenes for screening."""
    yield from rendered(SMALL)
    yield from islice(chain(disturbed(1), strange(1)), 0, None, EVERY)


def written(scenes: Iterable[Scene], folder: Path) -> Path:
    """Write scenes with their truth into a folder."""
    folder.mkdir()
    written_pictures(
        [
            Picture('', it.image, tuple((str(of.id), of.x, of.y) for of in it.truth), it.family)
            for it in scenes
        ],
        folder,
    )
    return folder


def outcome(folder: Path, constant: str = '', value: float = 0.0) -> Outcome:
    """Return what `ring` identifies with a constant changed, in a process of its own."""
    module, _, name = constant.removeprefix(PACKAGE).rpartition('.')
    found = seen(folder, Gate(constant, f'{module}:{name}', repr(value)) if constant else None)
    if len(found) < len(list(folder.iterdir())):
        return Outcome()
    errors = [error for of in found.values() for error in of.right.values()]
    wrong, false = (sum(getattr(of, kind) for of in found.values()) for kind in ('wrong', 'false'))
    rmse = float(np.sqrt(np.mean(np.square(errors)))) if errors else None
    return Outcome(len(errors), wrong, false, rmse)


def changed(name: str, value: float, factor: float) -> float:
    """Return the value of a constant times a factor."""
    if name.rpartition('.')[2] in BOUNDED:
        return 1 - factor * (1 - value)
    return value * factor


def measured(
    folder: Path, names: dict[str, float], what: str
) -> tuple[Outcome, dict[str, list[Outcome]]]:
    """Return the outcome as it is, and those with each constant halved and doubled."""
    changes = [(name, changed(name, names[name], factor)) for name in names for factor in FACTORS]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        done = pool.map(lambda change: outcome(folder, *change), changes)
        found = list(progress(done, what, len(changes)))
    tried = {
        name: found[start : start + len(FACTORS)]
        for name, start in zip(names, range(0, len(found), len(FACTORS)), strict=True)
    }
    return outcome(folder), tried


def ranked(tried: dict[str, list[Outcome]]) -> list[str]:
    """Return the names of constants, those whose change costs most first."""
    return sorted(tried, key=lambda name: -max(one.loss() for one in tried[name]))


def outcome_table(
    names: dict[str, float], default: Outcome, tried: dict[str, list[Outcome]]
) -> str:
    """Return outcomes as Markdown."""
    rows: list[tuple[object, ...]] = [('none changed', '', default, default)]
    for name, outcomes in tried.items():
        rows.append((f'`{name.removeprefix("ahf_ros.")}`', f'{names[name]:g}', *outcomes))
    return '\n'.join(table(('constant', 'value', 'halved', 'doubled'), rows))


def main() -> None:
    """Print the table of the constants to which results are most sensitive."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', 1)[0])
    parser.add_argument('names', nargs='*', metavar='MODULE.NAME', help='default: screen all')
    parser.add_argument('--count', type=int, default=10, help='rows of the table (default: 10)')
    options = parser.parse_args()
    values = dict(constants())
    unknown = set(options.names) - set(values)
    if unknown:
        parser.error(f'no such constants: {", ".join(sorted(unknown))}')
    with tempfile.TemporaryDirectory() as folder:
        names = {name: values[name] for name in options.names}
        if not names:
            small = written(screened(), Path(folder, 'small'))
            default, tried = measured(small, values, f'{len(values)} constants')
            print(outcome_table(values, default, tried), end='\n\n', file=sys.stderr)
            names = {name: values[name] for name in ranked(tried)[: 3 * options.count // 2]}
        large = written(rendered(LARGE), Path(folder, 'large'))
        default, tried = measured(large, names, 'the table')
        total = sum(settings.targets for settings in LARGE)
        print(f'Targets with the right ID, of {total}, and the RMSE of their centres in px.\n')
        shown = ranked(tried)[: options.count]
        print(outcome_table(names, default, {name: tried[name] for name in shown}))


if __name__ == '__main__':
    main()
