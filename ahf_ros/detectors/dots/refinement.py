"""Places of rings of dots in the image as received, wherever they were identified."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ahf_ros.codes.dots import DotFamily
from ahf_ros.detectors.dots.circles import fit_targets
from ahf_ros.features.ellipse_targets import ellipse_fields
from ahf_ros.features.frame import affine_frames, ellipse_axes
from ahf_ros.target import DottedTarget, Target

_PLAUSIBLE = 0.5  # share of the edges of disc and border
_MAXIMUM_MOVE, _MAXIMUM_MOVE_SHARE = 1.0, 0.2  # that a centre is moved: px, radii


def refined(gray: np.ndarray, targets: Sequence[Target], code: DotFamily) -> list[Target]:
    """Return targets with the places that disc and border have in an image.

    Parameters
    ----------
    gray : ndarray of uint8 or float32, shape (height, width)
        Gray values from 0 to 255.
    targets : sequence of Target
        Those other than `DottedTarget` stay as they are, and so do those whose disc and border
        are not found near to where they should be.
    code : DotFamily
    """
    dotted = [target for target in targets if isinstance(target, DottedTarget)]
    if not dotted:
        return list(targets)
    columns = [(it.x, it.y, it.semi_major, it.semi_minor, it.angle) for it in dotted]
    start = affine_frames(*np.array(columns).T)
    polarity = np.array([target.polarity for target in dotted])
    fit = fit_targets(gray.astype(np.float32, copy=False), start, polarity, code)
    moved = np.hypot(*(fit.frames[:, :2, 2] - start[:, :2, 2]).T)
    reach = np.maximum(_MAXIMUM_MOVE, _MAXIMUM_MOVE_SHARE * ellipse_axes(start)[1])
    good = (fit.share >= _PLAUSIBLE) & (moved <= reach)
    changes = fit.frames @ np.linalg.inv(start)
    places = ellipse_fields(fit.frames, fit.covariance, fit.edge_shift)
    better: dict[Target, Target] = {
        target: replace(target, dots=_moved(target, change), **place)
        for target, change, place, is_good in zip(dotted, changes, places, good, strict=True)
        if is_good
    }
    return [better.get(target, target) for target in targets]


def _moved(target: DottedTarget, change: np.ndarray) -> tuple:
    """Return the ellipses of a target after a change of its frame, shape (3, 3)."""
    frames = change @ affine_frames(*np.array(target.dots).T)
    columns = (*(frames[:, :2, 2] / frames[:, 2:, 2]).T, *ellipse_axes(frames))
    return tuple(zip(*(of.tolist() for of in columns), strict=True))
