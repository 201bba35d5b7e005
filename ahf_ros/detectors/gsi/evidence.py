"""Evidence for and against a dot at each place of a target, and the codes it speaks for.

The template dots tell how dark ink is beside paper. Where little light falls, ln(I + 8) has
smaller steps than that. The brighter side of an edge tells how small; noise counts for more.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ahf_ros.codes.gsi import PointFamily
from ahf_ros.detectors.gsi.grouping import Templates
from ahf_ros.features.dot_evidence import circle_sides, dot_evidence, independent_rays
from ahf_ros.features.frame import ellipse_axes
from ahf_ros.features.homography import local_frames
from ahf_ros.features.robust import median
from ahf_ros.imaging.black import black_lift, lifted
from ahf_ros.imaging.logarithm import LOG_OFFSET

_MINIMUM_STEP = 0.12  # step of ln of a dot
_MINIMUM_DARK_STEP = 0.02  # the same where there is hardly any light
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


def seen_templates(log: np.ndarray, templates: Templates, family: PointFamily) -> Templates:
    """Return the templates in the image at whose places there may be dots.

    Of the dots that were found, light may hide one. Where none was found, nothing may speak
    against it: four dots of any lattice are the corners of a template.
    """
    alone = replace(family, positions=family.positions[:0], position_radii=np.zeros(0))
    evidence = find_evidence(
        log, templates.homographies, templates.polarity, templates.scale, alone
    )
    against = evidence.ratio <= _CONTRADICTED
    found = templates.members >= 0
    seen = evidence.inside.all(axis=1) & (found | ~against).all(axis=1)
    return templates.select(np.flatnonzero(seen & (against.sum(axis=1) <= _HIDDEN)))


def find_evidence(
    log: np.ndarray,
    homographies: np.ndarray,
    polarity: np.ndarray,
    scale: np.ndarray,
    family: PointFamily,
) -> Evidence:
    """Return the evidence for dots at all places of k targets.

    `log` is LOG_SCALE ln(I + 8), int16; `scale` the radius of the dots of each target in that of
    the printed design.
    """
    shape, count = (len(homographies), len(family.places)), len(family.template)
    frames = local_frames(homographies, family.places, family.radii * scale[:, None])
    single = frames.reshape(-1, 3, 3)
    sides, inside = circle_sides(log, single)
    farther, _ = circle_sides(log, single, _FARTHER * ellipse_axes(single)[1])
    sides, farther = (of.reshape(*shape, *sides.shape[1:]) for of in (sides, farther))
    inside = inside.reshape(shape)
    lift = black_lift(*_ink_and_light(farther, polarity, count))
    black = np.flatnonzero(lift > 0)
    for of in (sides, farther):
        moved = lifted(_gray(of[black]), lift[black, None, None, None])
        of[black] = np.log(moved + LOG_OFFSET)
    steps = (sides[..., 1] - sides[..., 0]) * polarity[:, None, None]
    expected = _expected_steps(sides, polarity, count)
    ratio = dot_evidence(steps / expected, frames, _NOISE / expected)
    levels = np.concatenate([sides, farther], axis=2)
    ratio[:, count:] += _level_evidence(levels, frames, count)
    return Evidence(ratio=np.where(inside, ratio, 0.0), inside=inside)


def _expected_steps(sides: np.ndarray, polarity: np.ndarray, count: int) -> np.ndarray:
    """Return the steps of ln(I + 8) that dots have in the light that falls on each ray."""
    brighter = _gray(sides.max(axis=3))
    ink = _ink_and_light(sides, polarity, count)[0][:, None, None]
    expected = np.log((brighter + LOG_OFFSET) / (ink * brighter + LOG_OFFSET))
    return np.maximum(expected, _MINIMUM_DARK_STEP)


def _ink_and_light(
    sides: np.ndarray, polarity: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the gray value of ink over that of paper, and that of paper in the light."""
    template = sides[:, :count]
    rays = (len(sides), count * sides.shape[2])
    usual = ((template[..., 1] - template[..., 0]) * polarity[:, None, None]).reshape(rays)
    light = _gray(template.max(axis=3)).reshape(rays)
    lit = light >= np.median(light, axis=1, keepdims=True)
    usual = np.maximum(median(usual, lit, 0.0), _MINIMUM_STEP)
    light = np.maximum(median(light, lit, 0.0), 1.0)
    ink = ((light + LOG_OFFSET) * np.exp(-usual) - LOG_OFFSET) / light
    return np.clip(ink, 0.0, np.exp(-_MINIMUM_STEP)), light


