"""Image points that are used, which unknowns they determine, and their residuals."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ahf_ros.network import camera
from ahf_ros.network.network import FloatArray, IntArray, Network
from ahf_ros.network.solution import NetworkState

_FEWEST_POINTS = 3  # of a photograph: six coordinates determine a pose
_FEWEST_RAYS = 2  # of a point
BEHIND = 1e6  # residual in standard deviations of a point behind the camera
_MEDIAN = np.sqrt(2 * np.log(2))  # of the length of a normal 2-vector


@dataclass(frozen=True)
class Groups:
    """Rows grouped by a label: `labels` (g,) in ascending order, and sums of each group."""

    labels: IntArray
    order: IntArray
    starts: IntArray

    @classmethod
    def by(cls, labels: IntArray) -> Groups:
        """Group rows by labels (m,)."""
        order = np.argsort(labels, kind='stable')
        unique, starts = np.unique(labels[order], return_index=True)
        return cls(unique, order, starts)

    def sum(self, rows: FloatArray) -> FloatArray:
        """Return the sums (g, ...) of rows (m, ...)."""
        return np.add.reduceat(rows[self.order], self.starts, axis=0)


@dataclass(frozen=True)
class OfCamera:
    """The observations of a camera with free parameters, grouped by photographs and by points."""

    free: NDArray[np.bool_]
    columns: IntArray
    rows: NDArray[np.bool_]
    images: Groups
    points: Groups


@dataclass(frozen=True)
class Layout:
    """Which observations are used and which unknowns they determine, by compact indices.

    `photographs` and `points` are the indices in the network of those that are determined;
    `photograph` and `point` (m,) index into them. `free` (cameras, parameters) marks what is
    estimated of the calibrations, `equidistant` (cameras,) fisheye lenses. `whitening` (m, 2, 2)
    makes unit weights of the observations.
    """

    observations: IntArray
    photographs: IntArray
    points: IntArray
    photograph: IntArray
    point: IntArray
    camera: IntArray
    xy: FloatArray
    whitening: FloatArray
    free: NDArray[np.bool_]
    equidistant: NDArray[np.bool_]
    backward: bool

    @cached_property
    def columns(self) -> IntArray:
        """Columns (cameras, parameters) of free parameters after those of points, else -1."""
        columns = np.full(self.free.shape, -1)
        columns[self.free] = 3 * len(self.points) + np.arange(np.count_nonzero(self.free))
        return columns

    @cached_property
    def images(self) -> Groups:
        """Observations by photographs."""
        return Groups.by(self.photograph)

    @cached_property
    def rays(self) -> Groups:
        """Observations by points."""
        return Groups.by(self.point)

    @cached_property
    def of_cameras(self) -> tuple[OfCamera, ...]:
        """Observations of each camera with free parameters."""
        found = []
        for index in np.flatnonzero(self.free.any(axis=1)):
            free, rows = self.free[index], self.camera == index
            groups = (Groups.by(of[rows]) for of in (self.photograph, self.point))
            found.append(OfCamera(free, self.columns[index, free], rows, *groups))
        return tuple(found)

    @property
    def unknowns(self) -> int:
        """Number of unknowns that are not eliminated."""
        return 3 * len(self.points) + int(np.count_nonzero(self.free))


def lay_out(
    network: Network,
    start: NetworkState,
    used: NDArray[np.bool_],
    free: NDArray[np.bool_],
    *,
    known: NDArray[np.bool_] | None = None,
    backward: bool = False,
) -> Layout:
    """Return the layout of observations that have approximate values and determine something.

    Photographs need three points and points two rays, or one where `known` (points,) says that a
    point has coordinates of its own.
    """
    observations = network.observations
    used = used & predicted_in_front(network, start)
    rays_needed = np.full(len(network.targets), _FEWEST_RAYS)
    if known is not None:
        rays_needed[known] = 1
    while True:
        images = np.bincount(observations.photograph[used], minlength=len(network.photographs))
        rays = np.bincount(observations.point[used], minlength=len(network.targets))
        keep = used & (images >= _FEWEST_POINTS)[observations.photograph]
        keep &= (rays >= rays_needed)[observations.point]
        if (keep == used).all():
            break
        used = keep
    chosen = np.flatnonzero(used)
    photographs, photograph = np.unique(observations.photograph[chosen], return_inverse=True)
    points, point = np.unique(observations.point[chosen], return_inverse=True)
    cameras = network.camera_of[observations.photograph[chosen]]
    seen = np.zeros(len(network.cameras), dtype=bool)
    seen[cameras] = True
    return Layout(
        chosen,
        photographs,
        points,
        photograph,
        point,
        cameras,
        observations.xy[chosen],
        np.linalg.inv(np.linalg.cholesky(observations.covariance[chosen])),
        free & seen[:, None],
        np.array([view.equidistant for view in network.cameras]),
        backward,
    )


def extended(network: Network, layout: Layout) -> Layout:
    """Return the layout with all observations between its photographs and points, used or not."""
    observations = network.observations
    inside = np.isin(observations.photograph, layout.photographs)
    chosen = np.flatnonzero(inside & np.isin(observations.point, layout.points))
    photographs = observations.photograph[chosen]
    return replace(
        layout,
        observations=chosen,
        photograph=np.searchsorted(layout.photographs, photographs),
        point=np.searchsorted(layout.points, observations.point[chosen]),
        camera=network.camera_of[photographs],
        xy=observations.xy[chosen],
        whitening=np.linalg.inv(np.linalg.cholesky(observations.covariance[chosen])),
    )


def predicted_in_front(network: Network, start: NetworkState) -> NDArray[np.bool_]:
    """Return which observations (m,) have a pose, and a point in front of it."""
    observations = network.observations
    rotation = start.rotations[observations.photograph, 2]
    ray = start.points[observations.point] - start.positions[observations.photograph]
    return np.einsum('mi,mi->m', rotation, ray) > 0


def residuals(layout: Layout, state: NetworkState) -> FloatArray:
    """Return measured minus computed image points (m, 2) in px; NaN behind the camera."""
    points = state.points[layout.points[layout.point]]
    return _residuals(layout, state, slice(None), points)


def lengths_at(
    layout: Layout, state: NetworkState, rows: IntArray | slice, points: FloatArray
) -> FloatArray:
    """Return the residuals' lengths (n,) in standard deviations, were points (n, 3) those of rows.

    They are `BEHIND` where a point is behind the camera.
    """
    whitened = layout.whitening[rows] @ _residuals(layout, state, rows, points)[:, :, None]
    lengths = np.sqrt((whitened[:, :, 0] ** 2).sum(axis=1))
    return np.where(np.isfinite(lengths), lengths, BEHIND)


def whitened_lengths(layout: Layout, state: NetworkState) -> FloatArray:
    """Return the residuals' lengths (m,) in standard deviations, `BEHIND` behind the camera."""
    points = state.points[layout.points[layout.point]]
    return lengths_at(layout, state, slice(None), points)


