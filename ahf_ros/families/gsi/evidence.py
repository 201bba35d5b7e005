"""Evidence for and against a dot at each place of a target, and the codes it speaks for.

The template dots tell how dark ink is beside paper. Where little light falls, ln(I + 8) has
smaller steps than that. The brighter side of an edge tells how small; noise counts for more.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ahf_ros.families.gsi.grouping import Templates
from ahf_ros.families.words import against, margins
from ahf_ros.prints.gsi import PointPrint
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.black import black_lift, lifted
from ahf_ros.vision.dot_evidence import circle_sides, dot_evidence, independent_rays
from ahf_ros.vision.frame import ellipse_axes
from ahf_ros.vision.homography import local_frames
from ahf_ros.vision.logarithm import LOG_OFFSET
from ahf_ros.vision.robust import median

_MINIMUM_STEP = 0.12  # step of ln of a dot
_NOISE = 0.08  # of a step of ln, standard deviation
_BIN = 0.06  # of ln(I + 8), of the levels of ink and paper
_BINS = int(np.ceil(np.log((255 + LOG_OFFSET) / LOG_OFFSET) / _BIN)) + 1
_SPREAD = 0.1  # of a level, standard deviation
_FLOOR = 0.05  # density of levels that no template dot shows
_SHARE = 0.3  # of rays, whose inner ends tell something of their own
_FARTHER = 0.4  # distance from the edge of a dot of more samples of its levels, dot radii

_DISTANCE = _BIN * np.subtract.outer(np.arange(_BINS), np.arange(_BINS))
_SMOOTHING = np.exp(-0.5 * (_DISTANCE / _SPREAD) ** 2)
_SMOOTHING /= _SMOOTHING.sum(axis=1, keepdims=True)
_CONTRADICTED = -6.0  # evidence at a place of a template dot that nearly rules one out
_AT_ONCE = 14  # positions that are looked at at a time
_HIDDEN = 1  # dots that are found and nevertheless so contradicted, in deep shadow

_MAXIMUM_FOR, _MAXIMUM_AGAINST = 8.0, 6.0  # that one place may say on whether there is a target
_GREATEST_MARGIN = 14.0  # of one code over the next, beyond which it says no more
_MAXIMUM_OF_DOT = 20.0  # that it may say for a dot on which one


@dataclass(frozen=True, slots=True)
class Evidence:
    """Evidence at the places of k targets; the template dots come before the positions.

    Attributes
    ----------
    ratio : ndarray of float64, shape (k, m)
        ln of the likelihood of a dot over that of none; 0 where the place is not in the image.
    inside : ndarray of bool, shape (k, m)
        Whether it is.
    """

    ratio: np.ndarray
    inside: np.ndarray


@dataclass(frozen=True, slots=True)
class _Seen(ArrayRecord):
    """k targets, the evidence at some of their places, and what template dots tell of the others.

    Attributes
    ----------
    homographies, polarity, scale
        As for `find_evidence`.
    lift : ndarray of float64, shape (k,)
        Gray values that black is lifted to.
    ink : ndarray of float64, shape (k,)
        Gray value of ink over that of paper.
    levels : ndarray of float64, shape (k, bins)
        ln of the likelihood of levels of ln(I + 8) as ink over that as paper.
    ratio, inside : ndarray, shape (k, m)
        As in `Evidence`, before ratios outside of the image are 0.
    """

    homographies: np.ndarray
    polarity: np.ndarray
    scale: np.ndarray
    lift: np.ndarray
    ink: np.ndarray
    levels: np.ndarray
    ratio: np.ndarray
    inside: np.ndarray

    @property
    def evidence(self) -> Evidence:
        """The evidence at the places that were looked at."""
        return Evidence(ratio=np.where(self.inside, self.ratio, 0.0), inside=self.inside)

    @staticmethod
    def of_templates(
        log: np.ndarray,
        homographies: np.ndarray,
        polarity: np.ndarray,
        scale: np.ndarray,
        family: PointPrint,
    ) -> _Seen:
        """Look at the template dots of targets."""
        part = slice(len(family.template))
        frames, sides, farther, inside = _sides(log, homographies, scale, family, part)
        lift = black_lift(*_ink_and_light(farther, polarity))
        for of in (sides, farther):
            _lift(of, lift)
        ink = _ink_and_light(sides, polarity)[0]
        levels = _level_ratios(np.concatenate([sides, farther], axis=2))
        ratio = _of_steps(sides, frames, polarity, ink)
        return _Seen(homographies, polarity, scale, lift, ink, levels, ratio, inside)

    def further(self, log: np.ndarray, family: PointPrint, count: int) -> _Seen:
        """Look at so many further places, or at all others where these are fewer."""
        done = self.ratio.shape[1]
        part = slice(done, done + count)
        frames, sides, farther, inside = _sides(log, self.homographies, self.scale, family, part)
        for of in (sides, farther):
            _lift(of, self.lift)
        ratio = _of_steps(sides, frames, self.polarity, self.ink)
        levels = np.concatenate([sides, farther], axis=2)
        ratio += _level_evidence(levels, frames, self.levels)
        return replace(
            self,
            ratio=np.concatenate([self.ratio, ratio], axis=1),
            inside=np.concatenate([self.inside, inside], axis=1),
        )


def likely_templates(
    log: np.ndarray, templates: Templates, family: PointPrint, least: float
) -> tuple[Templates, Evidence]:
    """Return the templates in the image that may be those of targets, and the evidence for dots.

    Of the dots that were found, light may hide one. Where none was found, nothing may speak
    against it: four dots of any lattice are the corners of a template. Positions are looked at a
    few at a time, until no code can have a support, see `Readings`, of at least `least`.
    """
    kind = templates.homographies, templates.polarity, templates.scale
    seen = _Seen.of_templates(log, *kind, family)
    against = seen.evidence.ratio <= _CONTRADICTED
    found = templates.members >= 0
    there = seen.inside.all(axis=1) & (found | ~against).all(axis=1)
    which = np.flatnonzero(there & (against.sum(axis=1) <= _HIDDEN))
    seen = seen.select(which)
    while seen.ratio.shape[1] < len(family.places):
        seen = seen.further(log, family, _AT_ONCE)
        likely = np.flatnonzero(_most_support(seen, family) >= least)
        which, seen = which[likely], seen.select(likely)
    return templates.select(which), seen.evidence


def find_evidence(
    log: np.ndarray,
    homographies: np.ndarray,
    polarity: np.ndarray,
    scale: np.ndarray,
    family: PointPrint,
) -> Evidence:
    """Return the evidence for dots at all places of k targets.

    `log` is LOG_SCALE ln(I + 8), int16; `scale` the radius of the dots of each target in that of
    the printed design.
    """
    seen = _Seen.of_templates(log, homographies, polarity, scale, family)
    return seen.further(log, family, len(family.places)).evidence


def _sides(
    log: np.ndarray, homographies: np.ndarray, scale: np.ndarray, family: PointPrint, part: slice
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the frames of dots at some places, (k, n, 3, 3), and ln(I + 8) at both their sides.

    The latter twice, beside the edge and farther from it, (k, n, rays, 2). The last array is
    whether all of a dot lies in the image, (k, n).
    """
    places, radii = family.places[part], family.radii[part]
    frames = local_frames(homographies, places, radii * scale[:, None])
    single = frames.reshape(-1, 3, 3)
    sides, inside = circle_sides(log, single)
    farther, _ = circle_sides(log, single, _FARTHER * ellipse_axes(single)[1])
    shape = frames.shape[:2]
    sides, farther = (of.reshape(*shape, *sides.shape[1:]) for of in (sides, farther))
    return frames, sides, farther, inside.reshape(shape)


