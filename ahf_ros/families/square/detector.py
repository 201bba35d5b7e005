"""Identification of square markers, ArUco and AprilTag, of several dictionaries at once.

Quadrilaterals are found in the image and in its halves, and read as markers by the evidence of
their cells. Corners and centres are measured in the image as received, by edges and prints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, isnan, log, log2
from typing import Any

import numpy as np

from ahf_ros import kernels
from ahf_ros.base.blas import one_blas_thread
from ahf_ros.base.target import SquareMarker, Target, sorted_targets
from ahf_ros.families.contract import ExpectingDetector, moved_targets
from ahf_ros.families.square.edges import fit_markers
from ahf_ros.families.square.frames import Places, centres, side_lengths
from ahf_ros.families.square.margins import decision_margins
from ahf_ros.families.square.prints import lay_outlines, lay_prints
from ahf_ros.families.square.quadrilaterals import find_quadrilaterals
from ahf_ros.families.square.reading import MINIMUM_ODDS, NOTHING, Readings, read
from ahf_ros.families.undecoded import undecoded
from ahf_ros.prints.square import are_plain, words
from ahf_ros.vision.faint import faint_parts
from ahf_ros.vision.frame import reduced
from ahf_ros.vision.image import as_gray, check_image
from ahf_ros.vision.logistic import probability
from ahf_ros.vision.pyramid import halved

# Of a centre where nothing else can be fitted, in sides. It was measured of contours, which
# straight edges replace: on paper with waves of 0.5 to 3 px, 0.021 of 169 markers and 0.032 of
# 85, none beyond three of these. On flat and on bent sheets, in any light, edges or print are
# fitted: of 2,133 markers none was left.
_DRAFT_DEVIATION = 0.028
_SMALL = 45.0  # diagonal of a marker whose cells are not much larger than pixels, px
_SMALLEST_HALF = 24  # smaller side of a half that markers are looked for in, px
_SAME_PLACE = 0.3  # distance of two readings of one marker, in sides
_SURE = 7.0  # logarithmic odds of a marker that is looked for in no half: a thousand to one
_FITTED = 4.0  # logarithmic odds against a marker whose print was laid: half its eight unknowns
_SEVERAL = 4.0  # power of their number, one in which each of several groups is there
_ALONE = 2.9  # ... one marker alone shows
_OF_PLAIN = 4.5  # the most that a marker which letters look like shows, logarithmic odds
_LARGER = 6.9  # logarithmic odds against a larger dictionary where most markers are of a smaller
_LOST = 12.0  # logarithmic odds against a marker that only a half shows
_PRINTED = 4.5  # size of a cell, px, below which a whole print tells more than edges do
# Side of a marker, px, of which finer images show no more, and whose straight edges give its
# corners to about two pixels.
_LARGE = 120.0

Groups = tuple[tuple[str, ...], ...]
"""Dictionaries; those in a group begin with the same markers, the smallest first."""


@dataclass(frozen=True, slots=True)
class SquareDetector(ExpectingDetector):
    """Identify the markers of one family or of several."""

    @property
    def design(self) -> Groups:
        """Dictionaries of the families."""
        groups: dict[str, list[str]] = {}
        for name in self.settings.families:
            stem, _, count = name.rpartition('_')
            groups.setdefault(stem if count.isdigit() else name, []).append(name)
        return tuple(
            tuple(sorted(group, key=lambda name: len(words(name)))) for group in groups.values()
        )

    @property
    def name(self) -> str:
        """Name in the registry: aruco, apriltag, or square for both."""
        kinds = {name.partition('_')[0] for name in self.settings.families}
        return kinds.pop() if len(kinds) == 1 else 'square'

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the markers of one image; see `Detector`."""
        return self.refine(image, self.draft(image))

    @one_blas_thread()
    def draft(self, image: np.ndarray) -> list[Target]:
        """Identify the markers of one image, with the corners of straight edges, to a pixel."""
        check_image(image)
        gray = np.ascontiguousarray(as_gray(image).astype(np.uint8, copy=False))
        groups = self.design
        every = [self._readings(gray, groups)]
        for part in faint_parts(gray) if self.stretches else ():
            shown = self._readings(np.rint(part.gray).astype(np.uint8), groups)
            corners = shown.corners + np.array([part.x, part.y])
            every.append(replace(shown, corners=corners).select(shown.odds > MINIMUM_ODDS))
        readings = Readings.joined(every)
        stretched = np.arange(len(readings.odds)) >= len(every[0].odds)
        uncertain = readings.odds <= MINIMUM_ODDS
        readings = readings.select(np.lexsort([-readings.odds, stretched, uncertain]))
        readings = readings.select(_owning(readings))
        decoded = readings.odds > MINIMUM_ODDS
        markers = _markers(readings, decoded, groups)
        return sorted_targets(
            it if is_decoded else undecoded(it)
            for it, is_decoded in zip(markers, decoded.tolist(), strict=True)
            if is_decoded or self.settings.report_undecoded
        )

    def _readings(self, gray: np.ndarray, groups: Groups) -> Readings:
        """Return what quadrilaterals of an image of uint8 and of its halves are read as."""
        levels = max(0, int(log2(max(min(gray.shape) / _SMALLEST_HALF, 1))))
        expected, everything = self.expected, self.settings.report_undecoded
        found = [NOTHING]
        halves = halved(gray, levels)
        for level, half in enumerate(halves):
            corners = find_quadrilaterals(half, small=not level)
            if level:  # where light, a lens or enlargement spreads edges
                corners = corners[~_are_read(reduced(corners, -level), Readings.joined(found))]
            small = np.linalg.norm(corners[:, 2] - corners[:, 0], axis=1) < _SMALL
            outlines = lay_outlines(half, corners[small])
            if level:  # straight edges may do as well
                corners = np.concatenate([corners, outlines])
            else:
                corners[small] = outlines
            of_half = read(half, corners, groups, expected, everything=everything)
            of_half = replace(of_half, corners=reduced(of_half.corners, -level))
            found.append(self._compared(halves[: level + 1], of_half, groups))
        readings = Readings.joined(found)
        laid = read(gray, _laid(gray, readings, groups), groups, expected)
        readings = Readings.joined([readings, replace(laid, odds=laid.odds - _FITTED)])
        certain = readings.odds > MINIMUM_ODDS
        sure = readings.select(certain)
        doubtful = readings.select(everything & ~certain & readings.whole)
        odds = np.minimum(doubtful.odds, MINIMUM_ODDS)
        odds = np.concatenate([_odds_together(sure, groups), odds])
        readings = replace(Readings.joined([sure, doubtful]), odds=odds)
        return _of_usual_borders(readings)

    def _compared(
        self, halves: Sequence[np.ndarray], readings: Readings, groups: Groups
    ) -> Readings:
        """Return the readings of the last half, and what finer images show in their places.

        Where details are lost, figures look like markers, so that a reading of a half alone is
        doubted.
        """
        level = len(halves) - 1
        finest = _halvings(readings.corners)
        finer = (readings.odds > MINIMUM_ODDS) & (finest < level)
        shown = [replace(readings, odds=readings.odds - _LOST * finer)]
        for own in np.unique(finest[finer]).tolist():
            corners = reduced(readings.corners[finer & (finest == own)], own)
            seen = read(halves[own], corners, groups, self.expected)
            shown.append(replace(seen, corners=reduced(seen.corners, -own)))
        return Readings.joined(shown)

    @one_blas_thread()
    def refine(self, image: np.ndarray, targets: Sequence[Target]) -> list[Target]:
        """Return markers with corners and centres fitted to their edges; see `Refiner`.

        Corners are known to about two pixels. Markers without edges in this image, and targets
        that are no `SquareMarker`, stay unchanged.
        """
        check_image(image)
        gray = as_gray(image).astype(np.float32, copy=False)
        refined = list(targets)
        markers = [it for it in targets if isinstance(it, SquareMarker)]
        prints = [~np.pad(words(it.family)[it.id], it.border) for it in markers]
        for cells in dict.fromkeys(map(len, prints)):
            alike = [it for it, of in zip(markers, prints, strict=True) if len(of) == cells]
            corners = np.array([it.corners for it in alike])
            ink = np.array([of for of in prints if len(of) == cells])
            fit = _fitted(gray, _from_halves(gray, corners, ink), ink)
            places = _places(fit.corners, fit.covariance, fit.edge_shift)
            shown = decision_margins(gray, fit.corners, ink)
            for place, wrong, margin in zip(places, *(it.tolist() for it in shown), strict=True):
                place |= {'hamming': wrong, 'decision_margin': margin}
            refined = moved_targets(refined, alike, places, fit.share > 0)
        return refined


