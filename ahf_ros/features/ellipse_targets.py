"""Targets made from frames: centre, ellipse and covariance as reported."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ahf_ros.features.frame import ellipse_axes
from ahf_ros.target import UNDECODED, Target


def ellipse_fields(
    frames: np.ndarray, covariance: np.ndarray, edge_shift: np.ndarray | None = None
) -> list[dict[str, Any]]:
    """Return the fields of `Target` that say where and how large it is.

    Parameters
    ----------
    frames, covariance, edge_shift : ndarray
        As for `targets_from_frames`.
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
) -> list[Target]:
    """Return targets, in the order given.

    Parameters
    ----------
    frames : ndarray of float64, shape (k, 3, 3)
        In px of the image.
    covariance : ndarray of float64, shape (k, 2, 2)
        Of the image of the centre, px^2.
    ids : ndarray of int, shape (k,)
        `UNDECODED` where the code word is not certain.
    codes : ndarray of int, shape (k,)
        Code words; 0 is reported where the ID is `UNDECODED`.
    confidence : ndarray of float64, shape (k,)
    family : str, or ndarray of str, shape (k,)
        Names of the families of the codes; none is reported where the ID is `UNDECODED`.
    edge_shift : ndarray of float64, shape (k,), optional
        As in `Target`, px; NaN where it is unknown, as all are by default.
    """
    undecoded = ids == UNDECODED
    columns = (ids, np.where(undecoded, 0, codes), confidence, np.where(undecoded, '', family))
    fields = ellipse_fields(frames, covariance, edge_shift)
    rows = (*(column.tolist() for column in columns), fields)
    return [
        Target(id=identifier, code=code, confidence=certainty, family=name, **places)
        for identifier, code, certainty, name, places in zip(*rows, strict=True)
    ]
