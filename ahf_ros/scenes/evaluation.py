"""Evaluation of identifications against the truth: C, R, D, wrong IDs, false positives, RMSE.

The counts follow the paper [1]_. An image shows N targets, n are reported, I of these are
there, and d of these have the right ID;

    C = I / n,    R = I / N,    D = d / N.

References
----------
.. [1] Shang & Liu, Remote Sens. 2023, 15, 3151.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ahf_ros.base.deprecation import deprecated_arguments
from ahf_ros.base.target import UNDECODED, Identification, Target, TrueTarget, Truth
from ahf_ros.base.text import printable

if TYPE_CHECKING:
    from ahf_ros.scenes.scene import Rendering

TOLERANCE = 5.0
"""Maximum distance of a report from its target, px."""

MAXIMUM_PAIRS = 4_000_000
"""Maximum number of pairs of a report and a target whose x differ by no more than the tolerance:
0.7 GB of memory."""

RIGHT = 'right'  # a report with the ID of its target; at most one per target
WRONG = 'wrong'  # with another ID than its target has
FOUND = 'found'  # without an ID, of a target that no other report has
FALSE = 'false'  # any other: there is no target, or it was reported already


@dataclass(frozen=True, slots=True)
class Verdict:
    """Judgement of a report, and the target that is there."""

    kind: str  # `RIGHT`, `WRONG`, `FOUND` or `FALSE`
    target: TrueTarget | None = None


@dataclass(frozen=True, slots=True)
class Score:
    """Figures of one image, or of several together.

    Attributes
    ----------
    expected : int
        N, the number of confirmed targets.
    reported : int
        n, the number of reports, except those that are right or found but not confirmed.
    found : int
        I, the number of confirmed targets that were reported with any ID or none.
    right : int
        d, the number of these with the right ID.
    wrong : int
        Number of reports with another ID than their target has.
    false_positives : int
        Number of reports without a target, or of one that was reported already.
    errors : tuple of (float, float)
        Reported minus true (x, y) of the d targets, px.
    """

    expected: int
    reported: int
    found: int
    right: int
    wrong: int
    false_positives: int
    errors: tuple[tuple[float, float], ...] = ()

    @property
    def correctness(self) -> float | None:
        """C = I / n; None if n is 0."""
        return self.found / self.reported if self.reported else None

    @property
    def recall(self) -> float | None:
        """R = I / N; None if N is 0."""
        return self.found / self.expected if self.expected else None

    @property
    def decoding(self) -> float | None:
        """D = d / N; None if N is 0."""
        return self.right / self.expected if self.expected else None

    @property
    def rmse(self) -> tuple[float, float, float] | None:
        """Root mean square errors in x, in y and in both together, px; None without errors."""
        if not self.errors:
            return None
        x, y = np.mean(np.square(self.errors), axis=0)
        return math.sqrt(x), math.sqrt(y), math.sqrt(x + y)


def judge(
    truth: Rendering | Iterable[TrueTarget | Target],
    reported: Iterable[Target],
    *,
    tolerance: float = TOLERANCE,
) -> tuple[Verdict, ...]:
    """Judge each report; the arguments are those of `score`.

    Reports are paired with targets of the same ID first, then the remaining reports with any
    target. The nearest pairs come first, so the order of the reports does not matter.
    """
    if not tolerance > 0:
        raise ValueError(f'tolerance is {tolerance!r}, accepted is a number above 0')
    truth, reported = _true_targets(truth), tuple(reported)
    pairs = _pairs(truth, reported, tolerance)
    verdicts: dict[int, Verdict] = {}
    taken: set[int] = set()
    for report, target in pairs:
        same = reported[report].id == truth[target].id
        if same and report not in verdicts and target not in taken:
            verdicts[report] = Verdict(RIGHT, truth[target])
            taken.add(target)
    for report, target in pairs:
        decoded = reported[report].id != UNDECODED
        repeated = reported[report].id == truth[target].id
        if report not in verdicts and not repeated and (decoded or target not in taken):
            verdicts[report] = Verdict(WRONG if decoded else FOUND, truth[target])
            taken.add(target)
    return tuple(verdicts.get(report, Verdict(FALSE)) for report in range(len(reported)))


@deprecated_arguments(positions=('tolerance',))
def score(
    truth: Rendering | Iterable[TrueTarget | Target],
    reported: Iterable[Target],
    *,
    tolerance: float = TOLERANCE,
) -> Score:
    """Return the figures of one image.

    Parameters
    ----------
    truth : Rendering, or iterable of TrueTarget or Target
        The targets that the image shows.
    reported : Identification, or iterable of Target
        The targets that were identified.
    tolerance : float
        Maximum distance of a report from its target, px.

    Raises
    ------
    ValueError
        If `tolerance` is not a number above 0, or more than `MAXIMUM_PAIRS` are to be compared.

    Examples
    --------
    >>> truth = [TrueTarget(7, 10.0, 10.0), TrueTarget(9, 60.0, 10.0)]
    >>> figures = score(truth, [Target(7, 19, 10.1, 10.0, semi_major=5.0, semi_minor=5.0)])
    >>> figures.right, figures.expected, figures.wrong, figures.false_positives
    (1, 2, 0, 0)
    """
    truth, reported = _true_targets(truth), tuple(reported)
    verdicts = judge(truth, reported, tolerance=tolerance)
    kinds = [verdict.kind for verdict in verdicts]
    met = [
        (report, verdict.kind, verdict.target)
        for report, verdict in zip(reported, verdicts, strict=True)
        if verdict.target is not None
    ]
    ignored = sum(kind != WRONG and not target.confirmed for _, kind, target in met)
    errors = tuple(
        (report.x - target.x, report.y - target.y)
        for report, kind, target in met
        if kind == RIGHT and target.confirmed
    )
    return Score(
        expected=sum(target.confirmed for target in truth),
        reported=len(reported) - ignored,
        found=len({target for _, _, target in met if target.confirmed}),
        right=len(errors),
        wrong=kinds.count(WRONG),
        false_positives=kinds.count(FALSE),
        errors=errors,
    )


def _true_targets(truth: Rendering | Iterable[TrueTarget | Target]) -> tuple[TrueTarget, ...]:
    """Return the truth of a scene, or of targets."""
    targets: Any = getattr(truth, 'targets', truth)
    return tuple(it if isinstance(it, TrueTarget) else TrueTarget.of(it) for it in targets)


def total(scores: Iterable[Score]) -> Score:
    """Return the figures of several images together: counts are added, errors pooled."""
    scores = list(scores)
    return Score(
        expected=sum(item.expected for item in scores),
        reported=sum(item.reported for item in scores),
        found=sum(item.found for item in scores),
        right=sum(item.right for item in scores),
        wrong=sum(item.wrong for item in scores),
        false_positives=sum(item.false_positives for item in scores),
        errors=tuple(error for item in scores for error in item.errors),
    )


def evaluate(
    truth: Truth, results: Mapping[str, Sequence[Target]], tolerance: float = TOLERANCE
) -> dict[str, Score]:
    """Return the figures of every image that has a truth or a result, by its name.

    An image without a result has no reports. An image without a truth shows no targets, so all
    its reports are false.
    """
    names = dict.fromkeys([*truth, *results])
    return {
        name: score(truth.get(name, ()), results.get(name, ()), tolerance=tolerance)
        for name in names
    }


def table(scores: Mapping[str, Score]) -> str:
    """Return a text table of the figures of each image, by name, and of all together."""
    head = ('image', 'N', 'n', 'I', 'd', 'C %', 'R %', 'D %', 'wrong', 'false')
    rows: list[tuple[str, ...]] = [(*head, 'RMSE X px', 'Y', 'XY')]
    rows += [_row(name, item) for name, item in scores.items()]
    rows.append(_row('total', total(scores.values())))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return '\n'.join(
        '  '.join([row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])]) for row in rows
    )


def _row(name: str, item: Score) -> tuple[str, ...]:
    counts = (item.expected, item.reported, item.found, item.right)
    shares = (item.correctness, item.recall, item.decoding)
    return (
        printable(name),
        *map(str, counts),
        *('-' if share is None else f'{100 * share:.1f}' for share in shares),
        str(item.wrong),
        str(item.false_positives),
        *(('-',) * 3 if item.rmse is None else (f'{error:.4f}' for error in item.rmse)),
    )


def _pairs(
    truth: Sequence[TrueTarget], reported: Sequence[Target], tolerance: float
) -> list[tuple[int, int]]:
    """Return pairs of indices of reports and targets within the tolerance, the nearest first."""
    true_centres, centres = (
        np.array([(target.x, target.y) for target in targets], float).reshape(-1, 2)
        for targets in (truth, reported)
    )
    order = np.argsort(true_centres[:, 0], kind='stable')
    columns = true_centres[order, 0]
    first = np.searchsorted(columns, centres[:, 0] - tolerance, 'left')
    counts = np.searchsorted(columns, centres[:, 0] + tolerance, 'right') - first
    if counts.sum() > MAXIMUM_PAIRS:
        raise ValueError(
            f'tolerance is {tolerance:g} px, within which there are {counts.sum()} pairs of '
            f'{len(reported)} reports and {len(truth)} targets in x, accepted are {MAXIMUM_PAIRS}'
        )
    reports = np.repeat(np.arange(len(reported)), counts)
    starts = np.repeat(first - np.concatenate([[0], np.cumsum(counts)[:-1]]), counts)
    targets = order[starts + np.arange(len(reports))]
    distances = np.linalg.norm(centres[reports] - true_centres[targets], axis=1)
    near = np.flatnonzero(distances <= tolerance)
    near = near[np.lexsort((targets[near], reports[near], distances[near]))]
    return list(zip(reports[near].tolist(), targets[near].tolist(), strict=True))


def line(found: Identification, truth: Sequence[Target]) -> str:
    """Return in words how well the targets of an image were identified, and how."""
    figures = score(truth, found)
    words = [
        f'{figures.right} of {figures.expected} right',
        f'{figures.wrong} wrong',
        f'{figures.false_positives} false',
        f'{figures.expected - figures.found} missed',
    ]
    if figures.rmse is not None:
        words.append(f'RMSE {figures.rmse[2]:.3f} px')
    return f'{", ".join(words)}; {method(found)}, {found.filter.duration:.2f} s'


def method(found: Identification) -> str:
    """Return in words which filter led to an identification, and how many trials it took."""
    used = found.filter
    words = 'no filter'
    if used.applied:
        words = f'gamma_high {used.gamma_high:.2f}, gamma_low {used.gamma_low:.2f}'
    return f'{words}, {used.evaluations} trial{"" if used.evaluations == 1 else "s"}'
