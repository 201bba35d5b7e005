"""Damped Gauss-Newton iterations, with or without a robust loss [1]_, [2]_.

References
----------
.. [1] Triggs et al., Bundle adjustment: a modern synthesis, 2000, sections 3 and 4.
.. [2] Nocedal & Wright, Numerical Optimization, 2006, 10.3 and 18.3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ahf_ros.network import normals
from ahf_ros.network.network import FloatArray
from ahf_ros.network.normals import Layout, Normals, Reduced
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


def normal_equations(
    layout: Layout, state: NetworkState, knowledge: Knowledge
) -> tuple[Reduced, FloatArray]:
    """Return the reduced normal equations at converged values, and their border (u, h)."""
    design = normals.linearise(layout, state)
    equations = normals.assemble(layout, design, np.ones(len(layout.xy)))
    conditions = knowledge(state)
    return normals.reduce(conditions.added(equations)), conditions.border()[0]


def _losses(lengths: FloatArray, spread: float, loss: Loss) -> tuple[float, FloatArray]:
    """Return the sum of losses and the weights (m,) of whitened residuals of these lengths."""
    squares = lengths**2
    if loss == 'squares':
        return float(squares.sum()), np.ones(len(lengths))
    unit = (_TUNING * spread) ** 2
    relative = squares / unit
    return float(unit * np.log1p(relative).sum()), 1 / (1 + relative)
