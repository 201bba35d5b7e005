"""What becomes of the results if a number that decides is halved, or doubled.

    python -m benchmarks.sensitivity [--detectors ring] [--numbers TEXT ...] [--pictures TEXT ...]

The numbers are the named ones in the modules of a detector and of `vision` that it imports. One at
a time is changed, in a process of its own, and the pictures of `benchmarks.gates` are identified
again: small scenes first, and the others if nothing changes there. A number whose change
changes nothing decides nothing: it goes, with what it is compared to, or gives way to another one.
A number up to 1 and above a half is a share, whose distance from 1 is halved and doubled.
"""

from __future__ import annotations

import ast
import math
import re
import subprocess
import sys
import tempfile
from argparse import Namespace
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks import report
from benchmarks.changed import assigned
from benchmarks.gates import (
    GATES,
    PACKAGE,
    YARDSTICK,
    Gate,
    Picture,
    Seen,
    chosen,
    commit,
    pictures,
    rendered,
    seen,
    value_of,
    written,
)
from support import ROOT

FACTORS = {'halved': 0.5, 'doubled': 2.0}

FIRST_SIZE, FIRST_TARGETS, FIRST_LIGHTS = (900, 600), 6, ('stripe', 'lattice')
"""Of the scenes that are identified first."""

SAME = 0.005
"""Share of the calls, or of the usual error, that counts as no change."""

_NAME = re.compile('_?[A-Z][A-Z0-9_]*')


@dataclass(frozen=True, slots=True)
class Change:
    """What changes in some pictures together.

    Attributes
    ----------
    gained, lost : int
        Targets that are right only with the number changed, and only with it as it is.
    bad : int
        More reports that are wrong or false.
    error : float
        Root mean square error of the centres, as a share of that before; NaN without any.
    calls : float
        Calls, as a share of those before.
    same_bits : bool
        Whether all centres and all calls are the same.
    works : bool
        Whether all pictures are identified.
    """

    gained: int
    lost: int
    bad: int
    error: float
    calls: float
    same_bits: bool
    works: bool

    @classmethod
    def between(cls, before: dict[str, Seen], after: dict[str, Seen]) -> Change:
        """Return what changes in the pictures that both have."""
        both = sorted(before.keys() & after.keys())
        one, other = ([of[name] for name in both] for of in (before, after))
        pairs = list(zip(one, other, strict=True))
        calls = [sum(it.calls for it in of) for of in (one, other)]
        return cls(
            gained=sum(len(b.right.keys() - a.right.keys()) for a, b in pairs),
            lost=sum(len(a.right.keys() - b.right.keys()) for a, b in pairs),
            bad=sum(b.wrong + b.false - a.wrong - a.false for a, b in pairs),
            error=_error(other) / _error(one),
            calls=calls[1] / calls[0] if both else math.nan,
            same_bits=all((a.right, a.calls) == (b.right, b.calls) for a, b in pairs),
            works=before.keys() <= after.keys(),
        )

    @property
    def matters(self) -> bool:
        """Whether anybody could see the change."""
        moved = [abs(of - 1) > SAME for of in (self.error, self.calls)]
        return not self.works or any((self.gained, self.lost, self.bad, *moved))

    def __str__(self) -> str:
        """Return the cell of a table."""
        if not self.works:
            return 'does not work'
        counts = (self.gained, '+{}'), (self.lost, '-{}'), (self.bad, '{:+} wrong or false')
        words = [text.format(count) for count, text in counts if count]
        shares = (self.error, 'error'), (self.calls, 'calls')
        words += [f'{name} {of:.3f}' for of, name in shares if abs(of - 1) > SAME]
        return ', '.join(words) or ('same bits' if self.same_bits else 'nothing')


def _error(some: Sequence[Seen]) -> float:
    """Return the root mean square error of all centres, px."""
    errors = [error for it in some for error in it.right.values()]
    return float(np.sqrt(np.mean(np.square(errors)))) if errors else math.nan


def modules(detector: str) -> list[str]:
    """Return the modules that decide in a detector, as a new process reports."""
    names = f'import sys, ahf_ros.families.{detector}.detector; print(*sorted(sys.modules))'
    done = subprocess.run(
        [sys.executable, '-c', names], cwd=ROOT, check=True, capture_output=True, text=True
    )
    rooms = re.compile(rf'ahf_ros\.(vision|families(\.{detector})?)\.\w+')
    return [name for name in done.stdout.split() if rooms.fullmatch(name)]


def numbers(module: str) -> Iterator[str]:
    """Yield the places of all names in capitals that a module assigns a number, or several."""
    file = ROOT / (module.replace('.', '/') + '.py')
    place = module.removeprefix(PACKAGE)
    if not file.is_file():
        return
    for name in assigned(ast.parse(file.read_text())):
        source = value_of(f'{place}:{name}')
        if _NAME.fullmatch(name) and _is_number(ast.parse(source, mode='eval').body):
            yield f'{place}:{name}'


