"""How often any test of 5 % false alarms can locate a movement of 5 sigma: an upper bound.

    python -m benchmarks.network --table optimum [--seed 301] [--runs 20000]

Networks and movements are those of `network_epochs`: one target, any, in any direction. Among all
tests with the same share of false alarms, the one that names the target of the largest likelihood
ratio, if that exceeds a bound, names the right one most often (Neyman and Pearson 1933). It knows
how far a target moves and in which directions, and `compare` knows neither. *Largest share* is the
test of single targets, which does not, with the bound that gives exactly 5 % false alarms.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ahf_ros.orientation.congruence import LEVEL
from ahf_ros.orientation.datum import movements
from ahf_ros.orientation.network import FloatArray, IntArray
from ahf_ros.orientation.points import blocks
from benchmarks.network_epochs import FIELDS, SIGMAS, Epoch, Field, differences
from benchmarks.report import number, progress
from benchmarks.report import table as markdown

DIRECTIONS = 300
PART = 200
"""Pairs of epochs that are computed at a time."""


class _Named(NamedTuple):
    """The largest log likelihood ratio and share of each pair of epochs, and whose they are."""

    ratio: FloatArray
    by_ratio: IntArray
    share: FloatArray
    by_share: IntArray


def table(seeds: Sequence[int], runs: int) -> list[str]:
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
