"""Normal equations of a network: poses are eliminated in 6x6 blocks, the rest stays dense [1]_.

Targets are few and photographs many. The unknowns that stay, three coordinates a point and the
free parameters of the cameras, make one dense matrix, whose inverse is the full covariance; what
is eliminated costs a 6x6 factorisation a photograph, so that time grows linearly with them. The
datum, and whatever is known without error, borders the reduced matrix.

References
----------
.. [1] Triggs et al., Bundle adjustment: a modern synthesis, 2000, sections 6 and 9.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

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

    @property
    def columns(self) -> IntArray:
        """Columns (cameras, parameters) of free parameters after those of points, else -1."""
        columns = np.full(self.free.shape, -1)
        columns[self.free] = 3 * len(self.points) + np.arange(np.count_nonzero(self.free))
        return columns

    @property
    def unknowns(self) -> int:
        """Number of unknowns that are not eliminated."""
        return 3 * len(self.points) + int(np.count_nonzero(self.free))


@dataclass(frozen=True)
class Normals:
    """Normal equations: (n, 6, 6) of poses, (n, 6, u) mixed, (u, u) of the rest, right sides."""

    pose: FloatArray
    mixed: FloatArray
    rest: FloatArray
    pose_right: FloatArray
    rest_right: FloatArray

    def damped(self, damping: float) -> Normals:
        """Return the normal equations with their diagonals enlarged, after Marquardt."""
        pose, rest = self.pose.copy(), self.rest.copy()
        pose[:, np.arange(6), np.arange(6)] *= 1 + damping
        rest[np.diag_indices_from(rest)] *= 1 + damping
        return replace(self, pose=pose, rest=rest)


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
    return _residuals(layout, state, np.arange(len(layout.xy)), points)


def lengths_at(
    layout: Layout, state: NetworkState, rows: IntArray, points: FloatArray
) -> FloatArray:
    """Return the residuals' lengths (n,) in standard deviations, were points (n, 3) those of rows.

    They are `BEHIND` where a point is behind the camera.
    """
    whitened = layout.whitening[rows] @ _residuals(layout, state, rows, points)[:, :, None]
    lengths = np.linalg.norm(whitened[:, :, 0], axis=1)
    return np.nan_to_num(lengths, nan=BEHIND, posinf=BEHIND)


def whitened_lengths(layout: Layout, state: NetworkState) -> FloatArray:
    """Return the residuals' lengths (m,) in standard deviations, `BEHIND` behind the camera."""
    points = state.points[layout.points[layout.point]]
    return lengths_at(layout, state, np.arange(len(layout.xy)), points)


