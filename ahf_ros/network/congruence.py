"""Whether targets moved between two epochs, and which: the congruence test.

The epochs are brought to one datum, the targets that may have stood still: the second is fitted to
the first, and both covariances go through one S-transformation. With d = x2 - x1, the cofactors
Q = Q1 + Q2 and the pooled variance of unit weight s2 of f = f1 + f2 degrees of freedom,

    T = d' P d / (h s2) ~ F(h, f),    P = Q^+,    h = rank Q,

where nothing moved [1]_. P depends on no datum. With u = P d, a target i that leaves the datum
takes the share r_i = u_i' P_ii^-1 u_i of d' P d with it. Its movement against the others is
P_ii^-1 u_i with the cofactors P_ii^-1, and r_i / (3 s2) ~ F(3, f) tests it alone [2]_. That is
its best estimate if the others stood still, and the same for targets that are out of the datum.

While a test of all targets or one of a single target fails, the one with the largest share leaves
the datum; see `stable_datum`.

References
----------
.. [1] Pelzer, Zur Analyse geodätischer Deformationsmessungen, DGK C 164, 1971.
.. [2] Niemeier, Ausgleichungsrechnung, 2nd ed., De Gruyter 2008.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ahf_ros.base.text import counted
from ahf_ros.network.network import FloatArray
from ahf_ros.network.points import MeasuredPoints
from ahf_ros.network.similarity import on_a_line
from ahf_ros.network.stable_datum import (
    FEWEST,
    Epochs,
    GlobalTest,
    Mask,
    State,
    f_probability,
    localised,
)

LEVEL = 0.05
"""Share of pairs of epochs without movement that a test may take for one with."""


@dataclass(frozen=True)
class VarianceTest:
    """The F-test of two variances of unit weight, on both sides."""

    ratio: float
    """The larger variance over the smaller one."""
    probability: float
    """Of a ratio at least as large if the variances are the same."""
    equal: bool
    """Whether the test accepts that they are, so that they are pooled."""


@dataclass(frozen=True)
class Movement:
    """How a target moved between the epochs, against the targets of the datum other than itself.

    `place`, `xyz` (3,) and `covariance` (3, 3) are in the frame and the unit of the first epoch.
    `probability`, with Bonferroni's correction, is that of a movement at least as significant if
    the target stood still.
    """

    name: str
    place: FloatArray
    xyz: FloatArray
    covariance: FloatArray
    statistic: float
    probability: float
    in_datum: bool
    moved: bool

    @property
    def length(self) -> float:
        """Length of the movement."""
        return float(np.linalg.norm(self.xyz))

    @property
    def sigma(self) -> float:
        """Standard deviation of the movement in its own direction."""
        direction = self.xyz / (self.length or 1.0)
        return float(np.sqrt(max(float(direction @ self.covariance @ direction), 0.0)))


@dataclass(frozen=True)
class Comparison:
    """What the congruence test of two epochs found."""

    movements: tuple[Movement, ...]
    """Of all common targets, in the order of the first epoch."""
    variances: VarianceTest
    tests: tuple[GlobalTest, ...]
    """Of the first datum, then of each after a change."""
    congruent: bool
    """Whether all targets may have stood still."""
    only_first: tuple[str, ...]
    only_second: tuple[str, ...]
    free_scale: bool
    level: float
    unit: str
    warnings: tuple[str, ...]

    @property
    def moved(self) -> tuple[str, ...]:
        """Names of the targets that moved, the most significant first."""
        found = sorted((it for it in self.movements if it.moved), key=lambda it: -it.statistic)
        return tuple(it.name for it in found)


def compare(
    first: MeasuredPoints,
    second: MeasuredPoints,
    *,
    stable: Sequence[str] = (),
    free_scale: bool | None = None,
    level: float = LEVEL,
) -> Comparison:
    """Return which targets moved between two epochs, by the congruence test.

    Parameters
    ----------
    first, second : MeasuredPoints
        The epochs, in any frames. Targets are common if they have the same name.
    stable : sequence of str
        Targets that may define the datum, by default all common ones. More than half of them
        must have stood still.
    free_scale : bool, optional
        Whether only shapes are compared; by default where either epoch has no scale.
    level : float
        Share of pairs of epochs without movement that are taken for ones with, 0 to 1.

    Returns
    -------
    Comparison
        Tests, movements with their covariances, and the targets that moved.

    Raises
    ------
    ValueError
        If fewer than three targets are common or they are on a line, units differ, an adjustment
        has no redundancy, or a covariance is zero or singular beyond its datum.

    Examples
    --------
    >>> from dataclasses import replace
    >>> places = np.array([[x, y, x * y % 2] for x in range(4) for y in range(3)], float)
    >>> names = tuple('ABCDEFGHIJKL')
    >>> covariance = 1e-6 * np.eye(36)
    >>> first = MeasuredPoints(names, places, covariance, redundancy=100, unit='m')
    >>> places = places + 0.02 * (np.arange(12) == 4)[:, None]
    >>> compare(first, replace(first, xyz=places)).moved
    ('E',)
    """
    if not 0 < level < 1:
        raise ValueError(f'level is {level}, accepted is a number between 0 and 1')
    free = _free_scale(first, second, free_scale)
    names = _common(first, second, stable)
    variances = _compared_variances(first, second, level)
    epochs = _weighted(first.chosen(names), second.chosen(names), variances, free, level)
    candidates = np.array([not stable or name in stable for name in names])
    states = localised(epochs, candidates)
    last = states[-1]
    moved = ~last.still & last.passed  # without a datum, nothing can be named
    warnings = _warnings(variances, states, names, moved)
    return Comparison(
        movements=tuple(
            Movement(
                name,
                epochs.xyz[0][index],
                last.movements[index],
                last.covariances[index],
                float(last.statistics[index]),
                float(last.probabilities[index]),
                bool(last.datum[index]),
                bool(moved[index]),
            )
            for index, name in enumerate(names)
        ),
        variances=variances,
        tests=tuple(state.test for state in states),
        congruent=states[0].test.passed and bool(states[0].still.all()),
        only_first=tuple(name for name in first.names if name not in names),
        only_second=tuple(name for name in second.names if name not in names),
        free_scale=free,
        level=level,
        unit=first.unit,
        warnings=tuple(warnings),
    )


def _free_scale(first: MeasuredPoints, second: MeasuredPoints, wanted: bool | None) -> bool:
    if first.unit and second.unit and first.unit != second.unit:
        raise ValueError(
            f'unit is {first.unit!r} in the first and {second.unit!r} in the second epoch, '
            'accepted is one for both'
        )
    without = not (first.unit and second.unit)
    if wanted is False and without:
        raise ValueError('free_scale is False, accepted is True where an epoch has no scale')
    return without if wanted is None else wanted


def _common(
    first: MeasuredPoints, second: MeasuredPoints, stable: Sequence[str]
) -> tuple[str, ...]:
    """Return the names of the common targets, enough of which may define the datum."""
    there = set(second.names)
    names = tuple(name for name in first.names if name in there)
    if missing := [name for name in stable if name not in names]:
        raise ValueError(f'stable targets {", ".join(missing)} are not in both epochs')
    chosen = stable or names
    if len(chosen) < FEWEST:
        what = 'stable' if stable else 'common'
        raise ValueError(f'{counted(len(chosen), f"{what} target")}, accepted are three or more')
    for epoch in (first, second):
        if on_a_line(epoch.xyz[epoch.indices(chosen)]):
            raise ValueError(
                f'targets {", ".join(chosen)} are on a line, accepted are others, too'
            )
    return names


def _compared_variances(
    first: MeasuredPoints, second: MeasuredPoints, level: float
) -> VarianceTest:
    for which, epoch in (('first', first), ('second', second)):
        if not epoch.redundancy:
            raise ValueError(
                f'redundancy of the {which} epoch is 0, accepted is an adjustment with redundancy'
            )
    larger, smaller = sorted((first, second), key=lambda it: -it.sigma0)
    ratio = (larger.sigma0 / smaller.sigma0) ** 2
    tail = float(f_probability(larger.redundancy, smaller.redundancy, ratio))
    probability = min(2 * tail, 1.0)
    return VarianceTest(ratio, probability, probability >= level)


def _weighted(
    first: MeasuredPoints,
    second: MeasuredPoints,
    variances: VarianceTest,
    free: bool,
    level: float,
) -> Epochs:
    """Return the epochs with covariances of the pooled variance, or each of its own.

    Of two variances, the degrees of freedom of the worse known one are on the safe side.
    """
    f1, f2 = first.redundancy, second.redundancy
    s1, s2, degrees = first.sigma0**2, second.sigma0**2, min(f1, f2)
    if variances.equal:
        s1 = s2 = (f1 * s1 + f2 * s2) / (f1 + f2)
        degrees = f1 + f2
    covariances = s1 * first.cofactors, s2 * second.cofactors
    for which, covariance in zip(('first', 'second'), covariances, strict=True):
        if not np.trace(covariance) > 0:
            raise ValueError(
                f'covariance of the {which} epoch is zero, accepted is that of an adjustment'
            )
    return Epochs((first.xyz, second.xyz), covariances, degrees, free, level)


def _warnings(
    variances: VarianceTest, states: Sequence[State], names: Sequence[str], moved: Mask
) -> list[str]:
    """Return what whoever reads the results must know, as sentences."""
    warnings = []
    last = states[-1]
    if not variances.equal:
        warnings.append(
            f'The variances of unit weight differ by a factor of {variances.ratio:.2f}: one epoch '
            'is better or worse than its covariances say. Each is weighted by its own variance.'
        )
    if not last.passed:
        warnings.append(
            'No datum is left that stood still: more than half of its targets moved, or there are '
            'too few to tell which. No target is named.'
        )
        return warnings
    left = states[0].datum & ~last.datum & ~moved
    if left.any():
        listed = ', '.join(name for name, out in zip(names, left, strict=True) if out)
        warnings.append(f'Targets that left the datum and are not significant alone: {listed}.')
    return warnings
