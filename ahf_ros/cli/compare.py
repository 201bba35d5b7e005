"""`ahf compare`: which targets moved between two epochs."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ahf_ros.base.settings.parameter import Parameter
from ahf_ros.cli import say, tell
from ahf_ros.cli.options import (
    add_flag,
    add_input,
    add_option,
    add_parsed,
    add_quiet,
    input_path,
    output_path,
)
from ahf_ros.cli.tables import identifiers, print_table
from ahf_ros.network.units import decimals

if TYPE_CHECKING:
    from ahf_ros.network.congruence import Comparison

_FORMATS = '.csv', '.svg'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    add_input(parser, 'first', 'EPOCH1', 'Folder that ahf orient wrote.', type=input_path)
    add_input(parser, 'second', 'EPOCH2', 'The same, of the later epoch.', type=input_path)
    text = 'Also write the movements: as a table, FILE.csv, or as a picture, FILE.svg. Repeatable.'
    add_parsed(parser, '-o', 'FILE', text, _output, action='append', default=[])
    text = (
        'Targets that may have stood still, three or more, and more than half of them did. '
        'Default: all that are in both epochs.'
    )
    add_parsed(parser, '--stable', 'ID,ID,...', text, identifiers, default=())
    parser.add_argument(
        '--scale',
        choices=('fixed', 'free'),
        help='Whether sizes are compared, or shapes only. Default: free where an epoch has no '
        'scale.',
    )
    text = 'Share of epochs without movement that are taken for ones with.'
    add_option(parser, Parameter('level', 0.05, text, minimum=1e-6, maximum=0.5))
    add_flag(parser, '--json', 'Print one JSON object on standard output.')
    add_quiet(parser)


def run(options: argparse.Namespace) -> int:
    """Compare the epochs, show what moved, and write files."""
    from ahf_ros.base.writing import write_whole
    from ahf_ros.files.files import csv_table
    from ahf_ros.network.congruence import compare
    from ahf_ros.network.files.network_results import read_network

    try:
        epochs = [read_network(path).points for path in (options.first, options.second)]
        found = compare(
            *epochs,
            stable=options.stable,
            free_scale=None if options.scale is None else options.scale == 'free',
            level=options.level,
        )
        for path in options.output:
            if path.suffix.lower() == '.csv':
                write_whole(path, csv_table(_rows(found)))
            else:
                from ahf_ros.network.report.movements import movements_figure

                write_whole(path, movements_figure(found).encode())
    except ValueError as error:
        tell('compare', error)
        return 1
    if options.json:
        print(json.dumps(_record(found)))
    if not options.quiet:
        _show(found)
    for warning in found.warnings:
        tell('compare', warning)
    return 0


def _output(text: str) -> Path:
    path = output_path(text)
    if path.suffix.lower() not in _FORMATS:
        raise ValueError(f'{text} has another ending, accepted are {" and ".join(_FORMATS)}')
    return path


def _show(found: Comparison) -> None:
    """Print the first and the last test, and movements, those that are named first."""
    unit = found.unit or 'units of the first epoch'
    tests = [
        (
            str(it.targets),
            f'{it.statistic:.3f}',
            str(it.rank),
            str(it.redundancy),
            f'{it.probability:.2g}',
            f'{it.level:.3g}',
        )
        for it in (found.tests if len(found.tests) < 2 else (found.tests[0], found.tests[-1]))
    ]
    print_table(
        'Congruence test, ' + ('shape only' if found.free_scale else 'with scale'),
        ('targets of the datum', 'T', 'rank', 'redundancy', 'probability', 'limit'),
        tests,
    )
    items = sorted(found.movements, key=lambda it: (not it.moved, -it.statistic))
    digits = decimals(it.sigma for it in items)
    rows = [
        (
            it.name,
            *(f'{value:+.{digits}f}' for value in it.xyz),
            f'{it.length:.{digits}f}',
            f'{it.sigma:.{digits}f}',
            f'{it.probability:.2g}',
            'moved' if it.moved else '' if it.in_datum else 'not in the datum',
        )
        for it in items
    ]
    head = 'target', f'dx, {unit}', 'dy', 'dz', 'length', 'sigma', 'probability', ''
    print_table('Movements', head, rows)
    say(_verdict(found))


def _verdict(found: Comparison) -> str:
    if found.moved:
        return f'moved: {", ".join(found.moved)}'
    if found.congruent:
        return 'no target moved, as far as the tests see'
    return 'the epochs differ, but no target can be named that moved'


def _rows(found: Comparison) -> Iterator[list[object]]:
    yield [
        *('id', 'x', 'y', 'z', 'dx', 'dy', 'dz', 'length', 'sigma'),
        *(f'covariance_{it}' for it in ('xx', 'xy', 'xz', 'yy', 'yz', 'zz')),
        *('statistic', 'probability', 'in_datum', 'moved'),
    ]
    for it in found.movements:
        entries = it.covariance[[0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
        numbers = [*it.place, *it.xyz, it.length, it.sigma, *entries]
        tests = [f'{it.statistic:.6g}', f'{it.probability:.6g}', int(it.in_datum), int(it.moved)]
        yield [it.name, *(f'{value:.9g}' for value in numbers), *tests]


def _record(found: Comparison) -> dict[str, Any]:
    figures = 'length', 'sigma', 'statistic', 'probability', 'in_datum', 'moved'
    return {
        'congruent': found.congruent,
        'moved': list(found.moved),
        'level': found.level,
        'free_scale': found.free_scale,
        'unit': found.unit,
        'variances': asdict(found.variances),
        'tests': [asdict(it) for it in found.tests],
        'movements': [
            {
                'id': it.name,
                'place': it.place.tolist(),
                'movement': it.xyz.tolist(),
                'covariance': it.covariance.tolist(),
                **{name: getattr(it, name) for name in figures},
            }
            for it in found.movements
        ],
        'only_first': list(found.only_first),
        'only_second': list(found.only_second),
        'warnings': list(found.warnings),
    }
