"""Photographs by strangers: targets in public repositories, and how many of them are identified.

`benchmarks/truth/photographs.json` says what they show: the repository, the path and the blob of
each picture, the IDs of its targets and where they are, as a person reads them in the picture or
in others of its series. `uncounted` are targets that nobody is asked for: too small for a person,
cut by the border, or of an ID that two of one colour share. Families that the package does not
have were learnt from the photographs by `ahf learn-family`, and lie beside. Each picture is read
from a clone of its repository, and identified by itself, with its family named and with `auto`, as
it is or under patterns of light:

    git clone https://github.com/poxiao2/CCTDecode FOLDER/poxiao2/CCTDecode
    python -m benchmarks.photographs FOLDER [--repositories poxiao2/CCTDecode ...]
        [--families named auto] [--lights stripe lattice --ambient 0.3 0.12] [--output FILE]
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros import FAMILY_NAMES, identify
from ahf_ros.base.target import Target
from ahf_ros.prints.families import AUTO
from ahf_ros.scenes.evaluation import RIGHT, judge, score
from ahf_ros.scenes.patterns import LIGHT_NAMES
from benchmarks import report
from support.pictures.projected import lit
from support.strangers import TRUTH, Photograph, photographs, picture, targets_of

NAMED = 'named'
WAYS = (NAMED, AUTO)
"""Ways to say which family a picture shows."""


def identified(image: np.ndarray, family: str) -> Sequence[Target]:
    """Return the targets of a family of the package, of one that was learnt, or of all."""
    learnt = family not in (*FAMILY_NAMES, AUTO)
    file = str(TRUTH / f'{family}.json') if learnt else ''
    return identify(image, family=family, family_file=file).targets


def ways_of(shown: Photograph, ways: Sequence[str]) -> list[str]:
    """Return the ways in which a photograph can be identified: all know no family that is new."""
    return [way for way in ways if way == NAMED or shown['family'] in FAMILY_NAMES]


def record(
    image: np.ndarray, shown: Photograph, ways: Sequence[str], light: str = ''
) -> dict[str, Any]:
    """Return the figures of a photograph, and the IDs that were missed, by ways."""
    truth, figures = targets_of(shown), {}
    for way in ways_of(shown, ways):
        seen = identified(image, shown['family'] if way == NAMED else way)
        of = score(truth, seen)
        right = {it.target for it in judge(truth, seen) if it.kind == RIGHT}
        figures[way] = {
            'right': of.right,
            'wrong': of.wrong,
            'false': of.false_positives,
            'missed': [it.id for it in truth if it.confirmed and it not in right],
        }
    named = {key: shown[key] for key in ('repository', 'path', 'family')} | {'light': light}
    return named | {'expected': len(shown['targets']), 'by': figures}


def markdown(figures: report.Report) -> str:
    """Return the report as a table, with the missed IDs of each picture."""
    ways, rows = figures['ways'], []
    for of in figures['rows']:
        where = f'[{of["repository"]}](https://github.com/{of["repository"]}) `{of["path"]}`'
        where += f' {of["light"]}' * bool(of['light'])
        counts = [cell for way in ways for cell in _cells(of['by'].get(way))]
        rows.append((where, of['family'], of['expected'], *counts))
    head = [name for way in ways for name in (way, 'wrong', 'false', 'missed')]
    table = report.table(('picture', 'family', 'N', *head), rows)
    parts = [report.machine_text(figures['machine']), '', *table, '']
    for light in dict.fromkeys(of['light'] for of in figures['rows']):
        some = [of for of in figures['rows'] if of['light'] == light]
        parts += [f'{light}: ' * bool(light) + _total(some, way) for way in ways]
    return '\n'.join(parts)


def _cells(of: dict[str, Any] | None) -> tuple[object, ...]:
    if of is None:
        return ('-',) * 4
    return of['right'], of['wrong'], of['false'], ' '.join(map(str, of['missed']))


def _total(rows: Sequence[dict[str, Any]], way: str) -> str:
    some = [of for of in rows if way in of['by']]
    wrong, false = (sum(of['by'][way][name] for of in some) for name in ('wrong', 'false'))
    return f'{way}: {share(rows, way)} right, {wrong} wrong, {false} false in {len(some)}.'


def share(rows: Sequence[dict[str, Any]], way: str) -> str:
    """Return how many targets are right, and of how many, in the pictures read in a way."""
    some = [of for of in rows if way in of['by']]
    right = sum(of['by'][way]['right'] for of in some)
    return f'{right} of {sum(of["expected"] for of in some)}'


def measure(options: argparse.Namespace) -> report.Report:
    """Return the figures of the photographs of the repositories that are asked for."""
    some = [shown for shown in photographs() if shown['repository'] in options.repositories]
    try:
        rows = [
            record(image, shown, options.families, light)
            for shown in report.progress(some, 'photographs')
            for light, image in _views(picture(options.folder, shown), shown, options)
        ]
    except ValueError as error:
        raise report.Unacceptable(error) from error
    return {'ways': list(options.families), 'rows': rows}


def _views(
    image: np.ndarray, shown: Photograph, options: argparse.Namespace
) -> Iterator[tuple[str, np.ndarray]]:
    """Yield a photograph under each light that is asked for, or as it is.

    Patterns are as large beside its dots as in scenes; one without targets has none.
    """
    if not options.lights:
        yield '', image
    elif seen := identified(image, shown['family']):
        radius = float(np.median([it.semi_major for it in seen]))
        for light, ambient in product(options.lights, options.ambient):
            yield f'{light} {ambient}', lit(image, light, ambient, radius, options.seed)


def parser() -> argparse.ArgumentParser:
    """Return what can be chosen."""
    known = sorted({shown['repository'] for shown in photographs()})
    made = report.parser(__doc__, seeds=False)
    made.add_argument('folder', type=Path, help='with the clones, as owner/name')
    made.add_argument('--repositories', nargs='+', choices=known, default=known)
    made.add_argument('--families', nargs='+', choices=WAYS, default=WAYS)
    made.add_argument('--lights', nargs='+', choices=LIGHT_NAMES, default=[])
    made.add_argument('--ambient', nargs='+', type=float, default=[0.3, 0.12])
    made.add_argument('--seed', type=int, default=report.FIRST_TEST_SEED, help='of the lights')
    return made


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print."""
    return report.run(parser(), measure, markdown, arguments)


if __name__ == '__main__':
    sys.exit(main())
