"""Images without the targets that are known, so that only what is left is looked at."""

from __future__ import annotations

from collections.abc import Iterable
from math import hypot

import numpy as np

from ahf_ros.base.target import DottedTarget, Prints, Target, reach_of
from ahf_ros.vision.frame import affine_frames
from ahf_ros.vision.parts import Part

MARGIN = 1.15
"""Times the reach of a target, within which the blur of its edges is."""

_ANGLES = 64  # in which the surroundings of a target are looked at


def without_targets(
    image: np.ndarray, targets: Iterable[Target], prints: Prints, part: Part | None = None
) -> np.ndarray:
    """Return an image in which targets are painted over with the light about them.

    Parameters
    ----------
    image : ndarray, shape (height, width)
    targets : iterable of Target
    prints : mapping of str to FamilyRecord
        Their families by name; a target of another one ends with its ellipse.
    part : tuple of 4 int, optional
        Part of the image that is returned, see `ahf_ros.families.contract.Part`.

    Returns
    -------
    ndarray
        Of the same shape and type, or that part of it. From the edge of what is painted over to
        its centre, gray values pass smoothly from those of the surroundings to their median, so
        that there is no edge.

    Examples
    --------
    >>> from ahf_ros import SceneSettings, identify, render
    >>> image = render(SceneSettings(width=320, height=240, targets=3, dot_radius=8)).image
    >>> found = identify(image, family='metashape12')
    >>> left = without_targets(image, found, found.prints)
    >>> len(found), len(identify(left, family='metashape12'))
    (3, 0)
    """
    height, width = image.shape
    x0, y0, x1, y1 = part or (0, 0, width, height)
    left = image[y0:y1, x0:x1].copy()
    angles = np.arange(_ANGLES) * 2 * np.pi / _ANGLES
    ellipses = np.array([(it.x, it.y, *_reach(it, prints)) for it in targets]).reshape(-1, 5)
    frames = affine_frames(*ellipses.T)
    circle = np.stack([np.cos(angles), np.sin(angles), np.ones(_ANGLES)])
    rims = np.rint((frames @ circle)[:, :2]).astype(int)
    x, y = rims.swapaxes(0, 1)
    every = image[y.clip(0, height - 1), x.clip(0, width - 1)].astype(float)
    low, high = (
        it.clip((x0, y0), (x1, y1)).tolist() for it in (rims.min(axis=2), rims.max(axis=2) + 1)
    )
    of_targets = low, high, every, np.median(every, axis=1), np.linalg.inv(frames)
    for (first, top), (end, bottom), about, middle, inverse in zip(*of_targets, strict=True):
        if first == end or top == bottom:
            continue
        right, down = np.arange(first, end), np.arange(top, bottom)[:, None]
        across, along = (
            inverse[row, 0] * right + inverse[row, 1] * down + inverse[row, 2] for row in (0, 1)
        )
        outwards = across**2 + along**2  # 1 on the rim
        inside = outwards < 1
        turn = np.arctan2(along, across)[inside] % (2 * np.pi)
        rim_values = np.interp(turn, angles, about, period=2 * np.pi)
        painted = middle + outwards[inside] * (rim_values - middle)
        painted = painted if image.dtype.kind == 'f' else np.rint(painted)
        of_target = left[top - y0 : bottom - y0, first - x0 : end - x0]
        of_target[inside] = painted
    return left


def _reach(target: Target, prints: Prints) -> tuple[float, float, float]:
    """Return semi-axes, px, and direction, rad, of an ellipse that holds a target."""
    times = reach_of(target, prints)
    if isinstance(target, DottedTarget) and target.dots:
        away = max(hypot(x - target.x, y - target.y) + size for x, y, size, *_ in target.dots)
        return MARGIN * away, MARGIN * away, 0.0
    return MARGIN * times * target.semi_major, MARGIN * times * target.semi_minor, target.angle