def _residuals(
    layout: Layout, state: NetworkState, rows: IntArray | slice, points: FloatArray
) -> FloatArray:
    photographs = layout.photographs[layout.photograph[rows]]
    computed = camera.project(
        state.calibrations[layout.camera[rows]],
        state.rotations[photographs],
        state.positions[photographs],
        points,
        layout.xy[rows] if layout.backward else None,
        layout.equidistant[layout.camera[rows]],
    )
    return layout.xy[rows] - computed


def robust_spread(lengths: FloatArray) -> float:
    """Return the standard deviation of residuals from the median of their lengths (m,)."""
    return float(np.median(lengths)) / _MEDIAN


@dataclass(frozen=True)
class Design:
    """Whitened derivatives: (m, 2, 6) by pose, (m, 2, 3) by point, (m, 2, 10) by calibration.

    Derivatives by parameters that are kept fixed are zero. `misclosure` (m, 2) is what the
    observations have over the computed ones.
    """

    by_pose: FloatArray
    by_point: FloatArray
    by_calibration: FloatArray
    misclosure: FloatArray


def linearise(layout: Layout, state: NetworkState) -> Design:
    """Return the observation equations about approximate values."""
    photographs = layout.photographs[layout.photograph]
    linear = camera.linearise(
        state.calibrations[layout.camera],
        state.rotations[photographs],
        state.positions[photographs],
        state.points[layout.points[layout.point]],
        layout.xy if layout.backward else None,
        layout.equidistant[layout.camera],
    )
    whitening = layout.whitening
    return Design(
        whitening @ linear.by_pose,
        whitening @ linear.by_point,
        whitening @ (linear.by_calibration * layout.free[layout.camera][:, None, :]),
        (whitening @ (layout.xy - linear.xy)[:, :, None])[:, :, 0],
    )
