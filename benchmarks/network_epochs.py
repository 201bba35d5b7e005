"""How often the congruence test of two epochs raises a false alarm, and what it finds.

    python -m benchmarks.network --table epochs [--seed 301] [--runs 2000]

Each epoch is a bundle of its own photographs: image points with normal errors, poses, focal length
and radial distortion unknown, inner constraints, and a scale bar where the scale is fixed. Its
coordinates are those of the linearised adjustment, with all correlations and with the variance of
unit weight of its own residuals, in a frame of its own. In the field *adjusted* all of them are
adjusted by `adjust`, with Brown's distortion.

A movement of 5 sigma is that of one target, any, in any direction e, by 5 sqrt(e' C e). C is the
covariance of its difference x2 - x1 in the datum of all others, or, *conditional*, of the best
estimate of its movement against them, which `compare` reports and which is smaller: the residuals
of the others tell a part of its errors. *Found* are movements that make the epochs incongruent,
*located* those whose target is the first that is named, *alone* those where no other one is.
*Bound* is the power of one F-test of the right target at the same level with Bonferroni's
correction. *Quarter* moves a quarter of the targets together by 10 of the largest conditional
sigmas, and counts where these and no others are named.

    python -m benchmarks.network --table optimum [--seed 301] [--runs 20000]

tells how often any test of 5 % false alarms can locate such a movement. Among all tests with the
same share of false alarms, the one that names the target of the largest likelihood ratio, if that
exceeds a bound, names the right one most often (Neyman and Pearson 1933). It knows how far a
target moves and in which directions, and `compare` knows neither. *Largest share* is the test of
single targets, which does not, with the bound that gives exactly 5 % false alarms.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ahf_ros.network.congruence import LEVEL, compare
from ahf_ros.network.datum import movements
from ahf_ros.network.network import FloatArray, IntArray
from ahf_ros.network.points import blocks
from benchmarks.report import number, progress
from benchmarks.report import table as markdown
from support.simulated_epochs import FIELDS, Adjusted, Epoch, Field, differences, points_of

RUNS = 2000
SIGMAS = 5.0
DIRECTIONS = 300
PART = 200
"""Directions of movements, and pairs of epochs that are computed at a time, for the optimum."""
_OUTCOMES = 'found', 'located', 'alone', 'bound'


def cases(runs: int, seed: int) -> Iterator[dict[str, Any]]:
    """Yield the figures of each field, with its scale fixed and free."""
    for field in progress(FIELDS, 'networks'):
        for bar in (True, False):
            yield figures(field, bar, runs, np.random.default_rng(seed))


def figures(field: Field, bar: bool, runs: int, rng: np.random.Generator) -> dict[str, Any]:
    """Return how often the test is right, for one field; movements in a quarter of the runs."""
    from scipy.stats import f, ncf

    xyz = rng.uniform(-0.5, 0.5, (field.targets, 3)) * field.extent
    make = Adjusted if field.adjusted else Epoch
    epochs = [make(xyz, field.photographs, bar, rng) for _ in range(2)]
    still = np.zeros_like(xyz)
    alarms, by_sum = [], []
    for _ in range(runs):
        found = compare(*(epoch.measured(still, rng) for epoch in epochs))
        alarms.append(not found.congruent)
        by_sum.append(found.tests[0].probability < LEVEL)

    exact = [points_of(xyz, it.covariance, it.redundancy, bar) for it in epochs]
    covariances = np.array([it.covariance for it in compare(*exact).movements])
    against_others = differences(xyz, epochs[0].covariance + epochs[1].covariance, bar)
    degrees = sum(it.redundancy for it in epochs)
    critical = f.isf(LEVEL * 0.9 / field.targets, 3, degrees)
    shares: dict[str, float] = {}
    for kind, sigmas in (('', against_others), ('conditional_', covariances)):
        hits, bounds = [], []
        for _ in range(runs // 4):
            target, movement = int(rng.integers(field.targets)), still.copy()
            movement[target] = _movement(sigmas[target], SIGMAS, rng)
            strength = movement[target] @ np.linalg.solve(covariances[target], movement[target])
            bounds.append(ncf.sf(critical, 3, degrees, strength))
            found = compare(epochs[0].measured(still, rng), epochs[1].measured(movement, rng))
            first = found.moved[:1] == (f'{target}',)
            hits.append((not found.congruent, first, first and len(found.moved) == 1))
        outcomes = dict(zip(_OUTCOMES[:3], np.mean(hits, axis=0), strict=True))
        outcomes['bound'] = np.mean(bounds)
        shares |= {f'{kind}{name}': float(value) for name, value in outcomes.items()}
    quarters = []
    for _ in range(runs // 20):
        several = rng.permutation(field.targets)[: max(field.targets // 4, 2)]
        direction = rng.standard_normal(3)
        sigma = np.sqrt(np.linalg.eigvalsh(covariances[several])[:, -1].max())
        movement = still.copy()
        movement[several] = 10 * sigma * direction / np.linalg.norm(direction)
        found = compare(epochs[0].measured(still, rng), epochs[1].measured(movement, rng))
        quarters.append(set(found.moved) == {f'{index}' for index in several})
    return {
        'field': field.name,
        'targets': field.targets,
        'photographs': field.photographs,
        'scale': 'fixed' if bar else 'free',
        'redundancy': degrees,
        'false_alarms': float(np.mean(alarms)),
        'false_alarms_of_sum': float(np.mean(by_sum)),
        **shares,
        'quarter': float(np.mean(quarters)),
    }


def _movement(covariance: FloatArray, sigmas: float, rng: np.random.Generator) -> FloatArray:
    """Return a movement in any direction, of some standard deviations in this direction."""
    direction = rng.standard_normal(3)
    direction /= np.linalg.norm(direction)
    return sigmas * np.sqrt(direction @ covariance @ direction) * direction


def table(seeds: Sequence[int], runs: int = RUNS) -> list[str]:
    """Return the lines of the table, with `runs` pairs of epochs without movement a row."""
    kinds = [f'{kind}{name}' for kind in ('', 'conditional_') for name in _OUTCOMES]
    shares = ['false_alarms', 'false_alarms_of_sum', *kinds, 'quarter']
    head = 'field', 'targets', 'photographs', 'scale', 'redundancy'
    rows = [
        [*(row[name] for name in head), *(f'{100 * row[name]:.1f}' for name in shares)]
        for seed in seeds
        for row in cases(runs, seed)
    ]
    titles = [f'{name.replace("_", " ")} %' for name in shares]
    lines = markdown([*head, *titles], rows)
    return [*lines, '', f'{runs} runs a row, seeds {", ".join(map(str, seeds))}.']


class _Named(NamedTuple):
    """The largest log likelihood ratio and share of each pair of epochs, and whose they are."""

    ratio: FloatArray
    by_ratio: IntArray
    share: FloatArray
    by_share: IntArray


def optimum_table(seeds: Sequence[int], runs: int) -> list[str]:
    """Return the bounds for each field that `network_epochs` simulates, by `runs` pairs each."""
    rows = [
        (
            field.name,
            field.targets,
            'fixed' if bar else 'free',
            *(number(100 * share, 1) for share in located(field, bar, seed, runs)),
        )
        for seed in seeds
        for field in progress([one for one in FIELDS if not one.adjusted], 'networks')
        for bar in (True, False)
    ]
    head = 'field', 'targets', 'scale', 'located at most %', 'located by largest share %'
    return [*markdown(head, rows), '', f'{runs} pairs of epochs a row.']


def located(field: Field, bar: bool, seed: int, runs: int) -> tuple[float, float]:
    """Return how often the most powerful test, and that of the largest share, are right."""
    random = np.random.default_rng(seed)
    xyz = random.uniform(-0.5, 0.5, (field.targets, 3)) * field.extent
    epochs = [Epoch(xyz, field.photographs, bar, random) for _ in range(2)]
    covariance = sum((it.covariance for it in epochs), np.zeros((3 * len(xyz),) * 2))
    values, vectors = np.linalg.eigh(covariance)
    datum = movements(xyz, not bar).shape[1]  # directions without variance, the first ones
    whole = vectors[:, datum:] / values[datum:] @ vectors[:, datum:].T
    root = vectors[:, datum:] / np.sqrt(values[datum:])
    sigmas = differences(xyz, covariance, bar)
    towards = random.standard_normal((DIRECTIONS, 3))
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    sizes = SIGMAS * np.sqrt(np.einsum('ei,nij,ej->ne', towards, sigmas, towards))
    steps = sizes[..., None] * towards

    def named(pulls: FloatArray) -> _Named:
        own, each = blocks(whole), pulls.reshape(len(pulls), -1, 3)
        half = np.einsum('nei,nij,nej->ne', steps, own, steps) / 2
        ratios = np.einsum('rni,nei->rne', each, steps) - half
        peaks = ratios.max(axis=2)
        ratios = peaks + np.log(np.exp(ratios - peaks[..., None]).mean(axis=2))
        shares = np.einsum('rni,nij,rnj->rn', each, np.linalg.inv(own), each)
        return _Named(ratios.max(1), ratios.argmax(1), shares.max(1), shares.argmax(1))

    still, moved, right = [], [], []
    for _ in range(runs // PART):
        errors = random.standard_normal((2, PART, root.shape[1])) @ root.T
        target = random.integers(len(xyz), size=PART)
        step = steps[target, random.integers(DIRECTIONS, size=PART)]
        pulled = whole.reshape(-1, len(xyz), 3)[:, target]
        still.append(named(errors[0]))
        moved.append(named(errors[1] + np.einsum('xrj,rj->rx', pulled, step)))
        right.append(target)
    nothing, found = (_Named(*map(np.concatenate, zip(*it, strict=True))) for it in (still, moved))
    targets = np.concatenate(right)
    by_ratio = (found.ratio > np.quantile(nothing.ratio, 1 - LEVEL)) & (found.by_ratio == targets)
    by_share = (found.share > np.quantile(nothing.share, 1 - LEVEL)) & (found.by_share == targets)
    return float(by_ratio.mean()), float(by_share.mean())