def _is_number(value: ast.expr) -> bool:
    """Return whether a value is a number, or some numbers."""
    if isinstance(value, ast.Constant):
        return type(value.value) in (int, float)
    if isinstance(value, ast.UnaryOp):
        return _is_number(value.operand)
    if isinstance(value, ast.BinOp):
        return _is_number(value.left) and _is_number(value.right)
    if isinstance(value, (ast.Tuple, ast.List)):
        return bool(value.elts) and all(map(_is_number, value.elts))
    return (
        isinstance(value, ast.Call)
        and ast.unparse(value.func).startswith('np.')
        and all(map(_is_number, value.args))
    )


def changed(place: str, factor: float) -> Gate | None:
    """Return the change of a number; None if there is none, as for a 1 that is halved."""
    source = value_of(place)
    value = eval(source, {'np': np, 'math': math})
    after = np.vectorize(lambda of: _times(of, factor), otypes=[object])(value).tolist()
    if after == np.asarray(value).tolist():
        return None
    if isinstance(value, np.ndarray):
        return Gate(place, place, f'np.array({after})')
    return Gate(place, place, repr(type(value)(after)))


def _times(value: float, factor: float) -> float:
    """Return a number times a factor, or, of a share, one minus what is missing times it."""
    if isinstance(value, (int, np.integer)):
        return int(value * factor) or int(value)
    return 1 - (1 - value) * factor if 0.5 < value < 1 else value * factor


def measured(detector: str, some: Sequence[str], options: Namespace) -> report.Report:
    """Return the figures of some numbers of a detector as JSON has them."""
    with tempfile.TemporaryDirectory() as folder:
        first = rendered(
            detector,
            options.seeds,
            options.pictures,
            lights=FIRST_LIGHTS,
            size=FIRST_SIZE,
            targets=FIRST_TARGETS,
        )
        others = pictures(detector, options.seeds, options.yardstick, options.pictures)
        parts = [list(first), [] if options.first else list(others)]
        folders = [Path(folder, name) for name in ('first', 'others')]
        named = [_written(*of) for of in zip(parts, folders, strict=True)]
        before = [seen(of) for of in folders]

        def change(place: str, factor: float) -> Change | None:
            gate = changed(place, factor)
            for part, of in zip(before, folders, strict=True):
                made = Change.between(part, seen(of, gate)) if gate else None
                if made is None or made.matters:
                    break
            return made

        def row(place: str) -> tuple[str, ...]:
            made = [change(place, factor) for factor in FACTORS.values()]
            cells = ['' if of is None else str(of) for of in made]
            decides = any(of is not None and of.matters for of in made)
            line = place, value_of(place), *cells, '' if decides else 'nothing'
            print(' | '.join(line), file=sys.stderr, flush=True)
            return line

        with ThreadPoolExecutor(options.jobs) as pool:
            rows = list(pool.map(row, some))
    return {
        'detector': detector,
        'pictures': sum(map(len, named)),
        'targets': sum(len(it.truth) for of in parts for it in of),
        'right': sum(len(it.right) for of in before for it in of.values()),
        'rows': rows,
    }


def _written(some: Sequence[Picture], folder: Path) -> dict[str, Picture]:
    folder.mkdir()
    return written(some, folder)


def markdown(figures: report.Report) -> str:
    """Return the page of a report."""
    lines = [f'Commit {figures["commit"]}. {report.about_text(figures)}']
    for of in figures['detectors']:
        nothing = sum(row[-1] != '' for row in of['rows'])
        about = (
            f'`{of["detector"]}`: {of["pictures"]} pictures, in which {of["right"]} of '
            f'{of["targets"]} targets are right. {nothing} of {len(of["rows"])} numbers decide '
            'nothing.'
        )
        lines += ['', about, '', *report.table(('number', 'value', *FACTORS, ''), of['rows'])]
    return '\n'.join(lines)


def measure(options: Namespace) -> report.Report:
    """Return the figures of the detectors and numbers that are asked for."""
    found = []
    decisive = set[str]()
    for detector in options.detectors:
        every = [name for module in modules(detector) for name in numbers(module)]
        some = [name for name in every if chosen(name, options.numbers) and name not in decisive]
        if some:
            found.append(measured(detector, some, options))
            decisive |= {row[0] for row in found[-1]['rows'] if not row[-1]}
    if not found:
        raise report.Unacceptable(f'no number has {" or ".join(options.numbers)} in its name')
    return {'commit': commit(), 'detectors': found}


def main() -> int:
    """Print a table for each detector, without the numbers that decide in one before it."""
    parser = report.parser(__doc__)
    parser.add_argument('--detectors', nargs='+', choices=sorted(GATES), default=list(GATES))
    parser.add_argument('--numbers', nargs='+', default=[], metavar='TEXT', help='default: all')
    parser.add_argument('--pictures', nargs='+', default=[], metavar='TEXT', help='default: all')
    parser.add_argument('--yardstick', type=Path, default=YARDSTICK, metavar='FOLDER')
    parser.add_argument('--first', action='store_true', help='only the scenes that come first')
    parser.add_argument('--jobs', type=int, default=1)
    return report.run(parser, measure, markdown)


if __name__ == '__main__':
    sys.exit(main())
