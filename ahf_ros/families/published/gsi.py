"""Identification of GSI's targets as published: fixed thresholds, an invariant, an affine map.

The six steps of Wang et al. [1]_:

1. A fixed threshold makes the image binary.
2. Contours whose area, perimeter and roundness are those of a dot get a least-squares ellipse.
3. Every dot is taken together with the dots nearest to it, eight in all.
4. Three of the eight have to lie on a line, with three of the others on one side and two on the
   other.
5. The P2-invariant tells which of these five belong to the template.
6. An affine map from the template to the printed design puts the three other dots near positions.

The tolerances of collinearity and of the invariant are ours: the paper says only that measured
invariants lie within 0.03 of that of the design. The front of a print is seen, so that B and D are
not exchanged.

It has no defence against uneven light, which makes it a fair test of a filter. The centre of a
target is that of the ellipse of its middle dot, with the perspective bias in it.

References
----------
.. [1] Wang et al., Remote Sens. 2022, 14, 5377.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product
from typing import Any, ClassVar

import cv2
import numpy as np

from ahf_ros.base.target import UNDECODED, DottedTarget, Target, sorted_targets
from ahf_ros.families.claims import best_targets
from ahf_ros.families.contract import FamilyDetector
from ahf_ros.prints.gsi import PointPrint
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.image import as_gray, check_image

_MAXIMUM_BIAS = 1.0
# Distance h of a dot from its position that is accepted, in the unit of the printed design, mm.
_DOTS = 8  # of a target
_DISTANCE_RATIO = 2.5  # beta, of the longer half of the line of three dots to the shorter one
_OFF_LINE = 0.05  # distance of the middle dot from the line, in the line's length
_INVARIANT_ERROR = 0.1
_PART = 1_000_000  # distances at a time, which bounds the memory

_THRESHOLD = 100  # gray value between dots and ground
_AREA = (30.0, 1000.0)  # of a dot, px
_PERIMETER = (20.0, 500.0)  # px
_MINIMUM_ROUNDNESS = 0.6  # 4 pi area / perimeter^2
_MINIMUM_POINTS = 14  # of a contour: neighbours are at most 2^0.5 px apart
_CONTOUR_ERROR = 0.2  # standard deviation of the centre of an ellipse, px


def p2_invariant(ratio: Any) -> np.ndarray:
    """Return J of cross ratios l.

    J = J2 / J1, with

        J1 = (l^6 - 3 l^5 + 3 l^4 - l^3 + 3 l^2 - 3 l + 1) / (l^2 (l - 1)^2),
        J2 = (2 l^6 - 6 l^5 + 9 l^4 - 8 l^3 + 9 l^2 - 6 l + 2) / (l^2 (l - 1)^2).

    It is from 2 to 14/5 for any order of the four points; NaN where l is not finite.

    Examples
    --------
    >>> float(p2_invariant(2.0))
    2.8
    """
    value = np.asarray(ratio, np.float64)
    with np.errstate(all='ignore'):
        # A cross ratio and its inverse have the same J; powers of the smaller do not overflow.
        value = np.where(np.abs(value) > 1, 1 / value, value)
    first = np.polyval([1, -3, 3, -1, 3, -3, 1], value)
    second = np.polyval([2, -6, 9, -8, 9, -6, 2], value)
    return second / first


def area_cross_ratio(pivot: Any, points: Any) -> np.ndarray:
    """Return the cross ratio of the lines from a pivot to four points, by areas of triangles.

    The pivot has the shape (..., 2), points have (..., 4, 2). It is infinite or NaN where three of
    the points are collinear with the pivot.
    """
    arms = np.asarray(points, np.float64) - np.asarray(pivot, np.float64)[..., None, :]
    one, two, three, four = np.moveaxis(arms, -2, 0)
    with np.errstate(divide='ignore', invalid='ignore'):
        ratio = _cross(one, three) * _cross(two, four) / (_cross(one, four) * _cross(two, three))
    return np.asarray(ratio)


def template_invariant(points: Any) -> np.ndarray:
    """Return the P2-invariant of five template points, three of them collinear.

    It is the larger one of those at the two points that are not on the line; the others have
    none. The points, shape (..., 5, 2), are A, B, C, D, E, with C, E, A on a line; exchanging B
    and D changes nothing. The printed design of GSI has 2.474.
    """
    a, b, c, d, e = np.moveaxis(np.asarray(points, np.float64), -2, 0)
    at_d = area_cross_ratio(d, np.stack([b, c, e, a], axis=-2))
    at_b = area_cross_ratio(b, np.stack([d, c, e, a], axis=-2))
    return np.fmax(p2_invariant(at_d), p2_invariant(at_b))


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


def decode(points: np.ndarray, code: PointPrint) -> Decoded:
    """Return the targets that points, shape (k, 2), px, belong to.

    Of those with the same middle dot it is the one that fits best.
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
    order = order[(bias[order] <= _MAXIMUM_BIAS) & np.isin(words[order], code.words)]
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