def _markers(readings: Readings, decoded: np.ndarray, groups: Groups) -> list[SquareMarker]:
    """Return readings as markers, of the smallest dictionary that has all that are decoded."""
    which, numbers = readings.group, readings.number
    largest = [numbers[decoded & (which == index)].max(initial=0) for index in range(len(groups))]
    deviations = _DRAFT_DEVIATION * side_lengths(readings.corners).mean(axis=1)
    covariances = deviations[:, None, None] ** 2 * np.eye(2)
    fields = _places(readings.corners, covariances, np.full(len(numbers), np.nan))
    columns = (which, numbers, readings.border, probability(readings.odds))
    return [
        SquareMarker(
            id=number,
            code=number,
            family=next(
                name for name in groups[index] if len(words(name)) > max(number, largest[index])
            ),
            confidence=confidence,
            border=border,
            **place,
        )
        for index, number, border, confidence, place in zip(
            *(of.tolist() for of in columns), fields, strict=True
        )
    ]


def _are_read(places: np.ndarray, readings: Readings) -> np.ndarray:
    """Return which quadrilaterals, shape (k, 4, 2), are where a marker was surely read, (k,)."""
    sure = readings.corners[readings.odds > _SURE]
    reach = _SAME_PLACE * side_lengths(places).max(axis=1)
    taken: np.ndarray = kernels.taken_places(places.mean(axis=1), reach, sure.mean(axis=1))
    return taken


