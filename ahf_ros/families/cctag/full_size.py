"""Places of large CCTags, from the edges of all their circles.

Rays read a target at places that are evenly spaced, whatever its size. Where it is large, they
leave out most of its sharp edges, and these are as far apart as those of other prints.
"""

from __future__ import annotations

import numpy as np

from ahf_ros.base.target import Target
from ahf_ros.prints.cctag import CctagPrint
from ahf_ros.vision.circle_fit import Fit, fit_circles_of_any_blur, on_circles
from ahf_ros.vision.edge_fit import Outlines
from ahf_ros.vision.ellipse_targets import frames_of
from ahf_ros.vision.sampling import sample_circles

_RAYS = 48  # about each circle
_ANGLES = 2 * np.pi * np.arange(_RAYS) / _RAYS
_BESIDE = 2.5  # distance to both sides of an edge, px...
_SHARP = 0.75  # ... within which it has that share of the contrast of rings
_REACH = 0.45  # distance from a circle to look for its edge, narrow rings: not to the next


def fit_rings(
    gray: np.ndarray, frames: np.ndarray, number: int, polarity: np.ndarray, family: CctagPrint
) -> Fit:
    """Move frames (k, 3, 3), right to about two pixels, onto the edges of the rings of an ID.

    The polarity, (k,), is 1 for dark ink, else -1.
    """
    return fit_circles_of_any_blur(
        gray,
        frames,
        _circles(number, polarity, family),
        reach=_REACH * family.narrow,
        projective=True,
    )


def is_sharp(gray: np.ndarray, target: Target, family: CctagPrint) -> bool:
    """Return whether most of the contrast of the rings of a target is within a few px.

    Noise looks like an edge where a blur of more px has left none.
    """
    radii, beside = family.radii(np.array([target.id]))[0], _BESIDE / target.semi_minor
    ends = np.array([radii[0] + family.narrow, *radii, radii[-1] - family.narrow])
    middles = (ends[1:] + ends[:-1]) / 2
    at = np.concatenate([middles, radii + beside, radii - beside])
    values = sample_circles(gray, frames_of([target]), _ANGLES, at).mean(axis=(0, 1))
    of_rings, outside, inside = np.split(values, np.cumsum([len(middles), len(radii)]))
    contrast = np.abs(np.diff(of_rings)).sum()
    return bool(np.abs(outside - inside).sum() >= _SHARP * contrast)


def _circles(number: int, polarity: np.ndarray, family: CctagPrint) -> Outlines:
    """Return the circles of an ID, the outermost first."""
    radii = family.radii(np.array([number]))[0]
    colours = np.repeat(1 - 2 * (np.arange(len(radii)) % 2), _RAYS)
    return on_circles(
        np.tile(_ANGLES, len(radii)),
        np.repeat(radii, _RAYS),
        np.zeros(len(radii) * _RAYS, int),
        polarity[:, None] * colours,
    )