def _residuals(
    layout: Layout, state: NetworkState, rows: IntArray, points: FloatArray
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


def assemble(layout: Layout, design: Design, weights: FloatArray) -> Normals:
    """Return the normal equations of observation equations with further weights (m,)."""
    root = np.sqrt(weights)[:, None, None]
    pose, point, calibration = (
        np.ascontiguousarray(root * part)
        for part in (design.by_pose, design.by_point, design.by_calibration)
    )
    right = root * design.misclosure[:, :, None]
    images = Groups.by(layout.photograph)
    rays = Groups.by(layout.point)
    count, unknowns = len(layout.photographs), layout.unknowns
    coordinates = np.arange(3 * len(layout.points)).reshape(-1, 3)

    mixed = np.zeros((count, 6, unknowns))
    mixed[
        layout.photograph[:, None, None],
        np.arange(6)[:, None],
        coordinates[layout.point][:, None, :],
    ] = products(pose, point)
    rest = np.zeros((unknowns, unknowns))
    rest_right = np.zeros(unknowns)
    rest[coordinates[:, :, None], coordinates[:, None, :]] = rays.sum(products(point, point))
    rest_right[coordinates] = rays.sum(products(point, right)[:, :, 0])
    columns = layout.columns
    for index in np.flatnonzero(layout.free.any(axis=1)):
        free = layout.free[index]
        own = columns[index, free]
        mine = layout.camera == index
        part = calibration[mine][:, :, free]
        of_images = Groups.by(layout.photograph[mine])
        mixed[of_images.labels[:, None, None], np.arange(6)[:, None], own] = of_images.sum(
            products(pose[mine], part)
        )
        of_points = Groups.by(layout.point[mine])
        block = of_points.sum(products(point[mine], part)).reshape(-1, len(own))
        rows = coordinates[of_points.labels].reshape(-1)
        rest[rows[:, None], own] = block
        rest[own[:, None], rows] = block.T
        flat = part.reshape(-1, len(own))
        rest[own[:, None], own] = flat.T @ flat
        rest_right[own] = flat.T @ right[mine].reshape(-1)
    return Normals(
        images.sum(products(pose, pose)),
        mixed,
        rest,
        images.sum(products(pose, right)[:, :, 0]),
        rest_right,
    )


@dataclass(frozen=True)
class Reduced:
    """What remains without poses: their Cholesky factors, L^-1 of mixed blocks, and the rest."""

    factor: FloatArray
    half: FloatArray
    half_right: FloatArray
    matrix: FloatArray
    right: FloatArray
    scale: FloatArray
    """(u,) by which rows and columns are multiplied before anything is solved or inverted."""


def reduce(normals: Normals) -> Reduced:
    """Eliminate the poses by their Schur complement."""
    factor = np.asarray(np.linalg.cholesky(normals.pose), dtype=float)
    half = np.linalg.solve(factor, normals.mixed)
    half_right = np.linalg.solve(factor, normals.pose_right[:, :, None])[:, :, 0]
    flat = half.reshape(-1, half.shape[2])
    matrix = normals.rest - flat.T @ flat
    least = np.finfo(float).eps * np.diag(normals.rest) + np.finfo(float).tiny
    return Reduced(
        factor,
        half,
        half_right,
        matrix,
        normals.rest_right - flat.T @ half_right.reshape(-1),
        np.maximum(np.diag(matrix), least) ** -0.5,
    )


def solve(
    reduced: Reduced, border: FloatArray, gap: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return changes of poses (n, 6), of the rest (u,), and multipliers (h,) of the border.

    With the border's columns H (u, h), the changes x of the rest fulfil H'x = gap.
    """
    scale = reduced.scale
    matrix, size = bordered(reduced, border)
    changes = np.linalg.solve(matrix, np.concatenate([scale * reduced.right, gap / size]))
    rest = scale * changes[: len(scale)]
    left = reduced.half_right - reduced.half @ rest
    poses = np.linalg.solve(reduced.factor.transpose(0, 2, 1), left[:, :, None])[:, :, 0]
    return poses, rest, changes[len(scale) :] / size


def changed(
    layout: Layout, state: NetworkState, poses: FloatArray, rest: FloatArray
) -> NetworkState:
    """Return approximate values with changes of poses (n, 6) and of the rest (u,) added."""
    calibrations, rotations = state.calibrations.copy(), state.rotations.copy()
    positions, points = state.positions.copy(), state.points.copy()
    calibrations[layout.free] += rest[layout.columns[layout.free]]
    points[layout.points] += rest[: 3 * len(layout.points)].reshape(-1, 3)
    positions[layout.photographs] += poses[:, :3]
    rotations[layout.photographs] = (
        camera.rotation_matrices(poses[:, 3:]) @ rotations[layout.photographs]
    )
    return replace(
        state, calibrations=calibrations, rotations=rotations, positions=positions, points=points
    )


def products(left: FloatArray, right: FloatArray) -> FloatArray:
    """Return A'B (m, a, b) of rows' blocks (m, 2, a) and (m, 2, b)."""
    return left[:, 0, :, None] * right[:, 0, None, :] + left[:, 1, :, None] * right[:, 1, None, :]


def bordered(reduced: Reduced, border: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the scaled and bordered matrix, and the sizes (h,) that its border had.

    Columns of the border that depend on each other are a LinAlgError: of the singular matrix that
    they would make, rounding decides whether it can be solved.
    """
    scale = reduced.scale
    columns = scale[:, None] * border
    size = np.linalg.norm(columns, axis=0)
    columns = columns / size
    if columns.size and np.linalg.matrix_rank(columns) < len(size):
        raise np.linalg.LinAlgError('columns of the border depend on each other')
    empty = np.zeros((border.shape[1], border.shape[1]))
    scaled = scale[:, None] * reduced.matrix * scale
    return np.block([[scaled, columns], [columns.T, empty]]), size
