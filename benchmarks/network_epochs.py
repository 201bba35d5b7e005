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

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ahf_ros.orientation.adjustment import adjust
from ahf_ros.orientation.camera import (
    PARAMETERS,
    linearise,
    pinhole,
    project,
    rotation_matrices,
)
from ahf_ros.orientation.congruence import LEVEL, compare
from ahf_ros.orientation.datum import movements, s_transform
from ahf_ros.orientation.network import FloatArray, IntArray, ScaleBar
from ahf_ros.orientation.points import MeasuredPoints, blocks
from ahf_ros.orientation.similarity import Similarity
from ahf_ros.orientation.solution import Solution
from benchmarks.report import number, progress
from benchmarks.report import table as markdown
from support.network_scenes import Field as Scene
from support.network_scenes import simulate

RUNS = 2000
SIGMAS = 5.0
WIDTH, HEIGHT, FOCAL_LENGTH = 4000, 3000, 4200.0
NOISE = 0.05
"""Standard deviation of image points, px."""
BAR_SIGMA = 2e-5
"""Standard deviation of a scale bar, as a share of its length."""
DIRECTIONS = 300
PART = 200
"""Directions of movements, and pairs of epochs that are computed at a time, for the optimum."""
_OUTCOMES = 'found', 'located', 'alone', 'bound'
_RELEASED = 'f', 'cx', 'cy', 'k1', 'k2', 'p1', 'p2'
_FREE = [PARAMETERS.index(name) for name in ('f', 'k1')]


@dataclass(frozen=True)
class Field:
    """A field of targets, in units of length, and how many photographs are taken of it."""

    name: str
    extent: tuple[float, float, float]
    targets: int
    photographs: int
    adjusted: bool = False
    """Whether every epoch is adjusted, by `adjust`, from image points with errors."""


FIELDS = (
    Field('wall', (1.0, 0.7, 0.0), 20, 10),
    Field('box', (1.0, 0.8, 0.6), 8, 8),
    Field('machine', (1.0, 0.8, 0.6), 24, 16),
    Field('beam', (3.0, 0.2, 0.1), 14, 12),
    Field('hall', (1.0, 1.0, 0.4), 60, 40),
    Field('adjusted', (2.0, 2.0, 1.0), 16, 10, adjusted=True),
)


class Epoch:
    """The linearised adjustment of a bundle: errors of image points in, coordinates out."""

    def __init__(self, xyz: FloatArray, photographs: int, bar: bool, rng: np.random.Generator):
        design = _design(xyz, photographs, rng)
        free = movements(xyz, scale=not bar)
        if bar:
            row = np.zeros((1, design.shape[1]))
            difference = xyz[1] - xyz[0]
            row[0, :3] = -difference / (difference @ difference) / BAR_SIGMA
            row[0, 3:6] = -row[0, :3]
            design = np.vstack([design, row])
        size, count = 3 * len(xyz), design.shape[1]
        border = np.zeros((count, free.shape[1]))
        border[:size] = free
        scale = 1 / np.linalg.norm(design, axis=0)  # so that inverting loses no digits
        border *= scale[:, None]
        border /= np.linalg.norm(border, axis=0)
        normal = (design * scale).T @ (design * scale)
        bordered = np.block([[normal, border], [border.T, np.zeros((free.shape[1],) * 2)]])
        inverse = np.linalg.inv(bordered)[:count, :count] * scale[:, None] * scale
        self.xyz, self.bar, self.design = xyz, bar, design
        self.gain = inverse @ design.T
        self.covariance = inverse[:size, :size]
        self.redundancy = len(design) - count + free.shape[1]

    def measured(self, moved: FloatArray, rng: np.random.Generator) -> MeasuredPoints:
        """Return coordinates of targets that have moved by (n, 3), in a frame of the epoch."""
        errors = rng.standard_normal(len(self.design))
        change = self.gain @ errors
        variance = errors @ (errors - self.design @ change) / self.redundancy
        xyz = self.xyz + moved + change[: self.xyz.size].reshape(-1, 3)
        points = _points(self.xyz, self.covariance, self.redundancy, self.bar, variance)
        return _turned(replace(points, xyz=xyz), rng)


