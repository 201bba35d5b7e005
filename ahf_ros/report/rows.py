"""What the page knows about each image: rows of numbers and texts, ready for JSON."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from ahf_ros.edge_shift import edge_shift_remark
from ahf_ros.evaluation import FALSE, RIGHT, WRONG, judge
from ahf_ros.report.results import ImageResult
from ahf_ros.target import (
    UNDECODED,
    DottedTarget,
    SquareMarker,
    Target,
    TrueTarget,
    UndecodedTarget,
    count_codes,
)

MAXIMUM_UNREAD = 300
"""Number of dots of an image without any likely code word that are shown."""


def row(
    result: ImageResult,
    families: Sequence[str],
    doubtful_below: float,
    truth: Sequence[TrueTarget] | None = None,
) -> dict[str, Any]:
    """Return what the page knows about an image.

    Parameters
    ----------
    result : ImageResult
    families : sequence of str
        Names of all families of the page; rows have their indices.
    doubtful_below : float
        Confidence below which an identified target counts as doubtful.
    truth : sequence of TrueTarget, optional
        What the image shows.
    """
    decoded = [target for target in result.targets if target.id != UNDECODED]
    undecoded = [target for target in result.targets if target.id == UNDECODED]
    likely = [target for target in undecoded if _reason(target) != 'unread']
    unread = [target for target in undecoded if _reason(target) == 'unread']
    unread.sort(key=lambda target: -target.semi_major)
    identified = count_codes(decoded)
    known = _known_ids(result, truth)
    judged = None if truth is None else _judged(truth, decoded)
    missed = sorted(known - result.identified) if known is not None else []
    if judged:
        missed = sorted(number for number, _, _ in judged['missed'])
    expected = len(known) if known else result.expected
    return {
        'image': result.image,
        'images': list(result.images),
        'combination': result.combination,
        'width': result.width,
        'height': result.height,
        'family': result.family,
        'detector': result.detector,
        'expected': expected,
        'estimated': result.estimated,
        'mirrored': result.mirrored,
        'edges': edge_shift_remark(result.edge_shift),
        'identified': identified,
        'missed': len(missed) if known is not None else max(0, expected - identified),
        'missedIds': missed,
        'unexpectedIds': sorted(result.identified - known) if known is not None else [],
        'doubtful': len(likely) + sum(it.confidence < doubtful_below for it in decoded),
        'unread': len(unread),
        'seconds': round(result.filter.duration, 3),
        'filter': _filter(result),
        'search': _search(result),
        'targets': [_target(target, families) for target in decoded],
        'dots': [_dots(target) for target in decoded if isinstance(target, DottedTarget)],
        'squares': [_square(target) for target in decoded if isinstance(target, SquareMarker)],
        'undecoded': [_undecoded(target) for target in [*likely, *unread[:MAXIMUM_UNREAD]]],
        'truth': judged,
    }


def families_of(results: Sequence[ImageResult]) -> list[str]:
    """Return the names of the families of all targets, the most frequent first."""
    counts = Counter(target.family for result in results for target in result.targets)
    return [name for name, _ in counts.most_common() if name]


def _known_ids(result: ImageResult, truth: Sequence[TrueTarget] | None) -> frozenset[int] | None:
    """Return the IDs that the image is known to show, None if only their number is known."""
    if truth is not None:
        return frozenset(target.id for target in truth if target.confirmed)
    return frozenset(result.expected_ids) if result.expected_ids else None


def _reason(target: Target) -> str:
    return target.reason if isinstance(target, UndecodedTarget) else 'unread'


def _place(target: Target) -> list[float]:
    angle = round(math.degrees(target.angle), 2)
    axes = round(target.semi_major, 2), round(target.semi_minor, 2)
    return [round(target.x, 3), round(target.y, 3), *axes, angle]


def _target(target: Target, families: Sequence[str]) -> list[float]:
    """Return ID, place, confidence, standard deviations and family of a target."""
    deviations = [_significant(math.sqrt(max(0.0, target.covariance[i]))) for i in (0, 3)]
    family = families.index(target.family) if target.family else -1
    return [target.id, *_place(target), round(target.confidence, 6), *deviations, family]


def _undecoded(target: Target) -> list[Any]:
    """Return place, confidence, reason and the likely ID of an undecoded target."""
    likely = target.likely_id if isinstance(target, UndecodedTarget) else UNDECODED
    return [*_place(target), round(target.confidence, 4), _reason(target), likely]


def _dots(target: DottedTarget) -> dict[str, Any]:
    ellipses = [
        [*(round(length, 2) for length in dot[:4]), round(math.degrees(dot[4]), 1)]
        for dot in target.dots
    ]
    return {'id': target.id, 'template': target.template_dots, 'ellipses': ellipses}


def _square(target: SquareMarker) -> dict[str, Any]:
    corners = [[round(x, 2), round(y, 2)] for x, y in target.corners]
    return {'id': target.id, 'corners': corners}


def _filter(result: ImageResult) -> dict[str, Any] | None:
    used = result.filter
    names = 'gamma_high', 'gamma_low', 'cutoff', 'attenuation'
    state: dict[str, Any] = {'applied': used.applied, 'evaluations': used.evaluations}
    if used.applied:
        state |= {name: _significant(getattr(used, name)) for name in names}
    return state


def _search(result: ImageResult) -> dict[str, Any] | None:
    if result.search is None:
        return None
    columns = asdict(result.search)
    for name in ('gamma_high', 'gamma_low', 'cutoff', 'attenuation'):
        columns[name] = [_significant(value) for value in columns[name]]
    return columns


def _judged(truth: Sequence[TrueTarget], decoded: Sequence[Target]) -> dict[str, Any]:
    """Return which targets are right and wrong, errors of the right ones, and what is missed."""
    verdicts = judge(truth, decoded)
    right = {verdict.target for verdict in verdicts if verdict.kind == RIGHT}
    errors = [
        [index, round(decoded[index].x - it.target.x, 4), round(decoded[index].y - it.target.y, 4)]
        for index, it in enumerate(verdicts)
        if it.kind == RIGHT and it.target is not None
    ]
    missed = [it for it in truth if it.confirmed and it not in right]
    return {
        'wrong': [index for index, it in enumerate(verdicts) if it.kind in (WRONG, FALSE)],
        'errors': errors,
        'missed': [[it.id, round(it.x, 2), round(it.y, 2)] for it in missed],
    }


def _significant(value: float) -> float:
    return float(f'{value:.5g}')