def _templates(points: np.ndarray, groups: np.ndarray, code: PointPrint) -> list[np.ndarray]:
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


def _roles(code: PointPrint) -> list[int]:
    """Return the indices of A, B, C, D and E among the template dots."""
    return [code.template_names.index(name) for name in 'ABCDE']


def _cross(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]


@dataclass(frozen=True, slots=True)
class PublishedGsiDetector(FamilyDetector):
    """The detector `gsi_published`; call it with an image."""

    name: ClassVar[str] = 'gsi_published'

    @property
    def design(self) -> PointPrint:
        """Printed design of the family, which has to have what the method rests on."""
        code = self.settings.codes(PointPrint)[0]
        good = sorted(code.template_names) == list('ABCDE') and code.rule.dots == _DOTS - 5
        if good:
            c, e, a = (code.template[code.template_names.index(name)] for name in 'CEA')
            good = bool(abs(_cross(a - c, e - c)) < 1e-3 * ((a - c) ** 2).sum())
            good &= code.template_names[code.reference] == 'E'
        if not good:
            raise ValueError(
                f'the family is {code.name!r}, accepted by gsi_published is one with the template '
                'dots A, B, C, D and E, the last of which is the reference and on the line from C '
                'to A, and with three decoding dots'
            )
        return code

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image; see `Detector`.

        Of several targets that claim one ID the one that fits best keeps it, and the others are
        not reported.
        """
        check_image(image)
        settings, code = self.settings, self.design
        gray = as_gray(image)
        found: list[Target] = []
        single: list[Target] = []
        for polarity in settings.polarities:
            dots = find_dots(gray, polarity, settings.min_radius, settings.max_radius)
            decoded = decode(dots[:, :2], code)
            for word, members, bias in zip(
                decoded.words.tolist(), decoded.members, decoded.bias.tolist(), strict=True
            ):
                found.append(
                    DottedTarget(
                        id=code.number(word) or 0,
                        code=word,
                        confidence=1 - bias / _MAXIMUM_BIAS,
                        family=code.name,
                        dots=tuple(map(tuple, dots[members].tolist())),
                        template_dots=len(code.template),
                        polarity=polarity,
                        **_place(dots[members[code.reference]]),
                    )
                )
            if settings.report_undecoded:
                rest = np.delete(dots, decoded.members, axis=0)
                single += [Target(id=UNDECODED, code=0, **_place(dot)) for dot in rest]
        return sorted_targets([*best_targets(found, 1.0), *single])


def find_dots(gray: np.ndarray, polarity: int, min_radius: float, max_radius: float) -> np.ndarray:
    """Return the ellipses of dots: steps 1 and 2.

    Dark dots have the polarity 1, bright ones -1; radii bound the semi-major axis, px. An ellipse
    is centre x and y, semi-major and semi-minor axis, px, and direction, rad: shape (k, 5).
    """
    mask = (gray <= _THRESHOLD if polarity > 0 else gray > _THRESHOLD).astype(np.uint8)
    contours, _ = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    ellipses = []
    for contour in contours:
        if not _MINIMUM_POINTS <= len(contour) <= _PERIMETER[1]:
            continue
        area, perimeter = cv2.contourArea(contour), cv2.arcLength(contour, closed=True)
        if (
            not _AREA[0] <= area <= _AREA[1]
            or not _PERIMETER[0] <= perimeter <= _PERIMETER[1]
            or 4 * np.pi * area < _MINIMUM_ROUNDNESS * perimeter**2
        ):
            continue
        (x, y), (first, second), angle = cv2.fitEllipse(contour)
        turned = np.deg2rad(angle + (90 if second > first else 0))
        # A contour runs through the centres of the outermost pixels, half a pixel inside.
        major, minor = (max(first, second) + 1) / 2, (min(first, second) + 1) / 2
        if min_radius <= major <= max_radius:
            ellipses.append((x, y, major, minor, (turned + np.pi / 2) % np.pi - np.pi / 2))
    return np.array(ellipses).reshape(-1, 5)


def _place(ellipse: np.ndarray) -> dict[str, Any]:
    """Return the fields of a target that say where and how large it is."""
    names = ('x', 'y', 'semi_major', 'semi_minor', 'angle')
    variance = _CONTOUR_ERROR**2
    place = dict(zip(names, ellipse.tolist(), strict=True))
    return {**place, 'covariance': (variance, 0.0, 0.0, variance)}
