"""Whether covariances, rejections and suspects of networks are right.

    python -m benchmarks.network --table ellipsoids [--seed 301] [--runs 125]

and so on: `ellipsoids` and `lenses` ask how often error ellipsoids hold the truth, `outliers` and
`tails` what is rejected and kept, `still` how often a movement is found where there is none, and
`told` whether the wrong one of several bars or control points is named.

*NEES* is the mean of e' C^+ e over its degrees of freedom, for the errors e of all points after a
similarity and their whole covariance C: 1 if standard deviations are right.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ahf_ros.network.adjustment import adjust
from ahf_ros.network.camera import PARAMETERS, project
from ahf_ros.network.congruence import compare
from ahf_ros.network.knowledge import Known
from ahf_ros.network.measurement import distances
from ahf_ros.network.network import ControlPoint, Network, ScaleBar
from ahf_ros.network.points import MeasuredPoints, entries
from ahf_ros.network.refinement import refine
from ahf_ros.network.similarity import similarity_between
from ahf_ros.network.solution import NetworkState, Solution
from ahf_ros.network.suspects import Misclosures
from benchmarks.report import number, progress
from benchmarks.report import table as markdown
from support.network_scenes import HEIGHT, LENS, WIDTH, Field, approximate, simulate

CHI_SQUARE = 7.814728  # 95 % of three degrees
RELEASED = ('f', 'cx', 'cy', 'k1', 'k2', 'p1', 'p2')
SIZES = (8, 15, 30, 60)
"""Photographs of networks."""

WRONG = 0.05
"""Share of wrong IDs."""

FAR = 5.0
"""Standard deviations of a wrong observation that must not be accepted."""

SIZE = Field(36, 108)
FREEDOM = 5.0
GROSS, LARGE = 0.01, 6.0
TOLD = (
    *(('bars', count, 1e-4, 1e-4) for count in (3, 4, 5)),
    *(('control points', count, 1e-4, 1e-4) for count in (4, 5, 6, 8)),
    *(('control points', count, 0.0, 0.0) for count in (4, 5, 6, 8)),
    *(('control points', 8, 0.0, real) for real in (1e-4, 1e-3)),
)
"""What is told, how many, and the standard deviation that is said and had, for a field of 2."""
_RANK = 1e-10  # of eigenvalues of a covariance without a datum, relative to the largest


def ellipsoids_table(seeds: Sequence[int], runs: int = 125) -> list[str]:
    """Return coverage of 95 % ellipsoids as lines of Markdown: runs of each size and field.

    The truth is brought into the datum of the solution, inner constraints on all points, by the
    similarity of least squares.
    """
    rows = []
    for planar in (True, False):
        for photographs in SIZES:
            field = Field(photographs, targets=25, planar=planar)
            held: tuple[list[float], list[float]] = ([], [])
            sigma0 = []
            for run in range(runs):
                random = np.random.default_rng([seeds[0], photographs, planar, run])
                network, truth = simulate(field, random)
                start = approximate(truth, random)
                given = adjust(network, start, release=RELEASED, test=False)
                held[0].append(coverage(given, truth))
                sigma0.append(given.sigma0)
                if run < runs // 5:
                    held[1].append(coverage(adjust(network, start), truth))
            shares = [f'{100 * np.mean(it):.1f}' for it in held]
            shares[1] += f' ({len(held[1])} runs)'
            name = 'planar' if planar else '3-D'
            rows.append((name, photographs, runs, *shares, f'{np.mean(sigma0):.3f}'))
    shares = ['parameters given %', 'all, usual lenses %']
    return markdown(('field', 'photographs', 'runs', *shares, 'sigma0'), rows)


def coverage(solution: Solution, truth: NetworkState) -> float:
    """Return the share of points whose 95 % ellipsoid holds the truth."""
    points = solution.state.points
    found = np.isfinite(points[:, 0])
    movement = similarity_between(truth.points[found], points[found])
    error = points[found] - movement.moved(truth.points[found])
    own = solution.point_covariances[found]
    squares = np.einsum('ni,ni->n', error, np.linalg.solve(own, error[:, :, None])[:, :, 0])
    return float((squares < CHI_SQUARE).mean())


def outliers_table(seeds: Sequence[int], runs: int = 25) -> list[str]:
    """Return what is accepted and kept, as lines of Markdown."""
    rows = []
    for planar in (True, False):
        for photographs in SIZES:
            sums = np.zeros(5, dtype=int)
            for run in range(runs):
                random = np.random.default_rng([seeds[0], photographs, planar, run])
                sums += counted(Field(photographs, 40, planar, each=30), random)
            wrong, accepted, good, kept, named = sums
            start = 'planar' if planar else '3-D', photographs, runs
            rows.append((*start, wrong, accepted, good, f'{100 * kept / good:.2f}', named))
    counts = 'wrong', 'accepted above 5 sigma', 'good', 'kept %', 'moved target named'
    return markdown(('field', 'photographs', 'runs', *counts), rows)


def counted(field: Field, random: np.random.Generator) -> tuple[int, int, int, int, bool]:
    """Return how many are wrong, wrong and accepted, good, good and kept, and if 0 is named."""
    network, truth = simulate(field, random)
    network, second, late = with_moved_target(network, truth, random)
    network, wrong = with_wrong_ids(network, random)
    start = refine(network, approximate(truth, random), ('f', 'k1'))
    solution = adjust(network, start)
    observations, used = network.observations, solution.state.used
    right = (observations.point == 0) & ~wrong
    balance = 2 * (late & right).sum() - right.sum()
    if balance > 0 or (balance == 0 and (used & late & right).any()):
        truth.points[0] = second  # where it is more often is where it is
    computed = project(
        truth.calibrations[0],
        truth.rotations[observations.photograph],
        truth.positions[observations.photograph],
        truth.points[observations.point],
    )
    sigma = np.sqrt(observations.covariance[:, 0, 0])
    large = np.linalg.norm(observations.xy - computed, axis=1) > FAR * sigma
    bad = large | wrong
    named = any(text.startswith('target 0 is at two places') for text in solution.warnings)
    return bad.sum(), (used & large).sum(), (~bad).sum(), (used & ~bad).sum(), named


def with_moved_target(
    network: Network, truth: NetworkState, random: np.random.Generator
) -> tuple[Network, np.ndarray, np.ndarray]:
    """Return a network whose target 0 moves halfway, its second place, and the rows there."""
    observations = network.observations
    rows = np.flatnonzero(observations.point == 0)
    late = rows[len(rows) // 2 :]
    step = random.normal(size=3) * [1, 1, 0.2]
    second = truth.points[0] + 0.1 * step / np.linalg.norm(step)
    photographs = observations.photograph[late]
    before, after = (
        project(
            truth.calibrations[0],
            truth.rotations[photographs],
            truth.positions[photographs],
            np.tile(place, (len(late), 1)),
        )
        for place in (truth.points[0], second)
    )
    xy = observations.xy.copy()
    xy[late] += after - before
    moved_network = replace(network, observations=replace(observations, xy=xy))
    return moved_network, second, np.isin(np.arange(len(xy)), late)


def with_wrong_ids(network: Network, random: np.random.Generator) -> tuple[Network, np.ndarray]:
    """Return a network with 5 % wrong IDs, of targets not in their photograph, and which."""
    observations = network.observations
    point = observations.point.copy()
    wrong = random.random(len(point)) < WRONG
    for row in np.flatnonzero(wrong):
        present = point[observations.photograph == observations.photograph[row]]
        absent = np.setdiff1d(np.arange(1, len(network.targets)), present)
        if len(absent):
            point[row] = random.choice(absent)
        else:
            wrong[row] = False
    return replace(network, observations=replace(observations, point=point)), wrong


def nees(solution: Solution, truth: NetworkState) -> float:
    """Return the normalised squared error of all points over its degrees of freedom."""
    some = np.flatnonzero(solution.determined)
    points, rows = solution.state.points[some], entries(some)
    moved = similarity_between(truth.points[some], points).moved(truth.points[some])
    values, vectors = np.linalg.eigh(solution.covariance_of_points[np.ix_(rows, rows)])
    real = values > _RANK * values[-1]
    along = (vectors.T @ (points - moved).ravel())[real]
    return float(np.mean(along**2 / values[real]))


def lenses_table(seeds: Sequence[int], runs: int) -> list[str]:
    """Return whether standard deviations hold where lenses have all parameters."""
    rows = []
    for cameras, rolled in ((1, True), (1, False), (2, True), (2, False)):
        field = replace(SIZE, rolled=rolled)
        found = []
        for run in progress(range(runs), f'{cameras} cameras, rolled: {rolled}'):
            random = np.random.default_rng([seeds[0], cameras, rolled, run])
            network, truth = simulate(field, random, _lenses(cameras, random))
            solution = adjust(network, approximate(truth, random, 0.005))
            sigma = np.sqrt([np.diag(it) for it in solution.camera_covariances])
            errors = np.abs(solution.state.calibrations - truth.calibrations) / sigma
            lost = len(network.observations.xy) - int(solution.state.used.sum())
            found.append(
                (nees(solution, truth), 100 * coverage(solution, truth), (errors > 3).mean(), lost)
            )
        means = np.mean(found, axis=0)
        spread = np.std([it[0] for it in found]) / np.sqrt(runs)
        rows.append(
            (
                cameras,
                'some' if rolled else 'none',
                runs,
                f'{means[0]:.3f} +- {spread:.3f}',
                number(means[1], 1),
                number(100 * means[2], 2),
                int(np.sum([it[3] for it in found])),
            )
        )
    head = (
        *('cameras', 'rolls', 'runs', 'NEES', 'in 95 % ellipsoids %'),
        *('parameters off by 3 sigma %', 'good rays lost'),
    )
    return markdown(head, rows)


def _lenses(cameras: int, random: np.random.Generator) -> np.ndarray:
    """Return calibrations whose every parameter differs by 5 to 100 sigma from nothing."""
    sigma = np.array([0.08, 0.1, 0.1, 1.7e-4, 1.1e-3, 2.2e-3, 8e-6, 8e-6, 2e-6, 2e-6])
    signs = random.choice([-1, 1], (cameras, len(PARAMETERS)))
    sizes = 5 * 20 ** random.random((cameras, len(PARAMETERS)))
    middle = np.array([LENS[0], (WIDTH - 1) / 2, (HEIGHT - 1) / 2, *np.zeros(7)])
    return middle + signs * sizes * sigma


def still_table(seeds: Sequence[int], runs: int) -> list[str]:
    """Return how often two epochs without movement seem to have one; all but targets is new."""
    alarms = np.zeros(2, int)
    for run in progress(range(runs), 'pairs of epochs'):
        random = np.random.default_rng([seeds[0], run])
        targets = random.uniform(-1, 1, (40, 3)) * [1, 1, 0.5]
        epochs = []
        for _ in range(2):
            lens = _lenses(1, random)
            network, truth = simulate(Field(16, 40), random, lens, targets)
            epochs.append(adjust(network, approximate(truth, random, 0.005)).measured_points)
        found = compare(*epochs)
        alarms += [not found.congruent, bool(found.moved)]
    shares = [number(100 * it / runs, 1) for it in alarms]
    return markdown(('pairs', 'false alarms %', 'with a target named %'), [(runs, *shares)])


def tails_table(seeds: Sequence[int], runs: int) -> list[str]:
    """Return what is kept and found where errors have heavy tails and some are gross."""
    rows = []
    for name, freedom in (('normal', np.inf), ('t of 5', FREEDOM)):
        found = []
        for run in progress(range(runs), name):
            random = np.random.default_rng([seeds[0], int(min(freedom, 99)), run])
            network, truth = simulate(Field(24, 60), random)
            network, gross, large = _disturbed(network, truth, freedom, random)
            start = approximate(truth, random, 0.005)
            solution = adjust(network, start)
            knowing = adjust(network, replace(start, used=~gross), test=False)
            used = solution.state.used
            found.append(
                (
                    (used & ~gross).sum(),
                    (~gross).sum(),
                    (~used & large).sum(),
                    large.sum(),
                    _rms(solution, truth),
                    _rms(knowing, truth),
                    nees(solution, truth),
                    solution.expected_rejections,
                )
            )
        kept, good, caught, wrong, rms, best, squares, expected = np.array(found).T
        rows.append(
            (
                name,
                runs,
                number(100 * kept.sum() / good.sum(), 2),
                number(100 * caught.sum() / wrong.sum(), 2),
                number(np.sqrt((rms**2).mean() / (best**2).mean()), 3),
                number(1 / np.sqrt(squares.mean()), 3),
                int((good - kept).sum()),
                number(expected.sum(), 1),
            )
        )
    head = (
        *('errors', 'runs', 'good rays kept %', 'gross above 6 sigma found %'),
        *('RMS to that of knowing', 'stated to real sigma', 'good lost', 'expected lost'),
    )
    return markdown(head, rows)


def _disturbed(
    network: Network, truth: NetworkState, freedom: float, random: np.random.Generator
) -> tuple[Network, np.ndarray, np.ndarray]:
    """Return a network with t-distributed errors and gross ones, which, and which are large."""
    seen = network.observations
    sigma = np.sqrt(seen.covariance[:, 0, 0])
    count = len(sigma)
    chi = random.chisquare(FREEDOM, count) / FREEDOM if np.isfinite(freedom) else np.ones(count)
    exact = _exact(network, truth)
    error = (seen.xy - exact) / np.sqrt(chi)[:, None]
    deviation = sigma * (np.sqrt(freedom / (freedom - 2)) if np.isfinite(freedom) else 1.0)
    gross = random.random(count) < GROSS
    towards = random.standard_normal((count, 2))
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    size = deviation * 3 * 100 ** random.random(count)
    error += np.where(gross, size, 0)[:, None] * towards
    large = gross & (np.linalg.norm(error, axis=1) > LARGE * deviation)
    return replace(network, observations=replace(seen, xy=exact + error)), gross, large


def _exact(network: Network, truth: NetworkState) -> np.ndarray:
    """Return the image points (m, 2) without errors."""
    seen = network.observations
    return project(
        truth.calibrations[network.camera_of[seen.photograph]],
        truth.rotations[seen.photograph],
        truth.positions[seen.photograph],
        truth.points[seen.point],
    )


def _rms(solution: Solution, truth: NetworkState) -> float:
    some = solution.determined
    points = solution.state.points[some]
    moved = similarity_between(truth.points[some], points).moved(truth.points[some])
    return float(np.sqrt(((points - moved) ** 2).mean()))


def told_table(seeds: Sequence[int], runs: int) -> list[str]:
    """Return how often a wrong bar or control point is named, and nothing else.

    Apart are errors that leave more than 6 sigma whichever other one is left out instead.
    """
    rows = []
    for kind, count, sigma, real in TOLD:
        found = []
        for run in progress(range(runs), kind):
            random = np.random.default_rng(
                [*seeds, len(kind), count, sigma > 0, round(1e6 * real), run]
            )
            network, truth = simulate(Field(12, 40), random)
            images = adjust(network, approximate(truth, random, 0.005))
            alone = images.measured_points
            told, wrong, size = _told(kind, count, (sigma, real), truth, alone, random)
            network = replace(network, **told)
            solution = adjust(network, images.state)
            clear = [it.name for it in solution.suspects if not it.rivals]
            either = {name for it in solution.suspects for name in (it.name, *it.rivals)}
            found.append(
                (
                    size > LARGE,
                    _separation(network, truth, alone, real**2 - sigma**2) > LARGE,
                    wrong in clear,
                    wrong in either and wrong not in clear,
                    sum(name != wrong for name in clear),
                    len(network.observations.xy) - int(solution.state.used.sum()),
                )
            )
        large, apart, named, unclear, good, rays = np.array(found).T
        large, apart = large > 0, (large * apart) > 0
        rows.append(
            (
                *(f'{count} {kind}', f'{sigma:g}', f'{real:g}', runs, large.sum()),
                *(number(100 * it[large].mean(), 1) for it in (named, unclear)),
                *(apart.sum(), number(100 * named[apart].mean(), 1), good.sum(), rays.sum()),
            )
        )
    head = (
        *('told', 'sigma', 'real', 'runs', 'wrong by over 6 sigma', 'named %', 'among rivals %'),
        *('of them apart', 'named %', 'good ones named', 'rays lost'),
    )
    return markdown(head, rows)


def _separation(
    network: Network, truth: NetworkState, alone: MeasuredPoints, added: float
) -> float:
    """Return by how many sigma the error of the first one differs from any of another one.

    Variances of what is told are larger than it is said by `added`.
    """
    rows = {name: row for row, name in enumerate(alone.names)}
    points = truth.points[[int(name) for name in alone.names]]
    covariance = similarity_between(alone.xyz, points).turned(alone.covariance)
    known = Known(
        network.bars,
        np.array([[rows[end] for end in bar.ends] for bar in network.bars], int).reshape(-1, 2),
        network.control,
        np.array([rows[it.name] for it in network.control], int),
        np.array([], int),
        None,
        (np.array([], int), np.array([]), np.array([])),
    )
    closures = Misclosures.of(known, points, covariance)
    error = np.where(closures.group == 0, closures.gaps, 0)
    left = []
    for other in range(1, len(closures.names)):
        kept = np.delete(np.arange(len(closures.names)), other)
        some = error[np.isin(closures.group, kept)]
        left.append(closures.weights(kept, kept).whole(some, added))
    return float(np.sqrt(min(left)))


def _told(
    kind: str,
    count: int,
    sigmas: tuple[float, float],
    truth: NetworkState,
    alone: MeasuredPoints,
    random: np.random.Generator,
) -> tuple[dict[str, Any], str, float]:
    """Return what is told, which of it is wrong, and by how many standard deviations.

    These are of what is told and of the photographs alone, together. Of `sigmas`, the first is
    said and the second real.
    """
    sigma, real = sigmas
    size = 4 * 100 ** random.random()
    names = [str(it) for it in random.permutation(len(truth.points))]
    if kind == 'bars':
        pairs = list(zip(names[:count], names[count : 2 * count], strict=True))
        lengths = [np.linalg.norm(truth.points[int(a)] - truth.points[int(b)]) for a, b in pairs]
        together = np.hypot(real, distances(alone, pairs[:1])[0].sigma)
        errors = random.normal(0, real, count)
        errors[0] += size * together * random.choice([-1, 1])
        bars = [
            ScaleBar(pair, float(length + error), sigma)
            for pair, length, error in zip(pairs, lengths, errors, strict=True)
        ]
        return {'bars': tuple(bars), 'unit': 'm'}, f'scale bar {"-".join(pairs[0])}', size
    towards = random.standard_normal(3)
    towards /= np.linalg.norm(towards)
    together = np.sqrt(real**2 + towards @ alone.chosen(names[:1]).covariance @ towards)
    control = tuple(
        ControlPoint(
            name,
            truth.points[int(name)]
            + random.normal(0, real, 3)
            + (place == 0) * size * together * towards,
            sigma**2 * np.eye(3),
        )
        for place, name in enumerate(names[:count])
    )
    return {'control': control, 'unit': 'm'}, f'control point {names[0]}', size
