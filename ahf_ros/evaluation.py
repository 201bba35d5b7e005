"""What was identified against what is there: C, R, D, wrong IDs, false positives, RMSE.

The counts are those of the paper [1]_: of N targets that an image shows, n are reported, I of the
reported ones are targets that are there, and d of those have the right ID;

    C = I / n,    R = I / N,    D = d / N.

References
----------
.. [1] Shang & Liu, Remote Sens. 2023, 15, 3151.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ahf_ros.target import UNDECODED, Target, TrueTarget, Truth

TOLERANCE = 5.0
"""Distance within which a reported target is the one that is there, px."""

RIGHT = 'right'
"""A report with the ID of the target that is there; one for every target."""

WRONG = 'wrong'
"""A report with an ID, at the place of a target that has another one."""

FOUND = 'found'
"""A report without an ID at the place of a target that no other report has found."""

FALSE = 'false'
"""Any other report: there is no target, or it has been reported already."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a report is.

    Attributes
    ----------
    kind : str
        `RIGHT`, `WRONG`, `FOUND` or `FALSE`.
    target : TrueTarget or None
        What is there.
    """

    kind: str
    target: TrueTarget | None = None


@dataclass(frozen=True, slots=True)
class Score:
    """The figures of one image, or of several together.

    Attributes
    ----------
    expected : int
        N, the confirmed targets.
    reported : int
        n, the reported targets, without those that are right or found, but not confirmed.
    found : int
        I, the confirmed targets that were reported, under whatever ID.
    right : int
        d, those of them with the right ID.
    wrong : int
        Reports with the ID of another target.
    false_positives : int
        Reports where there is no target, or again where there is one.
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
        """C = I / n; None where n is 0."""
        return self.found / self.reported if self.reported else None

    @property
    def recall(self) -> float | None:
        """R = I / N; None where N is 0."""
        return self.found / self.expected if self.expected else None

    @property
    def decoding(self) -> float | None:
        """D = d / N; None where N is 0."""
        return self.right / self.expected if self.expected else None

    @property
    def rmse(self) -> tuple[float, float, float] | None:
        """Root mean square of the errors in x, in y and of their length, px; None without any."""
        if not self.errors:
            return None
        x, y = np.mean(np.square(self.errors), axis=0)
        return math.sqrt(x), math.sqrt(y), math.sqrt(x + y)


def judge(
    truth: Sequence[TrueTarget], reported: Sequence[Target], tolerance: float = TOLERANCE
) -> tuple[Verdict, ...]:
    """Say of each report what it is.

    Nearest pairs come first, so that the order of the reports does not matter: first of reports
    and targets with the same ID, then of the reports that are left and any target.

    Parameters
    ----------
    truth : sequence of TrueTarget
        What the image shows.
    reported : sequence of Target
        What was identified in it.
    tolerance : float
        Largest distance of a report from its target, px.

    Returns
    -------
    tuple of Verdict
        One for each report.

    Raises
    ------
    ValueError
        If `tolerance` is not a number above 0.
    """
    if not tolerance > 0:
        raise ValueError(f'tolerance is {tolerance!r}, accepted is a number above 0')
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


def score(
    truth: Sequence[TrueTarget], reported: Sequence[Target], tolerance: float = TOLERANCE
) -> Score:
    """Return the figures of one image.

    Parameters
    ----------
    truth, reported, tolerance
        As for `judge`.
    """
    verdicts = judge(truth, reported, tolerance)
    kinds = [verdict.kind for verdict in verdicts]
    met = [verdict.target for verdict in verdicts]
    ignored = [
        kind in (RIGHT, FOUND) and target is not None and not target.confirmed
        for kind, target in zip(kinds, met, strict=True)
    ]
    errors = tuple(
        (report.x - target.x, report.y - target.y)
        for report, kind, target in zip(reported, kinds, met, strict=True)
        if kind == RIGHT and target is not None and target.confirmed
    )
    return Score(
        expected=sum(target.confirmed for target in truth),
        reported=len(reported) - sum(ignored),
        found=len({target for target in met if target is not None and target.confirmed}),
        right=len(errors),
        wrong=kinds.count(WRONG),
        false_positives=kinds.count(FALSE),
        errors=errors,
    )


def total(scores: Iterable[Score]) -> Score:
    """Return the figures of several images together: counts add up, errors are pooled."""
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
    """Return the figures of every image of which there is a truth or a result.

    An image without a result has no reported target. An image without a truth shows none, so that
    all that is reported in it is false.

    Parameters
    ----------
    truth : mapping of str to sequence of TrueTarget
        What each image shows.
    results : mapping of str to sequence of Target
        What was identified in each.
    tolerance : float
        Largest distance of a report from its target, px.
    """
    names = dict.fromkeys([*truth, *results])
    return {name: score(truth.get(name, ()), results.get(name, ()), tolerance) for name in names}


def table(scores: Mapping[str, Score]) -> str:
    """Return the figures of images and of all of them together as text, one line each.

    Parameters
    ----------
    scores : mapping of str to Score
        Figures by the name of the image.
    """
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
        name,
        *map(str, counts),
        *('-' if share is None else f'{100 * share:.1f}' for share in shares),
        str(item.wrong),
        str(item.false_positives),
        *(('-',) * 3 if item.rmse is None else (f'{error:.4f}' for error in item.rmse)),
    )


def _pairs(
    truth: Sequence[TrueTarget], reported: Sequence[Target], tolerance: float
) -> list[tuple[int, int]]:
    """Return the indices of reports and targets within the tolerance, the nearest first."""
    true_places = np.array([(target.x, target.y) for target in truth]).reshape(-1, 2)
    places = np.array([(target.x, target.y) for target in reported]).reshape(-1, 2)
    distances = np.linalg.norm(places[:, None] - true_places, axis=2)
    near = np.argwhere(distances <= tolerance)
    order = np.argsort(distances[distances <= tolerance], kind='stable')
    return [(int(report), int(target)) for report, target in near[order]]
