"""Templates among the dots of an image.

The ellipse of a dot tells how its neighbourhood is foreshortened, to about a fifth: seen in units
of its ellipse the template of a target is nearly the printed one, turned. How large dots are in
the print is not known. So each dot is tried in the role of each template dot with any neighbour as
its partner, which tells the scale, and a third dot is looked for where these two predict it. Three
dots give an affine map, which predicts the others well; their areas tell the radius of the dots.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache, partial
from itertools import pairwise
from typing import Any

import cv2
import numpy as np

from ahf_ros import kernels
from ahf_ros.prints.gsi import PointPrint
from ahf_ros.vision import frame
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.dots import Dots, pairs_within
from ahf_ros.vision.homography import fit_homographies, local_frames
from ahf_ros.vision.robust import median

FEW = 600  # dots of one polarity, up to which all template dots are tried in all roles

_PART = 400_000  # pairs or triples of dots at a time, which bounds the memory
_RADII = (0.065, 0.43)
# Of dots, in the least distance of two template dots: 1.0 to 3.6 mm where these are 11 mm apart,
# and a third more for bright ones that bloom.
_SIZE_RATIO = 0.55  # of two dots of a target, in ln, for their printed sizes
_STEPS = 4  # of the distance to which neighbours are looked for, until there are many
_CROWD = (4.0, 1.25)
# Times as dense as the dots of a target in the circle about it, from which on neighbours make a
# pattern of light; and the same where only obvious targets are looked for. Bright targets in
# bright lattices are lost with 3.

_LENGTH_ERROR = (0.35, 0.7)  # of a distance in units of an ellipse: share of it, and dot radii
_LENGTH_ERROR_OF_MANY = (0.25, 0.5)  # the same, where there are many dots
_ELLIPSE_ERROR = 0.25  # of the axes of a dot, from those that three dots imply, in ln
_PREDICTED = 0.9  # error of a dot that is predicted by three others, printed dot radii
_PERSPECTIVE = 0.06  # the same, in its distance from them
_RESIDUAL = 0.35  # of the dots of a template about a homography, root mean square, printed radii
_MAXIMUM_GROUPS = 2000  # of one part, for a homography to be fitted
_MAXIMUM_TEMPLATES = 2000  # of one polarity, those that fit best
_CELL = 2.0  # smallest one of the map of the nearest dots, px


Nearest = Callable[[np.ndarray, np.ndarray, float], tuple[np.ndarray, np.ndarray]]
"""From places, shape (n, 2), maps and a reach to the nearest dots and their distances.

Maps, shape (n, 2, 2), are those from px to the unit of the reach at each place. Beyond the reach a
dot is -1.
"""

Triples = Callable[..., tuple[np.ndarray, np.ndarray, np.ndarray]]
"""`likely_triples`, with what it must know of dots and pairs."""


@dataclass(frozen=True, slots=True)
class Pairs:
    """Ordered pairs of neighbours, sorted by the first one, then by their length.

    Attributes
    ----------
    first, second : ndarray of int, shape (p,)
        Indices of dots.
    offset : ndarray of complex128, shape (p,)
        From the first to the second, y up, in units of the ellipse of the first.
    crowd : ndarray of float64, shape (p,)
        How far from the first dot there are so many others that no target is that large.
    error : tuple of 2 float
        Of the offsets: a share of their length, and what is added to it.
    """

    first: np.ndarray
    second: np.ndarray
    offset: np.ndarray
    crowd: np.ndarray
    error: tuple[float, float]

    def as_long_as(self, first: np.ndarray, lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return where the pairs with given first dots and about given lengths begin and end."""
        own = np.abs(self.offset)
        apart = 2 * own.max(initial=0.0) + 1
        key, error = self.first * apart + own, self.error_at(lengths)
        low, high = np.maximum(lengths - error, 0), np.minimum(lengths + error, apart / 2)
        begin = np.searchsorted(key, first * apart + low)
        return begin, np.maximum(np.searchsorted(key, first * apart + high), begin)

    def error_at(self, lengths: np.ndarray) -> np.ndarray:
        """Return how far offsets may be from where they should be at some lengths."""
        return self.error[0] * lengths + self.error[1]


