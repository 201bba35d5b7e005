"""Evidence for and against a dot at each place of a target, from the steps of ln I round it.

Where a homography puts a dot, the logarithm of the image has the same step along all rays,
wherever the light falls. Where there is none, it has no step, or that of an edge of light, which
crosses the circle on two sides and in opposite directions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.codes.gsi import PointFamily
from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.features.frame import circle_points, ellipse_axes, project
from ahf_ros.features.homography import local_frames
from ahf_ros.features.log_edges import LOG_SCALE
from ahf_ros.features.sampling import sample, within

_RAYS = 16
_ANGLES = 2 * np.pi * np.arange(_RAYS) / _RAYS
_ASIDE = (0.3, 0.7)  # bounds of the distance of samples from the circle, dot radii
_PIXELS_ASIDE = 1.0  # that distance where it lies between them, px of the minor axis
_FAINTEST = 0.12  # step of ln of a dot
_DOT_SPREAD = (0.3, 0.6)  # standard deviation of steps below and above the usual one, in it
_EMPTY_SPREAD = 0.22  # the same of steps where there is no dot
_FLOOR = 0.12  # share of rays that edges of light disturb
_RANGE = 3.0  # of such steps
_CORRELATION = 2.5  # distance on the circle from where on rays tell something new, px
_PART = 400_000  # samples at a time, which bounds the memory


@dataclass(frozen=True, slots=True)
class Evidence(ArrayRecord):
    """Evidence at the places of k targets; the template dots come before the positions.

    Attributes
    ----------
    ratio : ndarray of float64, shape (k, m)
        ln of the likelihood of a dot over that of none; 0 where the place is not in the image.
    inside : ndarray of bool, shape (k, m)
        Whether it is.
    step : ndarray of float64, shape (k,)
        Usual step of ln of the template dots, from the ground to the dot.
    """

    ratio: np.ndarray
    inside: np.ndarray
    step: np.ndarray


def find_evidence(
    log: np.ndarray, homographies: np.ndarray, polarity: np.ndarray, family: PointFamily
) -> Evidence:
    """Return the evidence for dots at all places of targets.

    Parameters
    ----------
    log : ndarray of int16, shape (height, width)
        LOG_SCALE ln(I + 8).
    homographies : ndarray of float64, shape (k, 3, 3)
    polarity : ndarray of int, shape (k,)
    family : PointFamily
    """
    count = max(_PART // (len(family.places) * _RAYS * 2), 1)
    parts = [
        _evidence(
            log, homographies[start : start + count], polarity[start : start + count], family
        )
        for start in range(0, max(len(homographies), 1), count)
    ]
    return Evidence.joined(parts)


def _evidence(
    log: np.ndarray, homographies: np.ndarray, polarity: np.ndarray, family: PointFamily
) -> Evidence:
    shape = (len(homographies), len(family.places))
    frames = local_frames(homographies, family.places, family.radii).reshape(-1, 3, 3)
    major, minor, _ = ellipse_axes(frames)
    aside = np.clip(_PIXELS_ASIDE / minor, *_ASIDE)
    radii = np.stack([1 - aside, 1 + aside], axis=1)
    pixels = project(frames, circle_points(_ANGLES, radii))
    inside = within(pixels, log.shape).all(axis=(1, 2)).reshape(shape)
    values = sample(log, pixels).astype(np.float64) / LOG_SCALE
    steps = (values[..., 1] - values[..., 0]).reshape(*shape, _RAYS)
    steps *= polarity[:, None, None]
    template = np.median(steps[:, : len(family.template)], axis=2)
    usual = np.median(template, axis=1)
    relative = steps / np.maximum(usual, _FAINTEST)[:, None, None]
    length = 2 * np.pi * np.sqrt(major * minor).reshape(shape)
    share = np.clip(length / _CORRELATION, 4, _RAYS) / _RAYS
    ratio = share * _log_ratio(relative).sum(axis=2)
    return Evidence(np.where(inside, ratio, 0.0), inside, usual)


def _log_ratio(steps: np.ndarray) -> np.ndarray:
    """Return ln of the likelihood of steps at a dot over that where there is none."""
    below, above = _DOT_SPREAD
    spread = np.where(steps < 1, below, above)
    height = 2 / (np.sqrt(2 * np.pi) * (below + above))
    dot = height * np.exp(-0.5 * ((steps - 1) / spread) ** 2)
    none = np.exp(-0.5 * (steps / _EMPTY_SPREAD) ** 2) / (np.sqrt(2 * np.pi) * _EMPTY_SPREAD)
    floor = _FLOOR / _RANGE
    ratio: np.ndarray = np.log(((1 - _FLOOR) * dot + floor) / ((1 - _FLOOR) * none + floor))
    return ratio
