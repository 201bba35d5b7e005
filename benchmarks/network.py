"""Figures of networks: adjustment, covariances, wrong IDs, and other programs beside it.

    python -m benchmarks.network --table TABLE [--seed 301] [--runs N]

`camcal` needs `AHF_NETWORKS`, the folder of published networks, `panel` needs `AHF_PHOTOS`, that
of photographs, and `colmap` needs pycolmap.
"""

from __future__ import annotations

from collections.abc import Callable

from benchmarks import (
    network_camcal,
    network_colmap,
    network_ellipsoids,
    network_epochs,
    network_optimum,
    network_outliers,
    network_scale,
    network_starts,
    network_trust,
)
from benchmarks.report import print_chosen

TABLES: dict[str, Callable[[int, int | None], list[str]]] = {
    'camcal': lambda seed, runs: network_camcal.table(),
    'ellipsoids': lambda seed, runs: network_ellipsoids.table([seed], runs or 125),
    'epochs': lambda seed, runs: network_epochs.table([seed], runs or network_epochs.RUNS),
    'optimum': lambda seed, runs: network_optimum.table([seed], runs or 20000),
    'outliers': lambda seed, runs: network_outliers.table([seed], runs or 25),
    'scale': lambda seed, runs: network_scale.table([seed]),
    'from_ids': lambda seed, runs: network_scale.from_ids([seed]),
    'panel': lambda seed, runs: network_starts.panel(),
    'lenses': lambda seed, runs: network_trust.lenses_table([seed], runs or 250),
    'still': lambda seed, runs: network_trust.still_table([seed], runs or 400),
    'tails': lambda seed, runs: network_trust.tails_table([seed], runs or 1000),
    'told': lambda seed, runs: network_trust.told_table([seed], runs or 500),
    'starts': lambda seed, runs: network_starts.starts_table([seed], runs or 250),
    'colmap': lambda seed, runs: network_colmap.table([seed]),
}


def main() -> None:
    """Print the chosen table."""
    print_chosen(TABLES, __doc__)


if __name__ == '__main__':
    main()
