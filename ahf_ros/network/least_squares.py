"""Damped Gauss-Newton iterations, with or without a robust loss [1]_, [2]_, and covariances.

Covariances, of what is estimated and of the image points that are computed, come from the inverse
of the reduced and bordered normal equations; none is conditioned on anything else being known
[3]_.

References
----------
.. [1] Triggs et al., Bundle adjustment: a modern synthesis, 2000, sections 3 and 4.
.. [2] Nocedal & Wright, Numerical Optimization, 2006, 10.3 and 18.3.
.. [3] Förstner & Wrobel, Photogrammetric Computer Vision, 2016, 4.2 and 15.3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ahf_ros.network import normals
from ahf_ros.network.network import FloatArray
from ahf_ros.network.normals import Design, Layout, Normals
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
    for number in range(rounds):
        iteration(number + 1)
        lengths = normals.whitened_lengths(layout, state)
        spread = 1.0 if loss == 'squares' else max(1.0, normals.robust_spread(lengths))
        conditions = knowledge(state)
        weights = _losses(lengths, spread, loss)[1]
        equations = normals.assemble(layout, normals.linearise(layout, state), weights)
        equations = conditions.added(equations)
        border, gaps = conditions.border()
        before = _losses(lengths, spread, loss)[0] + conditions.cost
        while True:
            reduced = normals.reduce(equations.damped(damping))
            poses, rest, multipliers = normals.solve(reduced, border, gaps)
            promised = float(
                (equations.pose_right * poses).sum() + equations.rest_right @ rest
            ) + float(2 * np.abs(multipliers) @ np.abs(gaps))
            if abs(promised) < enough * spread**2 + _ROUNDING * before:
                return normals.changed(layout, state, poses, rest), True
            trial = normals.changed(layout, state, poses, rest)
            known = knowledge(trial)
            after = _losses(normals.whitened_lengths(layout, trial), spread, loss)[0] + known.cost
            penalty = 2 * np.abs(multipliers)  # of what has to hold exactly [2]_
            if after + penalty @ np.abs(known.border()[1]) < before + penalty @ np.abs(gaps):
                state, damping = trial, max(damping / 10, np.finfo(float).eps)
                break
            damping *= 10
            if damping > _LARGEST_DAMPING:
                return state, False
    return state, False


@dataclass(frozen=True)
class Precision:
    """Covariances of points and free parameters (u, u), of poses (n, 6, 6), and between them."""

    rest: FloatArray
    poses: FloatArray
    crossed: FloatArray


def precision(layout: Layout, state: NetworkState, knowledge: Knowledge) -> Precision:
    """Return the covariances at converged values, in the datum that is known, for unit weights."""
    equations = normals.assemble(layout, normals.linearise(layout, state), np.ones(len(layout.xy)))
    conditions = knowledge(state)
    reduced, border = normals.reduce(conditions.added(equations)), conditions.border()[0]
    unknowns = len(reduced.matrix)
    inverse = np.linalg.inv(normals.bordered(reduced, border)[0])[:unknowns, :unknowns]
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