@lru_cache(maxsize=8)
def radius_scales(family: PointPrint) -> tuple[float, float]:
    """Return the bounds of the radii that dots may have, in those of the printed design."""
    places = family.places[: len(family.template)]
    gaps = np.hypot(*(places[:, None] - places).transpose(2, 0, 1))
    least = float(gaps[gaps > 0].min()) / float(family.template_radii[family.reference])
    smallest, largest = _RADII
    return min(smallest * least, 1.0), max(largest * least, 1.0)


def neighbours(
    dots: Dots,
    family: PointPrint,
    triples: Sequence[tuple[int, int, int]],
    error: tuple[float, float],
    *,
    obvious: bool,
) -> Pairs:
    """Return the pairs of dots of one polarity and similar size that one template may hold.

    Triples of template dots are the role of the first dot of a pair, and those of the second.
    Where targets are to be obvious, those with many other dots about them are not looked for.
    """
    places = family.places[: len(family.template)]
    smallest, largest = radius_scales(family)
    longest = max(
        float(np.hypot(*(places[list(others)] - places[role]).T).max())
        / float(family.template_radii[role])
        for role, *others in triples
    )
    nearest, farthest = ((1 + error[0]) * longest / of + error[1] for of in (largest, smallest))
    own = float(family.template_radii[family.reference])
    circles = ((1 + error[0]) * longest * own / family.reach) ** 2
    crowd = round(_CROWD[obvious] * circles * (len(places) + family.rule.dots))
    centres = dots.frames[:, :2, 2]
    major = frame.ellipse_axes(dots.frames)[0]
    size = np.log(major)
    inverse = frame.inverses(dots.frames[:, :2, :2])
    unit_x, unit_y = (inverse[:, 0] - 1j * inverse[:, 1]).T
    widest = np.log(family.template_radii.max() / family.template_radii.min())
    limit = np.full(len(centres), np.inf)
    parts = [(np.zeros(0, int), np.zeros(0, int), np.zeros(0, complex))]
    for reach in np.geomspace(nearest, farthest, _STEPS):
        alone = np.isinf(limit)
        for first, second in pairs_within(centres, np.where(alone, reach * major, 0.0), _PART):
            near = np.abs(size[second] - size[first]) < _SIZE_RATIO + widest
            first, second = first[near], second[near]
            across, down = (of[second] - of[first] for of in centres.T)
            offset = unit_x[first] * across + unit_y[first] * down
            length = np.abs(offset) / (2 * reach)
            near = np.flatnonzero(length < 0.5)
            order = near[np.argsort(first[near] + length[near])]
            first, second, offset = first[order], second[order], offset[order]
            rank = np.arange(len(first)) - np.searchsorted(first, first)
            last = rank == crowd
            limit[first[last]] = np.abs(offset[last])
            near = rank < crowd
            if reach < farthest:
                near &= np.isfinite(limit[first])
            parts.append((first[near], second[near], offset[near]))
    first, second, offset = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(first, kind='stable')
    first, second, offset = first[order], second[order], offset[order]
    return Pairs(first=first, second=second, offset=offset, crowd=limit[first], error=error)


