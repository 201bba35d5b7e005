"""`ahf learn-family`: the data file of a family from the measured dots of its targets."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from ahf_ros.cli import tell
from ahf_ros.codes.gsi import PointFamily, point_family
from ahf_ros.codes.gsi_learning import Learnt, learn_family, library_text, with_codes
from ahf_ros.interchange.files import write_whole
from ahf_ros.interchange.point_lists import read_point_list


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    parser.add_argument(
        'points',
        metavar='POINTS.csv',
        help='Point list with rows CODEn, NUGGETn_A and NUGGETn_7, as V-STARS writes them.',
    )
    parser.add_argument('-o', '--output', required=True, metavar='FILE.json', help='Data file.')
    parser.add_argument(
        '--base',
        default='',
        metavar='FILE',
        help='Data file with the design in rough, for positions and codes that the points do not '
        'show. Default: the family of GSI.',
    )
    parser.add_argument('--name', help='Name of the family. Default: the name of the data file.')
    parser.add_argument('--unit', default='mm', help='Unit of the coordinates. Default: mm.')
    parser.add_argument(
        '--dot-radius',
        type=float,
        metavar='X',
        help='Radius of the dots in that unit. Default: in proportion to the design.',
    )


def run(options: argparse.Namespace) -> int:
    """Write the data file and say what was learnt."""
    radius = options.dot_radius
    if radius is not None and not 0 < radius < np.inf:
        raise ValueError(f'dot_radius is {radius!r}, accepted is a length above 0')
    try:
        base = point_family(options.base)
        name = options.name or Path(options.output).stem
        learnt = learn_family(read_point_list(options.points), base, name)
        family = replace(learnt.family, unit=options.unit, source=Path(options.points).name)
        if radius is not None:
            family = replace(
                family,
                dot_radius=radius,
                template_radii=family.template_radii * (radius / family.dot_radius),
                position_radii=family.position_radii * (radius / family.dot_radius),
            )
        family = with_codes(family, learnt.codes)
        write_whole(options.output, library_text(family).encode())
        point_family(options.output)
    except ValueError as error:
        tell('learn-family', error)
        return 1
    _report(learnt, base, options)
    return 0


def _report(learnt: Learnt, base: PointFamily, options: argparse.Namespace) -> None:
    """Say on standard error what was learnt and what was not."""
    for number, reason in learnt.left_out.items():
        tell('learn-family', f'target {number} is left out: it {reason}')
    sizes = [target.scale for target in learnt.targets]
    numbers = ', '.join(str(target.number) for target in learnt.targets)
    spread = max(np.hypot(*(target.template - base.template).T).max() for target in learnt.targets)
    print(
        f'{options.output}: {len(learnt.targets)} targets ({numbers}), {1 / np.mean(sizes):.4f} '
        f'times the size of {base.name}, template within {spread:.3f} {base.unit} of it',
        file=sys.stderr,
    )
