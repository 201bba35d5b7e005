"""Compute the coordinates of targets from what was identified in photographs, and list them.

Identify first, then run this program:

    ahf identify photos --json > results.jsonl
    python network.py results.jsonl --scale-bars bars.csv > coordinates.csv

The header of a file of scale bars is id_1,id_2,length,sigma,role; without one, the coordinates
have no unit.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Sequence

import numpy as np
from ahf_ros import orient
from ahf_ros.network.files.control_files import read_scale_bars
from ahf_ros.network.files.network_files import make_network
from ahf_ros.network.files.observation_files import read_observations


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a table of the largest group of photographs that hang together."""
    parser = argparse.ArgumentParser(description='Compute coordinates of targets.')
    parser.add_argument('results', help='of ahf identify --json, or CSV: image, id, x, y')
    parser.add_argument('--scale-bars', metavar='BARS.csv')
    options = parser.parse_args(arguments)

    bars = read_scale_bars(options.scale_bars) if options.scale_bars else ()
    network, notes = make_network(read_observations(options.results), bars=bars)
    solutions = orient(network)
    if not solutions:
        sys.exit('no photograph could be oriented')
    solution = solutions[0]
    points = solution.measured_points

    # The covariance is that of all coordinates, ordered x, y, z of the first point, of the next.
    sigmas = np.sqrt(np.diag(points.covariance)).reshape(-1, 3)
    table = csv.writer(sys.stdout)
    table.writerow(('id', 'x', 'y', 'z', 'sigma_x', 'sigma_y', 'sigma_z'))
    for name, xyz, sigma in zip(points.names, points.xyz, sigmas, strict=True):
        table.writerow((name, *(f'{it:.4f}' for it in (*xyz, *sigma))))
    for note in (*notes, *solution.warnings):
        print(note, file=sys.stderr)
    unit = points.unit or 'no unit'
    print(f'{len(points.names)} targets, sigma0 {points.sigma0:.2f}, {unit}', file=sys.stderr)


if __name__ == '__main__':
    main()
