"""`ahf measure`: distances, deviations from nominal coordinates, errors of calibrated lengths."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ahf_ros.cli import say, tell
from ahf_ros.cli.options import add_flag, add_input, add_output, add_parsed, add_quiet, input_path
from ahf_ros.cli.tables import identifiers, print_table
from ahf_ros.network.units import decimals

if TYPE_CHECKING:
    from ahf_ros.network.alignment import Alignment
    from ahf_ros.network.measurement import Deviation, Distance, LengthTest, PermissibleError
    from ahf_ros.network.network import FloatArray
    from ahf_ros.network.points import MeasuredPoints

_TITLES = {
    'distances': 'Distances',
    'deviations': 'Measured minus nominal',
    'lengths': 'Length errors',
}
_ALIGNMENTS = 'best-fit', 'similarity', '3-2-1', 'none'

_Measured = tuple[list['Distance'], list['Deviation'], 'LengthTest | None']


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    add_input(parser, 'network', 'NETWORK', 'Folder that ahf orient wrote.', type=input_path)
    text = (
        'Measure the distance of two targets. Repeatable. Default: all distances, if neither '
        'nominal coordinates nor lengths are given.'
    )
    add_parsed(parser, '--distance', 'ID,ID', text, _pair, action='append', default=[])
    nominal = parser.add_argument_group('nominal coordinates')
    text = 'Compare the coordinates with nominal ones: ID, x, y, z.'
    add_input(nominal, '--nominal', 'POINTS.csv', text)
    nominal.add_argument(
        '--align',
        choices=_ALIGNMENTS,
        help='How: best-fit, rigid; similarity, with a scale; 3-2-1; or none, if both are in one '
        'frame. Default: best-fit, or similarity where the network has no scale.',
    )
    text = (
        'Targets of the alignment. For 3-2-1 these are three across z, two across y, one '
        'along x; or only three: a plane, the first two a line, the first one a point. '
        'Default: all.'
    )
    add_parsed(nominal, '--align-on', 'ID,ID,...', text, identifiers, default=())
    nominal.add_argument(
        '--weights',
        choices=('covariance', 'equal'),
        help='Weights of a best fit. Default: covariance, the inverse of the whole of it.',
    )
    lengths = parser.add_argument_group('calibrated lengths')
    text = (
        'Test calibrated lengths as VDI/VDE 2634-1 does: id_1, id_2, length, and perhaps '
        'sigma and line.'
    )
    add_input(lengths, '--lengths', 'LENGTHS.csv', text)
    text = 'Maximum permissible error of a length L: A + L/K, and not above B.'
    add_parsed(lengths, '--permissible', 'A[,K[,B]]', text, _permissible)
    text = 'Also write tables: distances.csv, deviations.csv, lengths.csv.'
    add_output(parser, '-o', 'DIR', text)
    add_flag(parser, '--json', 'Print one JSON object on standard output.')
    add_quiet(parser)


def run(options: argparse.Namespace) -> int:
    """Measure, and return 1 if a file cannot be used or a length error is not permissible."""
    from ahf_ros.network.files.network_results import read_network

    _check(options)
    try:
        points = read_network(options.network).points
        found = _measured(options, points)
        if options.output:
            _write(options.output, *found)
    except ValueError as error:
        tell('measure', error)
        return 1
    if options.json:
        print(json.dumps(_record(points, *found)))
    if not options.quiet:
        _show(points, *found)
    lengths = found[2]
    for remark in lengths.remarks if lengths else ():
        tell('measure', remark)
    return int(lengths is not None and lengths.passed is False)


def _check(options: argparse.Namespace) -> None:
    """Raise a ValueError if options need another one that is not given."""
    for name in ('align', 'align_on', 'weights'):
        if getattr(options, name) and not options.nominal:
            raise ValueError(f'{name} is given without nominal, accepted is both')
    if options.permissible and not options.lengths:
        raise ValueError('permissible is given without lengths, accepted is both')
    if options.weights and options.align in ('3-2-1', 'none'):
        raise ValueError(f'weights is given with {options.align}, accepted is a best fit')
    if options.align == '3-2-1' and len(options.align_on) not in (3, 6):
        raise ValueError(f'align_on has {len(options.align_on)} IDs, accepted are three or six')
    if options.align == 'none' and options.align_on:
        raise ValueError('align_on is given with none, accepted is an alignment')


def _measured(options: argparse.Namespace, points: MeasuredPoints) -> _Measured:
    """Return distances, deviations and the test of lengths, as far as they are asked for."""
    from ahf_ros.files.tables import read_points
    from ahf_ros.network import measurement
    from ahf_ros.network.files.control_files import read_lengths

    far: list[Distance] = []
    if options.distance or not (options.nominal or options.lengths):
        far = measurement.distances(points, options.distance or None)
    off: list[Deviation] = []
    if options.nominal:
        nominal = read_points(options.nominal)
        if remark := measurement.unit_remark(points, nominal):
            tell('measure', f'{options.nominal}: {remark}')
        off = measurement.deviations(_aligned(options, points, nominal), nominal)
    test = None
    if options.lengths:
        test = measurement.length_errors(
            points, read_lengths(options.lengths), options.permissible
        )
    return far, off, test


def _aligned(
    options: argparse.Namespace, points: MeasuredPoints, nominal: dict[str, FloatArray]
) -> Alignment:
    from ahf_ros.network.alignment import best_fit, three_two_one, unaligned

    kind = options.align or ('best-fit' if points.unit else 'similarity')
    if kind == 'none':
        return unaligned(points)
    names = options.align_on
    if kind == '3-2-1':
        if len(names) == 3:
            names = (*names, *names[:2], names[0])
        return three_two_one(points, nominal, plane=names[:3], line=names[3:5], point=names[5])
    return best_fit(
        points,
        nominal,
        on=names,
        scale=kind == 'similarity',
        weights='equal' if options.weights == 'equal' else 'covariance',
    )


def _pair(text: str) -> tuple[str, str]:
    names = identifiers(text)
    if len(names) != 2:
        raise ValueError(f'{text!r} is {len(names)} IDs, accepted are two')
    return names[0], names[1]


def _permissible(text: str) -> PermissibleError:
    from ahf_ros.network.measurement import PermissibleError

    try:
        numbers = [float(it) for it in text.split(',')]
    except ValueError:
        numbers = []
    if not 1 <= len(numbers) <= 3:
        raise ValueError(f'{text!r} is no permissible error, accepted is A, A,K or A,K,B')
    return PermissibleError(*numbers)


def _tables(
    far: Sequence[Distance], off: Sequence[Deviation], test: LengthTest | None
) -> Iterator[tuple[str, list[list[object]], int]]:
    """Yield name, head and rows of the tables that are not empty, and decimals to be shown."""
    if far:
        head: list[object] = ['id_1', 'id_2', 'distance', 'sigma']
        rows: list[list[object]] = [[*it.ends, it.length, it.sigma] for it in far]
        yield 'distances', [head, *rows], decimals(it.sigma for it in far)
    if off:
        head = ['id', 'dx', 'dy', 'dz', 'distance', 'sigma_x', 'sigma_y', 'sigma_z', 'aligned']
        rows = [[it.name, *it.xyz, it.distance, *it.sigmas, it.used] for it in off]
        yield 'deviations', [head, *rows], decimals(value for it in off for value in it.sigmas)
    if test:
        head = ['id_1', 'id_2', 'line', 'calibrated', 'measured', 'error', 'sigma']
        rows = [
            [
                *(*it.ends, it.line, it.calibrated, it.measured, it.error, it.sigma),
                *(it.permissible, it.within),
            ]
            for it in test.errors
        ]
        table = [[*head, 'permissible', 'within'], *rows]
        yield 'lengths', table, decimals(it.sigma for it in test.errors)


def _cell(value: object, digits: str) -> str:
    """Return a number with these digits, a verdict as 1 or 0, nothing where there is none."""
    if isinstance(value, bool):
        return str(int(value))
    return f'{value:{digits}}' if isinstance(value, float) else str(value or '')


def _show(points: MeasuredPoints, *found: Any) -> None:
    import numpy as np

    for name, (head, *rows), digits in _tables(*found):
        title = f'{_TITLES[name]}, {points.unit or "no scale"}'
        shown = [[_cell(value, f'.{digits}f') for value in row] for row in rows]
        print_table(title, [str(it) for it in head], shown)
    off: list[Deviation] = found[1]
    if off:
        squares = np.mean([it.xyz**2 for it in off], axis=0)
        each = ', '.join(f'{value:.4g}' for value in np.sqrt(squares))
        text = f'RMS deviation x, y, z: {each}; of the distance: {np.sqrt(squares.sum()):.4g}'
        say(f'{text} {points.unit}'.rstrip())
    test: LengthTest | None = found[2]
    if test:
        text = f'largest length error: {test.largest.error:+.4g} {points.unit}'
        if test.passed is not None:
            text += ', all are permissible' if test.passed else ', NOT all are permissible'
        say(text)


def _write(folder: Path, *found: Any) -> None:
    from ahf_ros.base.writing import write_files
    from ahf_ros.files.files import csv_table

    tables = {
        f'{name}.csv': csv_table([_cell(value, '.9g') for value in row] for row in rows)
        for name, rows, _ in _tables(*found)
    }
    write_files(folder, tables.items())


def _record(
    points: MeasuredPoints,
    far: Sequence[Distance],
    off: Sequence[Deviation],
    test: LengthTest | None,
) -> dict[str, Any]:
    record: dict[str, Any] = {'unit': points.unit}
    if far:
        record['distances'] = [
            {'ids': list(it.ends), 'distance': it.length, 'sigma': it.sigma} for it in far
        ]
    if off:
        record['deviations'] = [
            {
                'id': it.name,
                'deviation': it.xyz.tolist(),
                'covariance': it.covariance.tolist(),
                'distance': it.distance,
                'aligned': it.used,
            }
            for it in off
        ]
    if test:
        names = 'line', 'calibrated', 'measured', 'error', 'sigma', 'permissible', 'within'
        record['lengths'] = [
            {'ids': list(it.ends), **{name: getattr(it, name) for name in names}}
            for it in test.errors
        ]
        record['remarks'] = list(test.remarks)
    return record
