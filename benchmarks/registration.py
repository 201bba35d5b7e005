"""Figures of poses and registered scans.

`python -m benchmarks.registration --table TABLE [--seed 301] [--runs N]` prints one of them.
"""

from __future__ import annotations

from collections.abc import Callable

from benchmarks import registration_pose, registration_scans
from benchmarks.report import print_chosen

TABLES: dict[str, Callable[[int, int | None], list[str]]] = {
    'pose': lambda seed, runs: registration_pose.table(seed, runs or 1000),
    'scans': lambda seed, runs: registration_scans.table(seed, runs or 1000),
}


def main() -> None:
    """Print the chosen table."""
    print_chosen(TABLES, __doc__)


if __name__ == '__main__':
    main()
