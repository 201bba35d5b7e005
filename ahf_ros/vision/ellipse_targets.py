"""Targets made from frames: centre, ellipse and covariance as reported."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ahf_ros.base.target import UNDECODED, Target
from ahf_ros.vision.frame import affine_frames, ellipse_axes

_MAXIMUM_MOVE, _MAXIMUM_MOVE_SHARE = 1.0, 0.25  # that a centre is moved: px, or radii of its dot


def frames_of(targets: Sequence[Target]) -> np.ndarray:
    """Return the frames of the ellipses of targets, shape (k, 3, 3)."""
    columns = [(it.x, it.y, it.semi_major, it.semi_minor, it.angle) for it in targets]
    return affine_frames(*np.array(columns).reshape(-1, 5).T)


def stayed(frames: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return which dots are about where they were, (k,), so that they are the same ones."""
    moved = np.hypot(*(frames[:, :2, 2] - start[:, :2, 2]).T)
    reach: np.ndarray = np.maximum(_MAXIMUM_MOVE, _MAXIMUM_MOVE_SHARE * ellipse_axes(start)[1])
    return moved <= reach


def ellipse_fields(
    frames: np.ndarray, covariance: np.ndarray, edge_shift: np.ndarray | None = None
) -> list[dict[str, Any]]:
    """Return the fields of `Target` that say where and how large it is, from k frames in px.

    The covariance of the image of the centre is px^2, shape (k, 2, 2), the edge shift px, shape
    (k,); NaN where it is unknown, as all are by default.
    """
    columns = (frames[:, 0, 2], frames[:, 1, 2], *ellipse_axes(frames))
    names = ('x', 'y', 'semi_major', 'semi_minor', 'angle')
    places = np.stack(columns, axis=1).tolist()
    spreads = covariance.reshape(-1, 4).tolist()
    shifts = [math.nan] * len(frames) if edge_shift is None else edge_shift.tolist()
    return [
        {
            **dict(zip(names, place, strict=True)),
            'covariance': tuple(spread),
            'edge_shift': None if math.isnan(shift) else shift,
        }
        for place, spread, shift in zip(places, spreads, shifts, strict=True)
    ]


def targets_from_frames(
    frames: np.ndarray,
    covariance: np.ndarray,
    ids: np.ndarray,
    codes: np.ndarray,
    confidence: np.ndarray,
    family: str | np.ndarray,
    edge_shift: np.ndarray | None = None,
    polarity: np.ndarray | int = 0,
) -> list[Target]:
    """Return targets, in the order given, whose places are as for `ellipse_fields`.

    Where an ID is `UNDECODED`, neither a code word nor the name of its family is reported.
    """
    undecoded = ids == UNDECODED
    columns = (ids, np.where(undecoded, 0, codes), confidence, np.where(undecoded, '', family))
    fields = ellipse_fields(frames, covariance, edge_shift)
    signs = np.broadcast_to(polarity, len(ids))
    rows = (*(column.tolist() for column in (*columns, signs)), fields)
    return [
        Target(
            id=identifier, code=code, confidence=certainty, family=name, polarity=sign, **places
        )
        for identifier, code, certainty, name, sign, places in zip(*rows, strict=True)
    ]