def _lift(sides: np.ndarray, lift: np.ndarray) -> None:
    """Lift black to gray values, (k,), in values of ln(I + 8), (k, n, rays, 2)."""
    black = np.flatnonzero(lift > 0)
    moved = lifted(_gray(sides[black]), lift[black, None, None, None])
    sides[black] = np.log(moved + LOG_OFFSET)


def _of_steps(
    sides: np.ndarray, frames: np.ndarray, polarity: np.ndarray, ink: np.ndarray
) -> np.ndarray:
    """Return the evidence of steps for dots (k, n), from the gray value of ink over paper, (k,).

    Steps are expected in the light that falls on each ray.
    """
    brighter = np.maximum(_gray(sides.max(axis=3)), 1.0)
    expected = np.log((brighter + LOG_OFFSET) / (ink[:, None, None] * brighter + LOG_OFFSET))
    steps = (sides[..., 1] - sides[..., 0]) * polarity[:, None, None]
    return dot_evidence(steps / expected, frames, _NOISE / expected)


def _ink_and_light(template: np.ndarray, polarity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the gray value of ink over that of paper, and that of paper in the light."""
    rays = (len(template), template.shape[1] * template.shape[2])
    usual = ((template[..., 1] - template[..., 0]) * polarity[:, None, None]).reshape(rays)
    light = _gray(template.max(axis=3)).reshape(rays)
    lit = light >= np.median(light, axis=1, keepdims=True)
    usual = np.maximum(median(usual, lit, 0.0), _MINIMUM_STEP)
    light = np.maximum(median(light, lit, 0.0), 1.0)
    ink = ((light + LOG_OFFSET) * np.exp(-usual) - LOG_OFFSET) / light
    return np.clip(ink, 0.0, np.exp(-_MINIMUM_STEP)), light


def _gray(logarithm: np.ndarray) -> np.ndarray:
    return np.maximum(np.exp(logarithm) - LOG_OFFSET, 0.0)


def _level_ratios(template: np.ndarray) -> np.ndarray:
    """Return ln of the likelihood of levels as ink over that as paper, (k, bins).

    Projected light has few levels: paper without light has another one than ink in the light.
    """
    ink, paper = (_densities(template[..., side]) for side in (0, 1))
    return np.asarray(np.log((ink + _FLOOR) / (paper + _FLOOR)))


def _level_evidence(sides: np.ndarray, frames: np.ndarray, ratios: np.ndarray) -> np.ndarray:
    """Return the evidence for dots from the levels inside, by the `_level_ratios` of targets."""
    rows = np.arange(len(sides))[:, None, None]
    return _SHARE * independent_rays(frames) * ratios[rows, _bins(sides[..., 0])].sum(axis=2)


def _bins(values: np.ndarray) -> np.ndarray:
    """Return the numbers of the bins of values of ln(I + 8)."""
    return np.clip(((values - np.log(LOG_OFFSET)) / _BIN).astype(int), 0, _BINS - 1)


def _densities(values: np.ndarray) -> np.ndarray:
    """Return the densities of the values of each of k targets, smoothed, shape (k, bins)."""
    count = len(values)
    bins = _bins(values) + _BINS * np.arange(count)[:, None, None]
    counts = np.bincount(bins.ravel(), minlength=_BINS * count).reshape(count, _BINS)
    # A product of matrices would round those of a target by how many there are.
    smoothed = np.einsum('kb,bc->kc', counts, _SMOOTHING)
    return np.asarray(smoothed / (bins[0].size * _BIN if count else 1.0))


@dataclass(frozen=True, slots=True)
class Readings:
    """What k groups of dots were read as.

    Attributes
    ----------
    words : ndarray of int64, shape (k,)
        Value of the best code.
    margin : ndarray of float64, shape (k,)
        Evidence for it over that for the second best, in ln.
    support : ndarray of float64, shape (k,)
        Evidence for a target with this code: for its dots, and against dots at all other places,
        as a share of the most there may be.
    """

    words: np.ndarray
    margin: np.ndarray
    support: np.ndarray


def read_codes(
    evidence: Evidence,
    scale: np.ndarray,
    family: PointPrint,
    expected: frozenset[int] = frozenset(),
) -> Readings:
    """Return the codes that the evidence speaks for, of those whose IDs are `expected` if any are.

    `scale`, shape (k,), is the radius of the dots in that of the printed design. What is seen at
    places nearer to dots than two radii is these dots, and tells nothing new.
    """
    count = len(family.template)
    limited = np.clip(evidence.ratio, -_MAXIMUM_AGAINST, _MAXIMUM_FOR)
    template, positions = limited[:, :count], limited[:, count:]
    incidence = _incidence(family)
    scores = np.clip(evidence.ratio[:, count:], -_MAXIMUM_AGAINST, _MAXIMUM_OF_DOT) @ incidence.T
    if expected:
        scores = scores - against(family.numbers, expected)
    best = scores.argmax(axis=1)
    each = np.broadcast_to(np.arange(scores.shape[1]), scores.shape)
    margin = np.minimum(margins(each, scores, best), _GREATEST_MARGIN)
    marked = incidence[best] > 0
    empty = ~marked & ~_covered(marked, scale, family)
    empty_places = np.where(empty, -positions, 0.0).sum(axis=1)
    dots = template.sum(axis=1) + np.where(marked, positions, 0.0).sum(axis=1)
    empty &= evidence.inside[:, count:]
    most = (count + marked.sum(axis=1)) * _MAXIMUM_FOR + empty.sum(axis=1) * _MAXIMUM_AGAINST
    return Readings(
        words=family.words[best],
        margin=margin,
        support=(dots + empty_places) / most,
    )


def _most_support(seen: _Seen, family: PointPrint) -> np.ndarray:
    """Return bounds of the support of codes, (k,), from the evidence at the places looked at.

    Positions that a dot may cover, and those that were not looked at, tell nothing against any.
    """
    count = len(family.template)
    limited = np.clip(seen.evidence.ratio, -_MAXIMUM_AGAINST, _MAXIMUM_FOR)
    template, positions = limited[:, :count], limited[:, count:]
    missing = np.minimum(_MAXIMUM_FOR - positions, _MAXIMUM_AGAINST + positions)
    gaps = _gaps(family)[:, : positions.shape[1]]
    telling = seen.inside[:, count:] & (gaps.min(axis=0) >= seen.scale[:, None])
    lacking = (_MAXIMUM_FOR - template).sum(axis=1) + np.where(telling, missing, 0.0).sum(axis=1)
    dots, empty = count + family.rule.dots, len(family.positions) - family.rule.dots
    return 1 - lacking / (dots * _MAXIMUM_FOR + empty * _MAXIMUM_AGAINST)


@lru_cache(maxsize=8)
def _gaps(family: PointPrint) -> np.ndarray:
    """Return how far positions are from other places, in their radii, (places, positions)."""
    count, places, radii = len(family.template), family.places, family.radii
    gaps = np.hypot(*(places[:, None] - places[count:]).transpose(2, 0, 1))
    gaps /= radii[:, None] + radii[count:]
    gaps[np.arange(count, len(places)), np.arange(len(places) - count)] = np.inf
    return np.asarray(gaps)


def _covered(marked: np.ndarray, scale: np.ndarray, family: PointPrint) -> np.ndarray:
    """Return which positions lie within two radii of a dot, shape (k, positions)."""
    count, near = len(family.template), _gaps(family) < scale[:, None, None]
    shown = np.concatenate([np.ones((len(marked), count), bool), marked], axis=1)
    return (near & shown[:, :, None]).any(axis=1)


@lru_cache(maxsize=8)
def _incidence(family: PointPrint) -> np.ndarray:
    """Return which positions each code has dots at, 0 or 1, shape (codes, positions)."""
    bits = family.words[:, None] >> family.position_numbers & 1
    return bits.astype(np.float64)
