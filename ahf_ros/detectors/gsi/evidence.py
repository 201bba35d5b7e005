"""Evidence for and against a dot at each place of a target.

The template dots tell how dark ink is beside paper. Where little light falls, ln(I + 8) has
smaller steps than that. The brighter side of an edge tells how small; noise counts for more.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ahf_ros.codes.gsi import PointFamily
from ahf_ros.detectors.gsi.grouping import Templates
from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.features.dot_evidence import circle_sides, dot_evidence, independent_rays
from ahf_ros.features.frame import ellipse_axes
from ahf_ros.features.homography import local_frames
from ahf_ros.features.robust import median
from ahf_ros.imaging.black import black_lift, lifted
from ahf_ros.imaging.logarithm import LOG_OFFSET

_FAINTEST = 0.12  # step of ln of a dot
_SMALLEST = 0.02  # the same where there is hardly any light
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


@dataclass(frozen=True, slots=True)
class Evidence(ArrayRecord):
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

    Parameters
    ----------
    log : ndarray of int16, shape (height, width)
        LOG_SCALE ln(I + 8).
    templates : Templates
    family : PointFamily
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
    """Return the evidence for dots at all places of targets.

    Parameters
    ----------
    log : ndarray of int16, shape (height, width)
        LOG_SCALE ln(I + 8).
    homographies : ndarray of float64, shape (k, 3, 3)
    polarity : ndarray of int, shape (k,)
    scale : ndarray of float64, shape (k,)
        Radius of the dots in that of the printed design.
    family : PointFamily
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
        of[black] = _lifted(of[black], lift[black, None, None, None])
    steps = (sides[..., 1] - sides[..., 0]) * polarity[:, None, None]
    expected = _expected_steps(sides, polarity, count)
    ratio = dot_evidence(steps / expected, frames, _NOISE / expected)
    levels = np.concatenate([sides, farther], axis=2)
    ratio[:, count:] += _level_evidence(levels, frames, count)
    return Evidence(np.where(inside, ratio, 0.0), inside)


def _expected_steps(sides: np.ndarray, polarity: np.ndarray, count: int) -> np.ndarray:
    """Return the steps of ln(I + 8) that dots have in the light that falls on each ray."""
    brighter = _gray(sides.max(axis=3))
    ink = _ink_and_light(sides, polarity, count)[0][:, None, None]
    expected = np.log((brighter + LOG_OFFSET) / (ink * brighter + LOG_OFFSET))
    return np.maximum(expected, _SMALLEST)


def _ink_and_light(
    sides: np.ndarray, polarity: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the gray value of ink over that of paper, and that of paper in the light."""
    template = sides[:, :count]
    rays = (len(sides), count * sides.shape[2])
    usual = ((template[..., 1] - template[..., 0]) * polarity[:, None, None]).reshape(rays)
    light = _gray(template.max(axis=3)).reshape(rays)
    lit = light >= np.median(light, axis=1, keepdims=True)
    usual = np.maximum(median(usual, lit, 0.0), _FAINTEST)
    light = np.maximum(median(light, lit, 0.0), 1.0)
    ink = ((light + LOG_OFFSET) * np.exp(-usual) - LOG_OFFSET) / light
    return np.clip(ink, 0.0, np.exp(-_FAINTEST)), light


def _gray(logarithm: np.ndarray) -> np.ndarray:
    gray: np.ndarray = np.maximum(np.exp(logarithm) - LOG_OFFSET, 0.0)
    return gray


def _lifted(logarithm: np.ndarray, lift: np.ndarray) -> np.ndarray:
    """Return ln(I + 8) where black is lifted."""
    moved: np.ndarray = np.log(lifted(_gray(logarithm), lift) + LOG_OFFSET)
    return moved


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
    bins = ((values - np.log(LOG_OFFSET)) / _BIN).astype(int)
    return np.clip(bins, 0, _BINS - 1)


def _densities(values: np.ndarray) -> np.ndarray:
    """Return the densities of the values of each of k targets, smoothed, shape (k, bins)."""
    count = len(values)
    bins = _bins(values) + _BINS * np.arange(count)[:, None, None]
    counts = np.bincount(bins.ravel(), minlength=_BINS * count).reshape(count, _BINS)
    densities: np.ndarray = counts @ _SMOOTHING / (bins[0].size * _BIN if count else 1.0)
    return densities
