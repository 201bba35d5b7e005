"""Figures of poses of single images, and of scans around an object that are registered.

    python -m benchmarks.registration --table TABLE [--seed 301] [--runs N]

`pose` asks whether poses are as exact as their covariances say, and how long they take; `scans`
registers scans by the targets that neighbours share. Of these, `drawn` targets have errors drawn
from their covariances; those of `clouds` are measured in simulated clouds, as ~/target_points are,
so that their covariances are estimated, too.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ahf_ros.clouds.registration.scan import Scan
from ahf_ros.clouds.registration.session import Registration
from ahf_ros.network.network import FloatArray
from ahf_ros.network.pose import Pose
from ahf_ros.network.single_image import resect
from ahf_ros.network.transform import Transform
from benchmarks.report import print_chosen, table
from support.poses import CAMERA, View, normalised_square, view, with_wrong_id
from support.scans import clouds, drawn, ring, squared_error, station

FIELDS = {
    'plane': (1.0, 0.0),
    'nearly a plane': (1.0, 0.03),
    'relief': (1.0, 0.15),
    'space': (1.0, 0.5),
    'small plane': (0.1, 0.0),
    'nearly a small plane': (0.1, 0.002),
}
"""Width and half the depth of fields of targets, m. Small ones hardly show perspective."""


@dataclass
class Counts:
    """What becomes of the images of a row."""

    squares: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    refused: int = 0
    ambiguous: int = 0
    flipped: int = 0  # wrong ones that are not marked
    named: int = 0
    wrong: int = 0
    good_rejected: int = 0
    moved: float = 0.0  # by wrong IDs, in standard deviations


def posed(width: float, depth: float, seed: int, runs: int) -> Counts:
    """Return the counts of images of a field; five in a hundred have a wrong ID."""
    counts = Counts()
    for number in range(runs):
        random = np.random.default_rng([seed, round(1e4 * width), round(1e4 * depth), number])
        of = view(width, depth, random)
        if number % 20 == 0:
            of = with_wrong_id(of, random)
        begin = time.process_time()
        try:
            pose = resect(of.targets, of.points, CAMERA)
        except ValueError:
            counts.refused += 1
            continue
        finally:
            counts.seconds.append(time.process_time() - begin)
        _count(counts, of, pose)
    return counts


def _count(counts: Counts, of: View, pose: Pose) -> None:
    left_out = {it.target for it in pose.rejected}
    counts.good_rejected += len(left_out - {of.wrong})
    if of.wrong:
        counts.wrong += 1
        counts.named += of.wrong in left_out
        others = [it for it in of.targets if str(it.id) != of.wrong]
        without = resect(others, of.points, CAMERA)
        counts.moved = max(counts.moved, normalised_square(pose.camera, without.camera) ** 0.5)
    if pose.second:
        counts.ambiguous += 1
        return
    square = normalised_square(pose.camera, of.true)
    counts.flipped += square > 100
    counts.squares.append(square)


def pose_table(seed: int, runs: int) -> list[str]:
    """Return the figures of each field as lines of Markdown."""
    rows = []
    warm = view(1.0, 0.0, np.random.default_rng(seed))
    resect(warm.targets, warm.points, CAMERA)
    for name, (width, depth) in FIELDS.items():
        of = posed(width, depth, seed, runs)
        of.seconds.sort()
        rows.append(
            (
                *(name, runs, f'{np.mean(of.squares):.2f}', of.refused, of.ambiguous, of.flipped),
                *(f'{of.named} of {of.wrong}', f'{of.moved:.1e}', of.good_rejected),
                f'{1e3 * np.mean(of.seconds):.1f}, {1e3 * of.seconds[-1]:.1f}',
            )
        )
    head = (
        *('field', 'images', 'NEES of 6', 'refused', 'marked as ambiguous', 'beyond 10 sigma'),
        *('wrong IDs named', 'largest shift by them, sigma', 'good left out'),
        'processor time, ms: mean, most',
    )
    return table(head, rows)


COUNT = 20
"""Number of scans around the object."""

COMMON = 6
"""Number of targets that two neighbours share."""

Measure = Callable[[Sequence[str], FloatArray, Transform, np.random.Generator], Scan]


@dataclass
class Figures:
    """What all runs came to; lengths in mm."""

    chain: list[list[float]] = field(default_factory=list)  # squared errors of each scan
    adjusted: list[list[float]] = field(default_factory=list)
    closing: list[float] = field(default_factory=list)  # squared gap over its covariance
    before: list[float] = field(default_factory=list)  # gap
    after: list[float] = field(default_factory=list)
    sigma0: list[float] = field(default_factory=list)
    refused: int = 0


def registered(measure: Measure, seed: int, runs: int) -> Figures:
    """Return the figures of chains that are adjusted after they close."""
    figures = Figures()
    poses = [station(number, COUNT) for number in range(COUNT)]
    true = [poses[0].inverse @ it for it in poses]
    for number in range(runs):
        random = np.random.default_rng([seed, number])
        groups = ring(COUNT, COMMON, random)
        scans = []
        for place, pose in enumerate(poses):
            seen = [(place - 1) % COUNT, place]
            names = [f'{100 * group + it}' for group in seen for it in range(COMMON)]
            scans.append(measure(names, groups[seen].reshape(-1, 3), pose, random))
        try:
            _register(figures, scans, true)
        except ValueError:
            figures.refused += 1
    return figures


def _register(figures: Figures, scans: Sequence[Scan], true: Sequence[Transform]) -> None:
    """Add the figures of one object, whose last scan closes the chain."""
    shared = [name for name in scans[-1].names if name in scans[0].names]
    registration = Registration()
    for scan in scans[:-1]:
        registration.add(scan)
    last = registration.add(scans[-1].without(shared)).transform
    chain = [it.transform for it in registration.field.scans]
    first, end = (it.rows(shared) for it in (scans[0], scans[-1]))
    gap = scans[0].points[first] - last.moved(scans[-1].points[end])
    changes = last.changes(scans[-1].points[end]).reshape(-1, 6)
    covariance = changes @ last.covariance @ changes.T
    own = scans[0].covariances[first] + last.turned(scans[-1].covariances[end])
    for row, block in enumerate(own):
        covariance[3 * row : 3 * row + 3, 3 * row : 3 * row + 3] += block
    registration.undo()
    registration.add(scans[-1])
    adjusted = registration.adjust()
    poses = [it.transform for it in registration.field.scans]
    after = scans[0].points[first] - poses[-1].moved(scans[-1].points[end])
    figures.closing.append(float(gap.ravel() @ np.linalg.solve(covariance, gap.ravel())))
    figures.before.append(1e3 * float(np.linalg.norm(gap.mean(axis=0))))
    figures.after.append(1e3 * float(np.linalg.norm(after.mean(axis=0))))
    figures.sigma0.append(adjusted.sigma0)
    for squares, found in ((figures.chain, chain), (figures.adjusted, poses)):
        squares.append([squared_error(a, b) for a, b in zip(found[1:], true[1:], strict=True)])


def scans_table(seed: int, runs: int) -> list[str]:
    """Return the figures of both kinds of targets as lines of Markdown.

    Objects of `clouds` are a tenth as many: they take five times as long.
    """
    lines = [
        '| targets | objects | refused | NEES of 6 in the chain: mean, least, most of a scan '
        f'| after the adjustment | NEES of {3 * COMMON} where the chain closes '
        '| gap there, mm: mean, most | after the adjustment | sigma0 |',
        '|---' * 9 + '|',
    ]
    for measure, count in ((drawn, runs), (clouds, -(-runs // 10))):
        lines.append(row(measure.__name__, count, registered(measure, seed, count)))
    return lines


def row(name: str, runs: int, it: Figures) -> str:
    """Return figures as a line of Markdown."""
    squares = ' | '.join(
        f'{np.mean(each):.2f}, {np.mean(each, axis=0).min():.2f}, '
        f'{np.mean(each, axis=0).max():.2f}'
        for each in (it.chain, it.adjusted)
    )
    gaps = ' | '.join(f'{np.mean(each):.3f}, {max(each):.3f}' for each in (it.before, it.after))
    return (
        f'| {name} | {runs} | {it.refused} | {squares} | {np.mean(it.closing):.2f} | {gaps} '
        f'| {np.mean(it.sigma0):.3f} |'
    )


TABLES: dict[str, Callable[[int, int | None], list[str]]] = {
    'pose': lambda seed, runs: pose_table(seed, runs or 1000),
    'scans': lambda seed, runs: scans_table(seed, runs or 1000),
}


if __name__ == '__main__':
    print_chosen(TABLES, __doc__)
