"""What was observed: image points of targets, and what is known of cameras, lengths and points."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class Observations:
    """Image points, one a row: photograph and point by index, place in px and its covariance.

    (0, 0) is the centre of the first pixel, x goes right and y down. `photograph` and `point` are
    (m,), `xy` is (m, 2) in px, `covariance` (m, 2, 2) in px².
    """

    photograph: IntArray
    point: IntArray
    xy: FloatArray
    covariance: FloatArray


@dataclass(frozen=True)
class ScaleBar:
    """A known distance between two targets in units of the object; a check bar is not used."""

    ends: tuple[str, str]
    length: float
    sigma: float
    check: bool = False


@dataclass(frozen=True)
class ControlPoint:
    """Known coordinates of a target, with their 3x3 covariance; a check point is not used.

    A covariance of zero fixes the point.
    """

    name: str
    xyz: FloatArray
    covariance: FloatArray
    check: bool = False


@dataclass(frozen=True)
class CameraView:
    """A camera before the adjustment: its size in px, and its calibration where one is known."""

    name: str
    width: int
    height: int
    focal_length: float | None = None
    """Start value in px where no calibration is given; None where nothing is known."""
    calibration: FloatArray | None = None
    """All of `camera.PARAMETERS` where a calibration is given."""
    fixed: bool = False
    """Whether the calibration is kept as it is."""


@dataclass(frozen=True)
class Network:
    """Photographs by name with the index of their cameras, targets by name, and what was observed.

    Names of targets are their IDs as text, `family:ID` where several families are there.
    """

    photographs: tuple[str, ...]
    camera_of: IntArray
    cameras: tuple[CameraView, ...]
    targets: tuple[str, ...]
    observations: Observations
    bars: tuple[ScaleBar, ...] = ()
    control: tuple[ControlPoint, ...] = ()
    unit: str = ''
    """Unit of bars and control, empty where neither gives a scale."""
    set_aside: tuple[Rejection, ...] = field(default=())
    """Observations that were no part of the network from the start."""


@dataclass(frozen=True)
class Rejection:
    """An observation that is not used, and why; `xy` in px."""

    photograph: str
    target: str
    xy: tuple[float, float]
    reason: str
    normalised_residual: float | None = None
