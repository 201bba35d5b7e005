"""Damped Gauss-Newton iterations, with or without a robust loss [1]_, [2]_, and covariances.

Targets are few and photographs many. Poses are eliminated in 6x6 blocks from the normal equations;
the unknowns that stay, three coordinates a point and the free parameters of the cameras, make one
dense matrix, whose inverse is the full covariance. What is eliminated costs a 6x6 factorisation a
photograph, so that time grows linearly with them. The datum, and whatever is known without error,
borders the reduced matrix.

Covariances, of what is estimated and of the image points that are computed, come from the inverse
of the reduced and bordered normal equations; none is conditioned on anything else being known
[3]_.

References
----------
.. [1] Triggs et al., Bundle adjustment: a modern synthesis, 2000, sections 3, 4, 6 and 9.
.. [2] Nocedal & Wright, Numerical Optimization, 2006, 10.3 and 18.3.
.. [3] Förstner & Wrobel, Photogrammetric Computer Vision, 2016, 4.2 and 15.3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ahf_ros.network import image_points
from ahf_ros.network.camera import rotation_matrices
from ahf_ros.network.image_points import Design, Layout
from ahf_ros.network.network import FloatArray
from ahf_ros.network.progress import iteration
from ahf_ros.network.solution import NetworkState

Loss = Literal['squares', 'cauchy']

_FIRST_DAMPING = 1e-3
_LARGEST_DAMPING = 1e10
_CONVERGED = 1e-9  # decrease of the sum of weighted squares that a step promises
_ROBUST_CONVERGED = 1e-2  # ... under a robust loss, which only prepares tests
_ROUNDING = 1e-13  # ... relative to the sum
_TUNING = 3.0  # standard deviations at which robust weights fall


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


@dataclass(frozen=True)
class Conditions:
    """What is known beside image points, linearised: rows (c, u), gaps (c,) and variances (c,).

    A gap is known minus computed. Rows of variance zero hold exactly. The last rows may be only
    what is `usual`, which says nothing of the precision of the rest.
    """

    rows: FloatArray
    gaps: FloatArray
    variances: FloatArray
    usual: int = 0

    @property
    def cost(self) -> float:
        """Sum of weighted squares of the gaps that have a variance."""
        soft = self.variances > 0
        return float((self.gaps[soft] ** 2 / self.variances[soft]).sum())

    @property
    def measured(self) -> Conditions:
        """The rows that have a variance and are not only usual."""
        soft = self.variances > 0
        soft[len(soft) - self.usual :] = False
        return Conditions(self.rows[soft], self.gaps[soft], self.variances[soft])

    def added(self, equations: Normals) -> Normals:
        """Return normal equations with the rows that have a variance."""
        soft = self.variances > 0
        rows = self.rows[soft]
        weighted = rows / self.variances[soft, None]
        return replace(
            equations,
            rest=equations.rest + rows.T @ weighted,
            rest_right=equations.rest_right + weighted.T @ self.gaps[soft],
        )

    def border(self) -> tuple[FloatArray, FloatArray]:
        """Return columns (u, h) and gaps (h,) of the rows that hold exactly."""
        hard = self.variances == 0
        return self.rows[hard].T, self.gaps[hard]


Knowledge = Callable[[NetworkState], Conditions]
"""What is known beside image points, and the datum, at approximate values."""


def minimise(
    layout: Layout,
    state: NetworkState,
    knowledge: Knowledge,
    loss: Loss = 'squares',
    rounds: int = 50,
) -> tuple[NetworkState, bool]:
    """Return the values of least loss, and whether the iterations converged in these rounds.

    A robust loss acts on residuals over their standard deviation, or over their robust spread
    where that is larger; it is computed anew in each round.
    """
    damping = _FIRST_DAMPING
    enough = _CONVERGED if loss == 'squares' else _ROBUST_CONVERGED
    lengths, conditions = image_points.whitened_lengths(layout, state), knowledge(state)
    for number in range(rounds):
        iteration(number + 1)
        spread = 1.0 if loss == 'squares' else max(1.0, image_points.robust_spread(lengths))
        weights = _losses(lengths, spread, loss)[1]
        equations = assemble(layout, image_points.linearise(layout, state), weights)
        equations = conditions.added(equations)
        border, gaps = conditions.border()
        before = _losses(lengths, spread, loss)[0] + conditions.cost
        rejected = False
        while True:
            reduced = reduce(equations.damped(damping))
            poses, rest, multipliers = solve(reduced, border, gaps)
            promised = float(
                (equations.pose_right * poses).sum() + equations.rest_right @ rest
            ) + float(2 * np.abs(multipliers) @ np.abs(gaps))
            if abs(promised) < enough * spread**2 + _ROUNDING * before:
                return changed(layout, state, poses, rest), True
            trial = changed(layout, state, poses, rest)
            known, away = knowledge(trial), image_points.whitened_lengths(layout, trial)
            after = _losses(away, spread, loss)[0] + known.cost
            penalty = 2 * np.abs(multipliers)  # of what has to hold exactly [2]_
            if after + penalty @ np.abs(known.border()[1]) < before + penalty @ np.abs(gaps):
                state, lengths, conditions = trial, away, known
                break
            rejected = True
            damping *= 10
            if damping > _LARGEST_DAMPING:
                return state, False
        if not rejected:
            damping = max(damping / 10, np.finfo(float).eps)
    return state, False


@dataclass(frozen=True)
class Precision:
    """Covariances of points and free parameters (u, u), of poses (n, 6, 6), and between them."""

    rest: FloatArray
    poses: FloatArray
    crossed: FloatArray


def precision(layout: Layout, state: NetworkState, knowledge: Knowledge) -> Precision:
    """Return the covariances at converged values, in the datum that is known, for unit weights."""
    equations = assemble(layout, image_points.linearise(layout, state), np.ones(len(layout.xy)))
    conditions = knowledge(state)
    reduced, border = reduce(conditions.added(equations)), conditions.border()[0]
    unknowns = len(reduced.matrix)
    inverse = np.linalg.inv(bordered(reduced, border)[0])[:unknowns, :unknowns]
    rest = reduced.scale[:, None] * (inverse + inverse.T) / 2 * reduced.scale
    held = border[:, (border != 0).sum(axis=0) == 1].any(axis=1)
    rest[held], rest[:, held] = 0.0, 0.0  # exactly: rounding would make variances below zero
    factor = np.linalg.inv(reduced.factor)
    transposed = factor.transpose(0, 2, 1)
    by_rest = -transposed @ reduced.half
    crossed = (by_rest.reshape(-1, unknowns) @ rest).reshape(by_rest.shape)
    poses = transposed @ factor + crossed @ by_rest.transpose(0, 2, 1)
    return Precision(rest, poses, crossed)


def of_computed(layout: Layout, design: Design, known: Precision) -> FloatArray:
    """Return the covariances (m, 2, 2) of computed image points, whitened as the design is."""
    point = 3 * layout.point[:, None] + np.arange(3)
    padded = np.pad(known.rest, (0, 1))  # parameters that are kept fixed have column -1
    crossed = np.pad(known.crossed, ((0, 0), (0, 0), (0, 1)))
    parameter = layout.columns[layout.camera]
    image, six = layout.photograph[:, None, None], np.arange(6)[:, None]
    pairs = (
        (design.by_pose, known.poses[layout.photograph], design.by_pose),
        (design.by_point, padded[point[:, :, None], point[:, None]], design.by_point),
        (design.by_pose, 2 * crossed[image, six, point[:, None]], design.by_point),
    )
    total = sum(
        (left @ covariance @ right.transpose(0, 2, 1) for left, covariance, right in pairs),
        start=np.zeros((len(layout.xy), 2, 2)),
    )
    if layout.free.any():
        by = design.by_calibration
        mixed = 2 * design.by_pose @ crossed[image, six, parameter[:, None]]
        mixed += 2 * design.by_point @ padded[point[:, :, None], parameter[:, None]]
        mixed += by @ padded[parameter[:, :, None], parameter[:, None]]
        total = total + mixed @ by.transpose(0, 2, 1)
    return (total + total.transpose(0, 2, 1)) / 2


def _losses(lengths: FloatArray, spread: float, loss: Loss) -> tuple[float, FloatArray]:
    """Return the sum of losses and the weights (m,) of whitened residuals of these lengths."""
    squares = lengths**2
    if loss == 'squares':
        return float(squares.sum()), np.ones(len(lengths))
    unit = (_TUNING * spread) ** 2
    relative = squares / unit
    return float(unit * np.log1p(relative).sum()), 1 / (1 + relative)


def assemble(layout: Layout, design: Design, weights: FloatArray) -> Normals:
    """Return the normal equations of observation equations with further weights (m,)."""
    root = np.sqrt(weights)[:, None, None]
    pose, point, calibration = (
        np.ascontiguousarray(root * part)
        for part in (design.by_pose, design.by_point, design.by_calibration)
    )
    right = root * design.misclosure[:, :, None]
    images, rays = layout.images, layout.rays
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
    for one in layout.of_cameras:
        mine, own = one.rows, one.columns
        part = calibration[mine][:, :, one.free]
        mixed[one.images.labels[:, None, None], np.arange(6)[:, None], own] = one.images.sum(
            products(pose[mine], part)
        )
        block = one.points.sum(products(point[mine], part)).reshape(-1, len(own))
        rows = coordinates[one.points.labels].reshape(-1)
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
    rotations[layout.photographs] = rotation_matrices(poses[:, 3:]) @ rotations[layout.photographs]
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
    unknowns, every = len(scale), len(scale) + len(size)
    matrix = np.zeros((every, every))
    matrix[:unknowns, :unknowns] = scale[:, None] * reduced.matrix * scale
    matrix[:unknowns, unknowns:], matrix[unknowns:, :unknowns] = columns, columns.T
    return matrix, size