class Adjusted:
    """The same by `adjust`: errors of image points in, coordinates out."""

    def __init__(self, xyz: FloatArray, photographs: int, bar: bool, rng: np.random.Generator):
        network, start = simulate(Scene(photographs, len(xyz)), rng)
        self.xyz, self.bar, self.network = xyz, bar, network
        self.start = replace(start, points=xyz)
        exact = self._adjusted(np.zeros_like(xyz), rng).measured_points
        self.covariance, self.redundancy = exact.cofactors, exact.redundancy

    def measured(self, moved: FloatArray, rng: np.random.Generator) -> MeasuredPoints:
        """Return coordinates of targets that have moved by (n, 3), in a frame of the epoch."""
        return _turned(self._adjusted(moved, rng).measured_points, rng)

    def _adjusted(self, moved: FloatArray, rng: np.random.Generator) -> Solution:
        seen, start = self.network.observations, replace(self.start, points=self.xyz + moved)
        poses = start.rotations[seen.photograph], start.positions[seen.photograph]
        exact = project(start.calibrations[0], *poses, start.points[seen.point])
        noise = np.sqrt(seen.covariance[:, :1, 0]) * rng.standard_normal(exact.shape)
        network = replace(self.network, observations=replace(seen, xy=exact + noise))
        if self.bar:
            length = float(np.linalg.norm(start.points[1] - start.points[0]))  # at its epoch
            given = length * (1 + BAR_SIGMA * rng.standard_normal())
            bar = ScaleBar(self.network.targets[:2], given, BAR_SIGMA * length)
            network = replace(network, bars=(bar,), unit='m')
        return adjust(network, start, release=_RELEASED, test=False)


def _points(
    xyz: FloatArray, covariance: FloatArray, redundancy: int, bar: bool, variance: float = 1.0
) -> MeasuredPoints:
    names = tuple(f'{index}' for index in range(len(xyz)))
    unit = 'm' if bar else ''
    return MeasuredPoints(names, xyz, covariance, float(np.sqrt(variance)), redundancy, unit)


def _turned(points: MeasuredPoints, rng: np.random.Generator) -> MeasuredPoints:
    """Return points in another frame, and in another scale where they have none."""
    turn = rotation_matrices(rng.normal(0, 1, (1, 3)))[0]
    scale = 1.0 if points.unit else float(rng.uniform(0.5, 2))
    movement = Similarity(turn, rng.normal(0, 1, 3), scale)
    moved, covariance = movement.moved(points.xyz), movement.turned(points.covariance)
    return replace(points, xyz=moved, covariance=covariance)


def _design(xyz: FloatArray, photographs: int, rng: np.random.Generator) -> FloatArray:
    """Return the derivatives of image points, in their standard deviations, by all unknowns.

    These are the points, the poses, and the focal length and k1 of the camera.
    """
    calibration = pinhole(FOCAL_LENGTH, WIDTH, HEIGHT)
    reach = np.linalg.norm(xyz - xyz.mean(axis=0), axis=1).max()
    distance = 2.3 * FOCAL_LENGTH / HEIGHT * reach
    rows = []
    for index in range(photographs):
        tilt, around = np.radians(rng.uniform(15, 50)), 2 * np.pi * (index + rng.random())
        around /= photographs / 3  # three rounds
        out = np.array(
            [np.sin(tilt) * np.cos(around), np.sin(tilt) * np.sin(around), np.cos(tilt)]
        )
        forward = -out
        right = np.cross([0.0, 1.0, 0.0], forward)
        right /= np.linalg.norm(right)
        upright = np.stack([right, np.cross(forward, right), forward])
        roll = rotation_matrices(np.array([[0, 0, np.pi / 2 * (index % 4)]]))[0]
        seen = linearise(calibration, roll @ upright, xyz.mean(axis=0) + distance * out, xyz)
        block = np.zeros((len(xyz), 2, 3 * len(xyz) + 6 * photographs + len(_FREE)))
        for point in range(len(xyz)):
            block[point, :, 3 * point : 3 * point + 3] = seen.by_point[point]
        start = 3 * len(xyz) + 6 * index
        block[:, :, start : start + 6] = seen.by_pose
        block[:, :, -len(_FREE) :] = seen.by_calibration[:, :, _FREE]
        shown = (seen.xy > 0).all(axis=1) & (seen.xy < (WIDTH, HEIGHT)).all(axis=1)
        shown &= rng.random(len(xyz)) > 0.1
        rows.append(block[shown].reshape(-1, block.shape[2]))
    return np.vstack(rows) / NOISE


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

    exact = [_points(xyz, it.covariance, it.redundancy, bar) for it in epochs]
    covariances = np.array([it.covariance for it in compare(*exact).movements])
    against_others = differences(xyz, epochs[0].covariance + epochs[1].covariance, bar)
    degrees = sum(it.redundancy for it in epochs)
    critical = f.isf(LEVEL * 0.9 / field.targets, 3, degrees)
    shares = {}
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


def differences(xyz: FloatArray, covariance: FloatArray, bar: bool) -> FloatArray:
    """Return the covariances (n, 3, 3) of differences, each in the datum of all other targets."""
    found = []
    for index in range(len(xyz)):
        others = np.arange(len(xyz)) != index
        moved = s_transform(xyz, covariance, others.astype(float), scale=not bar)[1]
        found.append(moved[3 * index : 3 * index + 3, 3 * index : 3 * index + 3])
    return np.array(found)


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
