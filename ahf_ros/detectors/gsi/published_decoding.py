"""Targets among points, as Wang et al. find and decode them: steps 3 to 6.

Wang et al., Remote Sens. 2022, 14, 5377. The tolerances of collinearity and of the invariant are
ours: the paper says only that measured invariants lie within 0.03 of that of the design. The
front of a print is seen, so that B and D are not exchanged.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from ahf_ros.codes.gsi import PointFamily
from ahf_ros.codes.invariant import template_invariant
from ahf_ros.features.array_record import ArrayRecord

LARGEST_BIAS = 1.0
"""Distance h of a dot from its position that is accepted, in the unit of the printed design, mm"""

_DOTS = 8  # of a target
_DISTANCE_RATIO = 2.5  # beta, of the longer half of the line of three dots to the shorter one
_OFF_LINE = 0.05  # distance of the middle dot from the line, in the line's length
_INVARIANT_ERROR = 0.1
_PART = 1_000_000  # distances at a time, which bounds the memory


@dataclass(frozen=True, slots=True)
class Decoded(ArrayRecord):
    """k targets.

    Attributes
    ----------
    words : ndarray of int64, shape (k,)
        Values of their codes.
    members : ndarray of int, shape (k, 8)
        Which points are their template dots, in the order of the printed design, and their
        decoding dots.
    bias : ndarray of float64, shape (k,)
        Largest distance of a decoding dot from its position, in the unit of the printed design.
    """

    words: np.ndarray
    members: np.ndarray
    bias: np.ndarray


def check_family(code: PointFamily) -> None:
    """Raise a ValueError unless the design has what the method rests on."""
    names = sorted(code.template_names)
    good = names == list('ABCDE') and code.rule.dots == _DOTS - 5
    if good:
        c, e, a = (code.template[code.template_names.index(name)] for name in 'CEA')
        good = bool(abs(_cross(a - c, e - c)) < 1e-3 * ((a - c) ** 2).sum())
        good &= code.template_names[code.reference] == 'E'
    if not good:
        raise ValueError(
            f'the family is {code.name!r}, accepted by gsi_published is one with the template '
            'dots A, B, C, D and E, the last of which is the reference and on the line from C to '
            'A, and with three decoding dots'
        )


def decode(points: np.ndarray, code: PointFamily) -> Decoded:
    """Return the targets that points belong to, of those with the same middle dot the best one.

    Parameters
    ----------
    points : ndarray of float64, shape (k, 2)
        Centres of dots, px.
    code : PointFamily
    """
    groups = _nearest(points)
    members = np.concatenate([np.zeros((0, _DOTS), int), *_templates(points, groups, code)])
    count = len(code.template)
    template = points[members[:, :count]]
    homogeneous = np.concatenate([template, np.ones((*template.shape[:2], 1))], axis=2)
    affine = np.linalg.pinv(homogeneous) @ code.template
    dots = points[members[:, count:]] @ affine[:, :2] + affine[:, 2:]
    distance = np.linalg.norm(dots[:, :, None] - code.positions, axis=3)
    nearest = distance.argmin(axis=2)
    bias = distance.min(axis=2).max(axis=1, initial=0.0)
    words = np.bitwise_or.reduce(np.int64(1) << code.position_numbers[nearest], axis=1)
    order = np.lexsort((bias, members[:, code.reference]))
    order = order[(bias[order] <= LARGEST_BIAS) & np.isin(words[order], code.words)]
    _, first = np.unique(members[order, code.reference], return_index=True)
    return Decoded(words, members, bias).select(order[first])


def _nearest(points: np.ndarray) -> np.ndarray:
    """Return each point and the points nearest to it, shape (k, 8)."""
    if len(points) < _DOTS:
        return np.zeros((0, _DOTS), int)
    groups = []
    count = max(_PART // len(points), 1)
    for start in range(0, len(points), count):
        part = points[start : start + count]
        square = ((part[:, None] - points) ** 2).sum(axis=2)
        square[np.arange(len(part)), np.arange(start, start + len(part))] = -1.0
        nearest = np.argpartition(square, _DOTS - 1, axis=1)[:, :_DOTS]
        order = np.argsort(np.take_along_axis(square, nearest, axis=1), axis=1)
        groups.append(np.take_along_axis(nearest, order, axis=1))
    return np.concatenate(groups)


def _templates(points: np.ndarray, groups: np.ndarray, code: PointFamily) -> list[np.ndarray]:
    """Return members of targets as `Decoded` has them, from groups whose first dot is E."""
    wanted = float(template_invariant(code.template[_roles(code)]))
    found = []
    for pair in combinations(range(1, _DOTS), 2):
        others = [index for index in range(1, _DOTS) if index not in pair]
        for a, c in (pair, pair[::-1]):
            e_to_a = points[groups[:, a]] - points[groups[:, 0]]
            e_to_c = points[groups[:, c]] - points[groups[:, 0]]
            line = e_to_a - e_to_c
            halves = np.hypot(*e_to_a.T), np.hypot(*e_to_c.T)
            good = np.abs(_cross(e_to_a, e_to_c)) < _OFF_LINE * (line**2).sum(axis=1)
            good &= (e_to_a * e_to_c).sum(axis=1) < 0
            good &= np.maximum(*halves) <= _DISTANCE_RATIO * np.minimum(*halves)
            arms = points[groups[:, others]] - points[groups[:, [c]]]
            of_b = _cross(line[:, None], arms) > 0  # y points down
            good &= np.isin(of_b.sum(axis=1), (2, 3))
            for b, d in product(others, others):
                if b != d:
                    sides = of_b[:, others.index(b)] & ~of_b[:, others.index(d)]
                    which = groups[good & sides][:, [a, b, c, d, 0]]
                    rest = [index for index in others if index not in (b, d)]
                    invariant = template_invariant(points[which])
                    near = np.abs(invariant - wanted) < _INVARIANT_ERROR
                    template = which[:, np.argsort(_roles(code))]
                    dots = groups[good & sides][:, rest]
                    found.append(np.concatenate([template, dots], axis=1)[near])
    return found


def _roles(code: PointFamily) -> list[int]:
    """Return the indices of A, B, C, D and E among the template dots."""
    return [code.template_names.index(name) for name in 'ABCDE']


def _cross(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    area: np.ndarray = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    return area
