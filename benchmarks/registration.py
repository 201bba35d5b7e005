"""Figures of poses and registered scans.

`python -m benchmarks.registration --table TABLE [--seed 301] [--runs N]` prints one of them.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

from benchmarks import registration_pose, registration_scans

TABLES: dict[str, Callable[[int, int | None], list[str]]] = {
    'pose': lambda seed, runs: registration_pose.table(seed, runs or 1000),
    'scans': lambda seed, runs: registration_scans.table(seed, runs or 1000),
}


def main() -> None:
    """Print the chosen table."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n', maxsplit=1)[0])
    parser.add_argument('--table', choices=sorted(TABLES), required=True)
    parser.add_argument('--seed', type=int, default=301)
    parser.add_argument('--runs', type=int, help='runs of each row, where a table has runs')
    options = parser.parse_args()
    print('\n'.join(TABLES[options.table](options.seed, options.runs)))


if __name__ == '__main__':
    main()