def _gray(logarithm: np.ndarray) -> np.ndarray:
    gray: np.ndarray = np.maximum(np.exp(logarithm) - LOG_OFFSET, 0.0)
    return gray


def _level_evidence(sides: np.ndarray, frames: np.ndarray, count: int) -> np.ndarray:
    """Return the evidence for dots at positions from the levels of ink and paper.

    Projected light has few levels: paper without light has another one than ink in the light.
    """
    ink, paper = (_densities(sides[:, :count, :, side]) for side in (0, 1))
    ratio = np.log((ink + _FLOOR) / (paper + _FLOOR))
    bins = _bins(sides[:, count:, :, 0])
    rows = np.arange(len(sides))[:, None, None]
    return _SHARE * independent_rays(frames[:, count:]) * ratio[rows, bins].sum(axis=2)


def _bins(values: np.ndarray) -> np.ndarray:
    """Return the numbers of the bins of values of ln(I + 8)."""
    return np.clip(((values - np.log(LOG_OFFSET)) / _BIN).astype(int), 0, _BINS - 1)


def _densities(values: np.ndarray) -> np.ndarray:
    """Return the densities of the values of each of k targets, smoothed, shape (k, bins)."""
    count = len(values)
    bins = _bins(values) + _BINS * np.arange(count)[:, None, None]
    counts = np.bincount(bins.ravel(), minlength=_BINS * count).reshape(count, _BINS)
    densities: np.ndarray = counts @ _SMOOTHING / (bins[0].size * _BIN if count else 1.0)
    return densities


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
    weakest : ndarray of float64, shape (k,)
        The second lowest evidence for one of its dots, as light may hide one.
    """

    words: np.ndarray
    margin: np.ndarray
    support: np.ndarray
    weakest: np.ndarray


def read_codes(evidence: Evidence, scale: np.ndarray, family: PointFamily) -> Readings:
    """Return the codes that the evidence speaks for.

    `scale`, shape (k,), is the radius of the dots in that of the printed design. What is seen at
    places nearer to dots than two radii is these dots, and tells nothing new.
    """
    count = len(family.template)
    limited = np.clip(evidence.ratio, -_MAXIMUM_AGAINST, _MAXIMUM_FOR)
    template, positions = limited[:, :count], limited[:, count:]
    incidence = _incidence(family)
    scores = np.clip(evidence.ratio[:, count:], -_MAXIMUM_AGAINST, _MAXIMUM_OF_DOT) @ incidence.T
    rows, best = np.arange(len(scores)), scores.argmax(axis=1)
    highest = scores[rows, best]
    scores[rows, best] = highest - _GREATEST_MARGIN
    margin = highest - scores.max(axis=1)
    marked = incidence[best] > 0
    empty = ~marked & ~_covered(marked, scale, family)
    of_dots = np.concatenate([template, np.where(marked, positions, _MAXIMUM_FOR)], axis=1)
    against = np.where(empty, -positions, 0.0).sum(axis=1)
    dots = template.sum(axis=1) + np.where(marked, positions, 0.0).sum(axis=1)
    empty &= evidence.inside[:, count:]
    most = (count + marked.sum(axis=1)) * _MAXIMUM_FOR + empty.sum(axis=1) * _MAXIMUM_AGAINST
    return Readings(
        words=family.words[best],
        margin=margin,
        support=(dots + against) / most,
        weakest=np.sort(of_dots, axis=1)[:, 1],
    )


def _covered(marked: np.ndarray, scale: np.ndarray, family: PointFamily) -> np.ndarray:
    """Return which positions lie within two radii of a dot, shape (k, positions)."""
    count, places, radii = len(family.template), family.places, family.radii
    gaps = np.hypot(*(places[:, None] - places[count:]).transpose(2, 0, 1))
    near = gaps / (radii[:, None] + radii[count:]) < scale[:, None, None]
    shown = np.concatenate([np.ones((len(marked), count), bool), marked], axis=1)
    covered: np.ndarray = (near & shown[:, :, None]).any(axis=1)
    return covered


@lru_cache(maxsize=8)
def _incidence(family: PointFamily) -> np.ndarray:
    """Return which positions each code has dots at, 0 or 1, shape (codes, positions)."""
    bits = family.words[:, None] >> family.position_numbers & 1
    return bits.astype(np.float64)
