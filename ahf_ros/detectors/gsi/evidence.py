"""Evidence for and against a dot at each place of a target.

The usual step of ln I is that of its template dots.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.codes.gsi import PointFamily
from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.features.dot_evidence import circle_steps, dot_evidence
from ahf_ros.features.homography import local_frames

_FAINTEST = 0.12  # step of ln of a dot


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
    shape = (len(homographies), len(family.places))
    frames = local_frames(homographies, family.places, family.radii)
    steps, inside = circle_steps(log, frames.reshape(-1, 3, 3))
    steps = steps.reshape(*shape, steps.shape[1]) * polarity[:, None, None]
    template = np.median(steps[:, : len(family.template)], axis=2)
    usual = np.median(template, axis=1)
    relative = steps / np.maximum(usual, _FAINTEST)[:, None, None]
    inside = inside.reshape(shape)
    return Evidence(np.where(inside, dot_evidence(relative, frames), 0.0), inside, usual)