def _halvings(corners: np.ndarray) -> np.ndarray:
    """Return how often the image is halved until markers are no larger than `_LARGE`, (k,)."""
    sides = side_lengths(corners).max(axis=1)
    return np.ceil(np.log2(np.maximum(sides / _LARGE, 1))).astype(int)


def _laid(gray: np.ndarray, readings: Readings, groups: Groups) -> np.ndarray:
    """Return the corners of prints that lie over the image where readings are doubtful."""
    readings = readings.select(np.argsort(-readings.odds, kind='stable'))
    own = readings.select(_owning(readings, of_print=True) & (readings.odds <= MINIMUM_ODDS))
    parts: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
    for index, width in sorted(set(zip(own.group.tolist(), own.border.tolist(), strict=True))):
        alike = own.select((own.group == index) & (own.border == width))
        cells = words(groups[index][-1])[alike.number]
        prints = ~np.pad(cells, ((0, 0), (width, width), (width, width)))
        parts.setdefault(prints.shape[1], []).append((alike.corners, prints))
    found = [np.zeros((0, 4, 2))]
    for of_size in parts.values():
        places, prints = map(np.concatenate, zip(*of_size, strict=True))
        fit = lay_prints(gray, Places.unmeasured(places), prints)
        found.append(fit.corners[fit.share > 0])
    return np.concatenate(found)


def _odds_together(readings: Readings, groups: Groups) -> np.ndarray:
    """Return the logarithmic odds of the readings, shape (k,), as all of them show the groups.

    A group is there or not. One marker shows it, whichever it is, or different ones together,
    each by its lead over other groups in its place; so do those that a smaller dictionary does not
    have for a larger one. One texture may show several, so that they need more. What letters and
    windows look like shows little; three of these show a group together. Where another
    group reads the same places, the surer one is there, and of several markers of a group in one
    place, as by borders of one and two cells, one is.
    """
    group, number, of_group = readings.group, readings.number, readings.odds
    where = _places_of(readings.corners)
    rival, other = kernels.place_rivals(*where, group, number, of_group, 0.0, -inf)
    lead = of_group - rival
    odds = -np.logaddexp(-of_group, np.maximum(readings.others, other - of_group))
    doubt = log(len(groups) ** _SEVERAL - 1) if len(groups) > 1 else -inf
    alone = log(len(groups) ** _ALONE - 1) if len(groups) > 1 else -inf
    against = np.full(len(odds), inf)
    for index, names in enumerate(groups):
        sizes = np.array([len(words(name)) for name in names])
        of_this = group == index
        some = number[of_this]
        surest, whole, leading = np.zeros((3, sizes[-1]))
        most = np.where(are_plain(names[-1]), _OF_PLAIN, inf)
        np.maximum.at(surest, some, np.minimum(lead, odds)[of_this])
        np.maximum.at(whole, some, of_group[of_this])
        surest, whole = np.minimum(surest, most), np.minimum(whole, most)
        leading[some] = -np.inf
        np.maximum.at(leading, some, lead[of_this])
        together, shown = np.cumsum(surest)[sizes - 1], np.cumsum(surest > 0)[sizes - 1]
        by_chance = np.minimum(shown[:-1] * np.diff(np.log(sizes)), _LARGER)
        size = sizes[np.argmax(together - np.cumsum([0.0, *by_chance]))]
        there = max(whole[:size].max() - alone, surest[:size].sum() - doubt)
        rivals = -leading[:size].sum()
        against[of_this & (number < size)] = np.logaddexp(-there, rivals)
    return -np.logaddexp(-odds, against)


