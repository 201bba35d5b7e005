"""Alignment of measured points to nominal ones, with the covariance of what comes out.

An alignment moves all points rigidly, or with a scale, until conditions B (x - n) = 0 hold between
measured points x and nominal ones n. With the columns of G as the points' changes under a movement
(`datum.movements`),

- a best fit has B = G'W: it minimises (x - n)' W (x - n);
- 3-2-1 takes three coordinates to their nominal values in one axis, two in another and one in the
  third: B has the rows of these coordinates.

Either way dx' = (I - G (B G)^-1 B) dx, an S-transformation, which takes the covariance along.

W is the inverse of the covariance. That of a free network is singular, so that k G G' is added,
which changes no fit (Rao, Linear Statistical Inference, 1973, 4i.4): a free network on the points
that hold its datum is fitted with equal weights, since its covariance has no say about its frame.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ahf_ros.network.datum import movements
from ahf_ros.network.network import FloatArray
from ahf_ros.network.points import MeasuredPoints, entries
from ahf_ros.network.similarity import Similarity, on_a_line, similarity_between

Weights = Literal['covariance', 'equal']

_ROUNDS = 50
_CONVERGED = 1e-12  # of the size of the points


@dataclass(frozen=True)
class Alignment:
    """Measured points in the frame of nominal ones, and how they came there."""

    similarity: Similarity
    points: MeasuredPoints
    """All measured points; their covariance is that of an alignment without errors of n."""
    used: tuple[str, ...]
    """Names of the targets that the alignment rests on."""


def unaligned(points: MeasuredPoints) -> Alignment:
    """Return points as they are, in the frame of nominal ones already."""
    return Alignment(Similarity(), points, ())


def best_fit(
    points: MeasuredPoints,
    nominal: Mapping[str, FloatArray],
    *,
    on: Sequence[str] = (),
    scale: bool = False,
    weights: Weights = 'covariance',
) -> Alignment:
    """Return points aligned to nominal coordinates (3,) by name, on all common or chosen targets.

    With `scale` the alignment is a similarity, else rigid, which needs a network with a scale.
    Weights are the inverse of the whole covariance, or equal. A ValueError says so if there are
    fewer than three targets, or all are on a line.
    """
    _check_scale(points, scale)
    used = _checked_names(points, nominal, on)
    given = points.chosen(used).covariance

    def condition(movement: Similarity, free: FloatArray) -> FloatArray:
        if weights == 'equal':
            return free.T
        covariance = movement.turned(given)
        completed = covariance + np.trace(covariance) / len(free) * free @ free.T
        try:
            return np.linalg.solve(completed, free).T
        except np.linalg.LinAlgError:
            raise ValueError(
                'covariance of the targets of the alignment is singular beyond the datum, '
                'accepted are weights that are equal'
            ) from None

    return _aligned(points, used, nominal, scale, condition)


def three_two_one(
    points: MeasuredPoints,
    nominal: Mapping[str, FloatArray],
    *,
    plane: Sequence[str],
    line: Sequence[str],
    point: str,
    axes: str = 'zyx',
) -> Alignment:
    """Return points aligned by six coordinates, which become nominal.

    These are those of three targets across the `plane`, of two across the `line` and of one at
    the `point`, in three axes of the nominal frame; a target may serve for several. A ValueError
    says so if they do not hold all movements.
    """
    if len(plane) != 3 or len(line) != 2:
        raise ValueError(
            f'plane has {len(plane)} and line {len(line)} targets, accepted are three and two'
        )
    if sorted(axes) != ['x', 'y', 'z']:
        raise ValueError(f'axes is {axes!r}, accepted are x, y and z in any order')
    held = [*((name, axes[0]) for name in plane), *((name, axes[1]) for name in line)]
    held.append((point, axes[2]))
    _check_scale(points, scale=False)
    used = _checked_names(points, nominal, tuple(dict.fromkeys(name for name, _ in held)))
    selection = np.zeros((6, 3 * len(used)))
    for row, (name, axis) in enumerate(held):
        selection[row, 3 * used.index(name) + 'xyz'.index(axis)] = 1

    return _aligned(points, used, nominal, False, lambda *_: selection)


def _aligned(
    points: MeasuredPoints,
    used: tuple[str, ...],
    nominal: Mapping[str, FloatArray],
    scale: bool,
    condition: Callable[[Similarity, FloatArray], FloatArray],
) -> Alignment:
    """Return the alignment for which a condition holds, B of a movement and G of its targets."""
    rows = points.indices(used)
    some = entries(rows)
    aim = np.array([nominal[name] for name in used], float)
    movement = similarity_between(points.xyz[rows], aim, scale)
    size = float(np.ptp(aim, axis=0).max())
    for _ in range(_ROUNDS):
        moved = movement.moved(points.xyz)
        free = movements(moved, scale)
        needed = condition(movement, free[some])
        normal = needed @ free[some]
        if np.linalg.cond(normal) > 1 / np.finfo(float).eps:
            raise ValueError(f'targets {", ".join(used)} do not hold all movements')
        step = free @ np.linalg.solve(normal, needed @ (aim - moved[rows]).ravel())
        movement = similarity_between(points.xyz, moved + step.reshape(-1, 3), scale)
        if np.abs(step).max() < _CONVERGED * size:
            break
    else:
        raise ValueError(f'the alignment on {", ".join(used)} does not converge')
    projection = np.eye(len(free))
    projection[:, some] -= free @ np.linalg.solve(normal, needed)
    return Alignment(
        movement,
        replace(
            points,
            xyz=movement.moved(points.xyz),
            covariance=projection @ movement.turned(points.covariance) @ projection.T,
        ),
        used,
    )


def _check_scale(points: MeasuredPoints, scale: bool) -> None:
    if not scale and not points.unit:
        raise ValueError('the network has no scale, accepted is an alignment that determines it')


def _checked_names(
    points: MeasuredPoints, nominal: Mapping[str, FloatArray], on: Sequence[str]
) -> tuple[str, ...]:
    """Return the targets of an alignment, which are enough and not on a line."""
    if missing := [name for name in on if name not in nominal]:
        raise ValueError(f'targets {", ".join(missing)} have no nominal coordinates')
    points.indices(on)
    used = tuple(on) or tuple(name for name in points.names if name in nominal)
    if len(used) < 3:
        raise ValueError(
            f'{len(used)} targets have measured and nominal coordinates, accepted are three or '
            'more'
        )
    for name in used:
        if np.shape(nominal[name]) != (3,) or not np.isfinite(nominal[name]).all():
            raise ValueError(
                f'nominal coordinates of {name} are {nominal[name]}, accepted are three numbers'
            )
    for xyz in (points.xyz[points.indices(used)], np.array([nominal[name] for name in used])):
        if on_a_line(xyz):
            raise ValueError(f'targets {", ".join(used)} are on a line, accepted are others, too')
    return used
