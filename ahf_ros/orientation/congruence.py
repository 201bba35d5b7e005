"""Whether targets moved between two epochs, and which: the congruence test.

The epochs are brought to one datum, the targets that may have stood still: the second is fitted to
the first, and both covariances go through one S-transformation. With d = x2 - x1, the cofactors
Q = Q1 + Q2 and the pooled variance of unit weight s2 of f = f1 + f2 degrees of freedom,

    T = d' P d / (h s2) ~ F(h, f),    P = Q^+,    h = rank Q,

where nothing moved [1]_. P depends on no datum. With u = P d, a target i that leaves the datum
takes the share r_i = u_i' P_ii^-1 u_i of d' P d with it. Its movement against the others is
P_ii^-1 u_i with the cofactors P_ii^-1, and r_i / (3 s2) ~ F(3, f) tests it alone [2]_. That is
its best estimate if the others stood still, and the same for targets that are out of the datum.

T sees many small movements and loses that of a single target among many: of 40 targets, one that
moves by 5 standard deviations is seen in 4 of 10 cases. The tests of single targets, with
Bonferroni's correction, are the other way round. So both are made, at shares of the level whose
sum is a little above one, since both often fail together.
While either fails, the target with the largest share leaves the datum. One that is not significant
against the datum that remains comes back.

References
----------
.. [1] Pelzer, Zur Analyse geodätischer Deformationsmessungen, DGK C 164, 1971.
.. [2] Niemeier, Ausgleichungsrechnung, 2nd ed., De Gruyter 2008.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ahf_ros.orientation.datum import movements, s_transform
from ahf_ros.orientation.network import FloatArray
from ahf_ros.orientation.points import MeasuredPoints, blocks
from ahf_ros.orientation.similarity import on_a_line, similarity_between
from ahf_ros.text import counted

LEVEL = 0.05
"""Share of pairs of epochs without movement that a test may take for one with."""

_TOGETHER, _ALONE = 0.2, 0.9
"""Of the level, for the test of all targets and those of single ones; measured, together one."""

_MINIMUM = 3  # targets of a datum
_TRIALS = 200  # fits to three targets; all of one half in all but 1 of 10^10 searches
_SINGULAR = 1e-9
"""Of the mean variance: smaller ones are those of coordinates that were not measured."""


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
class GlobalTest:
    """The congruence test T of the targets of a datum."""

    targets: int
    statistic: float
    rank: int
    redundancy: int
    probability: float
    """Of a statistic at least as large if none of these targets moved."""
    level: float
    """What the probability has to reach."""

    @property
    def passed(self) -> bool:
        """Whether the targets may have stood still, as far as this test sees."""
        return self.probability >= self.level


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


@dataclass(frozen=True)
class _Epochs:
    """Common targets: coordinates (n, 3) of both epochs and covariances (3n, 3n), as tested."""

    xyz: tuple[FloatArray, FloatArray]
    covariances: tuple[FloatArray, FloatArray]
    degrees: int
    free_scale: bool
    level: float


@dataclass(frozen=True)
class _State:
    """What the tests say of a datum: movements, covariances and statistics of all targets."""

    datum: NDArray[np.bool_]
    movements: FloatArray
    covariances: FloatArray
    statistics: FloatArray
    probabilities: FloatArray
    test: GlobalTest


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
    states = _localised(epochs, candidates)
    last = states[-1]
    found = _passes(last, last.datum, level)
    moved = (last.probabilities < level) & found  # without a datum, nothing can be named
    warnings = _warnings(variances, states, names, moved, found)
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
        congruent=_passes(states[0], np.full(len(names), True), level),
        only_first=tuple(name for name in first.names if name not in names),
        only_second=tuple(name for name in second.names if name not in names),
        free_scale=free,
        level=level,
        unit=first.unit,
        warnings=tuple(warnings),
    )


def _passes(state: _State, targets: NDArray[np.bool_], level: float) -> bool:
    """Return whether the datum together, and each one of some targets, may have stood still."""
    return state.test.passed and bool((state.probabilities[targets] >= level).all())


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
    if len(chosen) < _MINIMUM:
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
    tail = float(_f_probability(larger.redundancy, smaller.redundancy, ratio))
    probability = min(2 * tail, 1.0)
    return VarianceTest(ratio, probability, probability >= level)


def _weighted(
    first: MeasuredPoints,
    second: MeasuredPoints,
    variances: VarianceTest,
    free: bool,
    level: float,
) -> _Epochs:
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
    return _Epochs((first.xyz, second.xyz), covariances, degrees, free, level)


def _localised(epochs: _Epochs, candidates: NDArray[np.bool_]) -> list[_State]:
    """Return what the tests say of the first datum, and of each that a target left or entered.

    Where many targets moved together, their movement smears over the others, and targets leave
    until too few are left. Then the datum starts from the half that fits best.
    """
    half = max(int(candidates.sum()) // 2 + 1, _MINIMUM)
    states = _reduced(epochs, candidates, half)
    if candidates.sum() == half or _passes(states[-1], states[-1].datum, epochs.level):
        return states
    others = _reduced(epochs, _best_half(epochs, candidates, half), _MINIMUM)
    enlarged = others[-1].datum | (candidates & (others[-1].probabilities >= epochs.level))
    others += _reduced(epochs, enlarged, half)
    last = others[-1]
    found = last.datum.sum() >= half and _passes(last, last.datum, epochs.level)
    return [states[0], *others] if found else states


def _reduced(epochs: _Epochs, datum: NDArray[np.bool_], least: int) -> list[_State]:
    """Return what the tests say while targets leave a datum until it passes or `least` are left.

    One that left and is not significant against the others comes back, once.
    """
    states, returned = [_tested(epochs, datum)], np.zeros_like(datum)
    while not _passes(states[-1], states[-1].datum, epochs.level):
        state = states[-1]
        leaving = _leaving(epochs, state)
        if leaving is None or state.datum.sum() <= least:
            break
        datum = state.datum.copy()
        datum[leaving] = False
        states.append(_tested(epochs, datum))
        back = states[0].datum & ~datum & ~returned & (states[-1].probabilities >= epochs.level)
        back[leaving] = False
        if back.any():
            index = np.flatnonzero(back)[np.argmin(states[-1].statistics[back])]
            datum = datum.copy()
            datum[index] = returned[index] = True
            states.append(_tested(epochs, datum))
    return states


def _best_half(epochs: _Epochs, candidates: NDArray[np.bool_], half: int) -> NDArray[np.bool_]:
    """Return the half of the candidates whose largest movement is least, by fits to three.

    Rousseeuw, Least median of squares regression, J. Am. Stat. Assoc. 1984, 79, 871.
    """
    first, second = epochs.xyz
    places, rng = np.flatnonzero(candidates), np.random.default_rng(0)
    best, chosen = np.inf, candidates
    for _ in range(_TRIALS):
        three = rng.choice(places, _MINIMUM, replace=False)
        if on_a_line(first[three]) or on_a_line(second[three]):
            continue
        fit = similarity_between(second[three], first[three], epochs.free_scale)
        distances = np.linalg.norm(fit.moved(second) - first, axis=1)
        nearest = places[np.argsort(distances[places])[:half]]
        if distances[nearest[-1]] < best:
            best, chosen = distances[nearest[-1]], np.zeros_like(candidates)
            chosen[nearest] = True
    return chosen


def _leaving(epochs: _Epochs, state: _State) -> int | None:
    """Return the target of the datum with the largest share; None where the others hold none."""
    shares = np.where(state.datum, state.statistics, -np.inf)
    index = int(np.argmax(shares))
    others = state.datum.copy()
    others[index] = False
    enough = others.sum() >= _MINIMUM and not on_a_line(epochs.xyz[0][others])
    return index if enough else None


def _tested(epochs: _Epochs, datum: NDArray[np.bool_]) -> _State:
    """Return what the tests say of the movements in the datum of some targets."""
    first, second = epochs.xyz
    fit = similarity_between(second[datum], first[datum], epochs.free_scale)
    covariance = epochs.covariances[0] + fit.turned(epochs.covariances[1])
    moved, covariance = s_transform(
        fit.moved(second),
        covariance,
        datum.astype(float),
        reference=first,
        scale=epochs.free_scale,
    )
    difference, rows = moved - first, np.repeat(datum, 3)
    weights = _pseudoinverse(
        covariance[np.ix_(rows, rows)], movements(first[datum], epochs.free_scale)
    )
    pulls = (weights @ difference[datum].ravel()).reshape(-1, 3)
    inverse = np.empty((len(first), 3, 3))
    inverse[datum] = blocks(weights)
    # What the movements of the datum, which are errors, say of those of the other targets.
    gain = covariance[np.ix_(~rows, rows)] @ weights
    difference[~datum] -= (gain @ difference[datum].ravel()).reshape(-1, 3)
    covariances = np.empty_like(inverse)
    covariances[~datum] = blocks(
        covariance[np.ix_(~rows, ~rows)] - gain @ covariance[np.ix_(rows, ~rows)]
    )
    covariances[datum] = np.linalg.pinv(inverse[datum], _SINGULAR, hermitian=True)
    inverse[~datum] = np.linalg.pinv(covariances[~datum], _SINGULAR, hermitian=True)
    difference[datum] = np.einsum('nij,nj->ni', covariances[datum], pulls)
    eigenvalues = np.linalg.eigvalsh(inverse)
    ranks = (eigenvalues > _SINGULAR * eigenvalues[:, -1:]).sum(axis=1)
    statistics = np.einsum('ni,nij,nj->n', difference, inverse, difference) / ranks
    single = _f_probability(ranks, epochs.degrees, statistics)
    rank = 3 * int(datum.sum()) - (7 if epochs.free_scale else 6)
    statistic = float((pulls * (moved - first)[datum]).sum()) / rank
    return _State(
        datum,
        difference,
        covariances,
        statistics,
        np.minimum(single * len(first) / _ALONE, 1.0),
        GlobalTest(
            int(datum.sum()),
            statistic,
            rank,
            epochs.degrees,
            float(_f_probability(rank, epochs.degrees, statistic)),
            _TOGETHER * epochs.level,
        ),
    )


def _pseudoinverse(covariance: FloatArray, free: FloatArray) -> FloatArray:
    """Return the pseudoinverse of a covariance whose null space is that of its datum, G.

    (Q + G G')^-1 - G G' for orthonormal columns of G, scaled to the size of Q.
    """
    columns = np.linalg.qr(free)[0]
    size = np.trace(covariance) / len(covariance)
    added = columns @ columns.T
    values, vectors = np.linalg.eigh(covariance / size + added)
    if not values[0] > _SINGULAR:
        raise ValueError(
            'covariance of the common targets is singular beyond the datum, accepted is one of '
            'coordinates that were all measured'
        )
    inverse: FloatArray = ((vectors / values) @ vectors.T - added) / size
    return inverse


def _f_probability(above: ArrayLike, below: ArrayLike, statistic: ArrayLike) -> FloatArray:
    """Return the probability of a value of F at least as large, by its degrees of freedom."""
    try:
        from scipy.special import fdtrc
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError("scipy: pip install 'ahf_ros[orient]'") from error
    return np.asarray(fdtrc(above, below, np.maximum(statistic, 0.0)))


def _warnings(
    variances: VarianceTest,
    states: Sequence[_State],
    names: Sequence[str],
    moved: NDArray[np.bool_],
    found: bool,
) -> list[str]:
    """Return what whoever reads the results must know, as sentences."""
    warnings = []
    last = states[-1]
    if not variances.equal:
        warnings.append(
            f'The variances of unit weight differ by a factor of {variances.ratio:.2f}: one epoch '
            'is better or worse than its covariances say. Each is weighted by its own variance.'
        )
    if not found:
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