def nearest_dots(centres: np.ndarray, error: float) -> Nearest:
    """Return a function that finds the dots nearest to places; see `Nearest`.

    It looks them up in a map of the image. A dot may be farther away than the nearest one by the
    error, px.
    """
    cell = max(error, _CELL)
    corner = centres.min(axis=0)
    cells = np.rint((centres - corner) / cell).astype(int)
    last = cells.max(axis=0)
    empty = np.full(last[::-1] + 1, 255, np.uint8)
    empty[cells[:, 1], cells[:, 0]] = 0
    _, labels = cv2.distanceTransformWithLabels(
        empty, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    dot = np.zeros(labels.max() + 1, np.int32)
    dot[labels[cells[:, 1], cells[:, 0]]] = np.arange(len(cells))
    nearest = dot[labels]

    def find(places: np.ndarray, maps: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
        column, row = np.clip(np.rint((places - corner) / cell), 0, last).astype(int).T
        found = nearest[row, column]
        gap = maps @ (centres[found] - places)[..., None]
        distance = np.hypot(gap[:, 0, 0], gap[:, 1, 0])
        return np.where(distance < reach, found, -1), distance

    return find


@dataclass(frozen=True, slots=True)
class Templates(ArrayRecord):
    """k groups of dots that look like the template of a target.

    Attributes
    ----------
    homographies : ndarray of float64, shape (k, 3, 3)
        From the plane of the printed design (its unit, y up, about the reference) to pixels.
    members : ndarray of int, shape (k, n)
        Which dot is each template dot, -1 where there is none.
    polarity : ndarray of int, shape (k,)
    scale : ndarray of float64, shape (k,)
        Radius of the dots in that of the printed design.
    misfit : ndarray of float64, shape (k,)
        Root mean square distance of the dots from where they should be, as a share of what is
        accepted; a dot that is missing counts as 1.
    """

    homographies: np.ndarray
    members: np.ndarray
    polarity: np.ndarray
    scale: np.ndarray
    misfit: np.ndarray


def find_templates(dots: Dots, family: PointPrint, *, obvious: bool = False) -> Templates:
    """Return the groups of dots that look like templates, best first, no group twice.

    Dots are of one polarity; groups may share them. If targets are to be obvious, those with many
    other dots about them are not looked for.
    """
    places = family.places[: len(family.template)]
    nothing = Templates(
        homographies=np.zeros((0, 3, 3)),
        members=np.zeros((0, len(places)), int),
        polarity=np.zeros(0, int),
        scale=np.zeros(0),
        misfit=np.zeros(0),
    )
    if len(dots.frames) < len(places) - 1:
        return nothing
    centres, smallest = dots.frames[:, :2, 2], frame.ellipse_axes(dots.frames)[1].min()
    few = len(centres) <= FEW
    triples = _triples(places, family.reference, few)
    error = _LENGTH_ERROR if few else _LENGTH_ERROR_OF_MANY
    pairs = neighbours(dots, family, triples, error, obvious=obvious)
    nearest = cache(partial(nearest_dots, centres, smallest / 3))
    find = _triples_among(dots, pairs)
    members = [_members(dots, pairs, find, nearest, family, triple) for triple in triples]
    groups = np.unique(np.concatenate(members), axis=0)
    if not len(groups):
        return nothing
    return _best(_fitted(dots, groups, family))


def _triples(places: np.ndarray, reference: int, thorough: bool) -> list[tuple[int, int, int]]:
    """Return three template dots each: one whose ellipse is used, its partner, and a third one.

    The reference is tried with the two dots farthest from it, or, where there is time, all dots
    with the two farthest.
    """
    gaps = np.hypot(*(places[:, None] - places).transpose(2, 0, 1))
    triples = []
    for role in range(len(places)) if thorough else [reference]:
        arms = places - places[role]
        for partner in np.argsort(-gaps[role], kind='stable').tolist()[:2]:
            third = int(np.abs(_cross(arms, arms[partner])).argmax())
            triples.append((role, partner, third))
    return triples


def _members(
    dots: Dots,
    pairs: Pairs,
    find: Triples,
    nearest: Callable[[], Nearest],
    family: PointPrint,
    triple: tuple[int, int, int],
) -> np.ndarray:
    """Return groups of dots in which a dot has a role, shape (k, n), -1 where one is missing."""
    places = family.places[: len(family.template)]
    role, partner, third = triple
    radius = family.template_radii[role]
    arms = (places - places[role]) / radius
    lengths = np.hypot(*arms.T)
    smallest, largest = radius_scales(family)
    scales = np.log([smallest, largest])
    longest = lengths[partner] / smallest
    apart, shortest = np.abs(pairs.offset), lengths[partner] / largest
    likely = apart < longest + pairs.error_at(longest)
    likely &= apart > shortest - pairs.error_at(shortest)
    likely &= pairs.crowd > (1 + pairs.error[0]) * apart * lengths.max() / lengths[partner]
    partners = np.flatnonzero(likely)
    begin, end = pairs.as_long_as(
        pairs.first[partners], apart[partners] * lengths[third] / lengths[partner]
    )
    total = np.cumsum(end - begin)
    parts = np.searchsorted(total, np.arange(0, total[-1:].sum() + _PART, _PART))
    found = [np.zeros((0, len(places)), int)]
    of_print = _plane_of(triple, family)
    for low, high in pairwise(parts):
        of_part = partners[low:high], begin[low:high], end[low:high]
        most = int((end - begin)[low:high].sum())
        triples, affine, (count,) = find(*of_print, pairs.error, scales, *of_part, most=most)
        if not count:
            continue
        members, affine = np.full((count, len(places)), -1), affine[:count]
        members[:, [*triple]] = triples[:count]
        origin, inverse = dots.frames[members[:, role], :2, 2], frame.inverses(affine)
        error = np.zeros(len(members))
        for index in np.setdiff1d(np.arange(len(places)), (role, partner, third)):
            expected = origin + affine @ arms[index]
            reach = _PREDICTED + _PERSPECTIVE * lengths[index]
            members[:, index], gap = nearest()(expected, inverse, reach)
            error += np.where(members[:, index] < 0, 1, (gap / reach) ** 2)
        members[(members < 0).sum(axis=1) > 1] = -1
        kept = np.argsort(error, kind='stable')[:_MAXIMUM_GROUPS]
        found.append(members[kept[members[kept, role] >= 0]])
    return np.concatenate(found)


def _triples_among(dots: Dots, pairs: Pairs) -> Triples:
    """Return the kernel that finds triples, with what it must know of dots and pairs.

    A third dot is where the template has it, turned and scaled so that the partner is where a pair
    says. The ellipses of all three are those that their affine map implies; they may all be larger
    than printed or smaller, by one factor.
    """
    ellipses, minor = dots.frames[:, :2, :2], frame.ellipse_axes(dots.frames)[1]
    return partial(
        kernels.likely_triples,
        *(np.stack([pairs.first, pairs.second], axis=1), pairs.offset.view(float).reshape(-1, 2)),
        *(ellipses @ np.diag([1.0, -1.0]), frame.inverses(ellipses)),
        _ELLIPSE_ERROR + 1 / minor,  # blobs consist of whole pixels
    )


def _plane_of(triple: tuple[int, int, int], family: PointPrint) -> tuple[Any, ...]:
    """Return how three template dots lie in the print, as the kernel takes it."""
    radii = family.template_radii[[*triple]]
    partner, third = (family.places[[*triple[1:]]] - family.places[triple[0]]) / radii[0]
    turn = complex(*third) / complex(*partner)
    basis = np.linalg.inv(np.stack([partner, third], axis=1))
    return (turn.real, turn.imag), basis, radii / radii[0]


def _cross(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]


def _fitted(dots: Dots, members: np.ndarray, family: PointPrint) -> Templates:
    """Return groups with their homographies, those that fit."""
    places = family.places[: len(family.template)]
    reach = np.hypot(*places.T).max()
    there = members >= 0
    images = dots.frames[members, :2, 2]
    fit = fit_homographies(places, images, there.astype(float), reach)
    expected = frame.project(fit.homographies, places)
    squares = ((expected - images) ** 2).sum(axis=2)
    implied = local_frames(fit.homographies, places, family.template_radii).reshape(-1, 3, 3)
    minor = frame.ellipse_axes(implied)[1].reshape(members.shape)
    allowed = _RESIDUAL * np.maximum(minor, 1.0)
    relative = np.where(there, squares / allowed**2, 1.0)
    misfit = np.sqrt(relative.mean(axis=1))
    good = (misfit < 1) & (np.linalg.det(fit.homographies) < 0)  # y is up, then down
    ratio = frame.mean_radii(dots.frames)[members] / frame.mean_radii(implied).reshape(there.shape)
    scale = median(ratio, there)
    smallest, largest = radius_scales(family)
    good &= (scale > smallest) & (scale < largest)
    signs = dots.polarity[members.max(axis=1)]
    return Templates(
        homographies=fit.homographies, members=members, polarity=signs, scale=scale, misfit=misfit
    ).select(good)


def _best(templates: Templates) -> Templates:
    """Return the templates best first, without parts of others."""
    best = templates.select(np.argsort(templates.misfit, kind='stable'))
    return best.select(np.flatnonzero(~_parts_of_others(best))[:_MAXIMUM_TEMPLATES])


def _parts_of_others(templates: Templates) -> np.ndarray:
    """Return where all dots of a template that lacks one belong to one that fits.

    Four dots of GSI's template are the corners of a square, which fits in four ways.
    """
    members = np.sort(templates.members, axis=1)
    count = members.shape[1]
    lacking = np.flatnonzero(members[:, 0] < 0)
    whole = members[members[:, 0] >= 0]
    parts = [np.delete(whole, index, axis=1) for index in range(count)]
    rows = np.concatenate([members[lacking, 1:], *parts])
    _, same = np.unique(rows, axis=0, return_inverse=True)
    same = same.ravel()  # numpy 2.0 gives it two dimensions
    part = np.zeros(len(members), bool)
    part[lacking] = np.isin(same[: len(lacking)], same[len(lacking) :])
    return part
