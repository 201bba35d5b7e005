"""Figures of networks: adjustment, covariances, wrong IDs, movements and time.

    python -m benchmarks.network --table TABLE [--seed 301] [--runs N]

`camcal` needs `AHF_NETWORKS`, the folder of published networks, and `panel` needs `AHF_PHOTOS`,
that of photographs.
"""

import resource
import time
from collections.abc import Callable, Sequence

import numpy as np

from ahf_ros.network.adjustment import adjust
from ahf_ros.network.orient import orient
from benchmarks import network_epochs, network_errors, network_starts
from benchmarks.report import print_chosen
from benchmarks.report import table as markdown
from support import camcal
from support.network_scenes import Field, approximate, simulate

SIZES = (125, 250, 500, 1000)
"""Photographs of large networks."""


def scale_table(seeds: Sequence[int]) -> list[str]:
    """Return times of 200 targets, 80 in a photograph, as lines of Markdown."""
    rows = []
    for photographs in SIZES:
        random = np.random.default_rng([seeds[0], photographs])
        network, truth = simulate(Field(photographs, 200, each=80), random)
        start = approximate(truth, random)
        begin = time.perf_counter()
        adjust(network, start, release=network_errors.RELEASED, test=False)
        between = time.perf_counter()
        adjust(network, start)
        end = time.perf_counter()
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        times = f'{between - begin:.1f}', f'{end - between:.1f}'
        rows.append((photographs, len(network.observations.xy), *times, f'{memory:.0f}'))
    times = 'parameters given, no tests, s', 'all and tests, s'
    return markdown(('photographs', 'observations', *times, 'memory MB'), rows)


def from_ids(seeds: Sequence[int]) -> list[str]:
    """Return the processor time of photographs that all show 200 targets, from IDs alone."""
    field = Field(300, 200)
    network, _ = simulate(field, np.random.default_rng([seeds[0], field.photographs]))
    begin = time.process_time()
    (solution,) = orient(network)
    taken = time.process_time() - begin
    counts = (
        field.photographs,
        field.targets,
        len(network.observations.xy),
        solution.oriented.sum(),
    )
    head = 'photographs', 'targets', 'image points', 'oriented', 'sigma0', 'processor, s'
    return markdown(head, [(*counts, f'{solution.sigma0:.3f}', f'{taken:.0f}')])


def camcal_table() -> list[str]:
    """Return the comparison as lines of Markdown."""
    path = camcal.folder()
    if path is None:
        return ['`AHF_NETWORKS` names no folder with `camcal`.']
    solution = camcal.solve(path)
    values, deviations = camcal.in_dbat_units(solution)
    theirs, their_deviations = camcal.dbat(path)
    names = ('cc', 'px', 'py', 'as', 'K1', 'K2', 'K3', 'P1', 'P2')
    columns = zip(names, values, theirs, deviations, their_deviations, strict=True)
    rows = [
        (
            *(name, f'{mine:.8g}', f'{other:.8g}', f'{(mine - other) / size:+.3f}'),
            *(f'{deviation:.3g}', f'{size:.3g}', f'{deviation / size:.3f}'),
        )
        for name, mine, other, deviation, size in columns
    ]
    differences = 'difference, sigma', 'sigma here', 'sigma DBAT', 'ratio'
    about = f'sigma0 {solution.sigma0 / 10:.5f} px, redundancy {solution.redundancy}'
    return [about, '', *markdown(('parameter (mm)', 'here', 'DBAT', *differences), rows)]


TABLES: dict[str, Callable[[int, int | None], list[str]]] = {
    'camcal': lambda seed, runs: camcal_table(),
    'ellipsoids': lambda seed, runs: network_errors.ellipsoids_table([seed], runs or 125),
    'epochs': lambda seed, runs: network_epochs.table([seed], runs or network_epochs.RUNS),
    'optimum': lambda seed, runs: network_epochs.optimum_table([seed], runs or 20000),
    'outliers': lambda seed, runs: network_errors.outliers_table([seed], runs or 25),
    'scale': lambda seed, runs: scale_table([seed]),
    'from_ids': lambda seed, runs: from_ids([seed]),
    'panel': lambda seed, runs: network_starts.panel(),
    'lenses': lambda seed, runs: network_errors.lenses_table([seed], runs or 250),
    'still': lambda seed, runs: network_errors.still_table([seed], runs or 400),
    'tails': lambda seed, runs: network_errors.tails_table([seed], runs or 1000),
    'told': lambda seed, runs: network_errors.told_table([seed], runs or 500),
    'starts': lambda seed, runs: network_starts.starts_table([seed], runs or 250),
}


if __name__ == '__main__':
    print_chosen(TABLES, __doc__)