def _of_usual_borders(readings: Readings) -> Readings:
    """Return one reading of each marker in a place, with the border that most of its group have.

    Paper in shadow beside a border may be taken for half of a wider one.
    """
    number, border, unusual = readings.number, readings.border, np.zeros(len(readings.odds), bool)
    for group in np.unique(readings.group).tolist():
        own = np.flatnonzero(readings.group == group)
        best = np.zeros((border.max() + 1, number.max() + 1))
        np.maximum.at(best, (border[own], number[own]), readings.odds[own])
        unusual[own] = border[own] != best.sum(axis=1).argmax()
    ordered = readings.select(np.lexsort([-readings.odds, unusual]))
    return ordered.select(_owning(ordered, of_print=True))


def _owning(readings: Readings, *, of_print: bool = False) -> np.ndarray:
    """Return which readings, the best first, are the first in a place, or of a print there."""
    count = readings.number.max(initial=0) + 1
    kinds = of_print * (count * readings.group + readings.number)
    owning: np.ndarray = kernels.place_owners(*_places_of(readings.corners), kinds, len(kinds))
    return owning


def _places_of(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the middles of readings, whose corners have the shape (k, 4, 2), and their reach, px.

    Two of them have one place where one is within the reach of the other.
    """
    diagonals = corners[:, 2:] - corners[:, :2]
    twice_areas = np.abs(np.linalg.det(diagonals))
    return corners.mean(axis=1), _SAME_PLACE * np.sqrt(twice_areas)


def _fitted(gray: np.ndarray, corners: np.ndarray, ink: np.ndarray) -> Places:
    """Return markers, with corners of shape (k, 4, 2), placed by whatever tells most of them."""
    fit = lay_prints(gray, Places.unmeasured(corners), ink, _PRINTED)
    rest = fit.share == 0
    edges = fit_markers(gray, corners[rest], ink[rest])
    fit = fit.replaced(rest, lay_prints(gray, edges, ink[rest]))
    rest = fit.share == 0
    return fit.replaced(rest, fit_markers(gray, corners[rest], ink[rest], flat=False))


def _from_halves(gray: np.ndarray, corners: np.ndarray, ink: np.ndarray) -> np.ndarray:
    """Return the corners, shape (k, 4, 2), of large markers as halves of the image show them.

    Straight edges of a large marker give its corners to a part of its side, not to two pixels.
    """
    halvings = _halvings(corners)
    levels = int(halvings.max())
    corners = corners.astype(np.float64)
    halves = halved(gray, levels)
    for level in range(levels, 0, -1):
        which = np.flatnonzero(halvings >= level)
        fit = fit_markers(halves[level], reduced(corners[which], level), ink[which])
        good = fit.share > 0
        corners[which[good]] = reduced(fit.corners[good], -level)
    return corners


def _places(
    corners: np.ndarray, covariances: np.ndarray, shifts: np.ndarray
) -> list[dict[str, Any]]:
    """Return the fields of markers that say where they are, from corners, shape (k, 4, 2)."""
    corners = corners.astype(np.float64)
    first, second, third, fourth = np.moveaxis(corners, 1, 0)
    across = (second + third - first - fourth) / 4
    down = (third + fourth - first - second) / 4
    vectors, axes, _ = np.linalg.svd(np.stack([across, down], axis=2))
    angles = np.arctan(np.tan(np.arctan2(vectors[:, 1, 0], vectors[:, 0, 0])))
    columns = (centres(corners), axes, angles, covariances.reshape(-1, 4), corners, shifts)
    return [
        {
            'x': x,
            'y': y,
            'semi_major': major,
            'semi_minor': minor,
            'angle': angle,
            'covariance': tuple(covariance),
            'edge_shift': None if isnan(shift) else shift,
            'corners': tuple(map(tuple, of_marker)),
        }
        for (x, y), (major, minor), angle, covariance, of_marker, shift in zip(
            *(column.tolist() for column in columns), strict=True
        )
    ]
