"""Targets made from frames: centre, ellipse and covariance as reported."""

from __future__ import annotations

from typing import Any

import numpy as np

from ahf_ros.features.frame import ellipse_axes
from ahf_ros.target import UNDECODED, Target


def ellipse_fields(frames: np.ndarray, covariance: np.ndarray) -> list[dict[str, Any]]:
    """Return the fields of `Target` that say where it is, from (k, 3, 3) and (k, 2, 2)."""
    columns = (frames[:, 0, 2], frames[:, 1, 2], *ellipse_axes(frames))
    names = ('x', 'y', 'semi_major', 'semi_minor', 'angle')
    return [
        {**dict(zip(names, row, strict=True)), 'covariance': tuple(of_row)}
        for row, of_row in zip(
            np.stack(columns, axis=1).tolist(), covariance.reshape(-1, 4).tolist(), strict=True
        )
    ]


def targets_from_frames(
    frames: np.ndarray,
    covariance: np.ndarray,
    ids: np.ndarray,
    codes: np.ndarray,
    confidence: np.ndarray,
    family: str | np.ndarray,
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
    """
    undecoded = ids == UNDECODED
    columns = (ids, np.where(undecoded, 0, codes), confidence, np.where(undecoded, '', family))
    rows = (*(column.tolist() for column in columns), ellipse_fields(frames, covariance))
    return [
        Target(id=identifier, code=code, confidence=certainty, family=name, **fields)
        for identifier, code, certainty, name, fields in zip(*rows, strict=True)
    ]
