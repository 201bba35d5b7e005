"""The targets that stood still between two epochs: tests of a datum, and the search for it.

The target with the largest share r_i of T (see `congruence`) leaves the datum until they pass.

T sees many small movements and loses that of a single target among many: of 40 targets, one that
moves by 5 standard deviations is seen in 4 of 10 cases. The tests of single targets, with
Bonferroni's correction, are the other way round. So both are made, at shares of the level whose
sum is a little above one, since both often fail together.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ahf_ros.network.datum import movements, s_transform
from ahf_ros.network.network import FloatArray
from ahf_ros.network.points import blocks
from ahf_ros.network.similarity import on_a_line, similarity_between
from ahf_ros.network.testing import special

FEWEST = 3
"""Targets of a datum."""

_TOGETHER, _ALONE = 0.2, 0.9
"""Of the level, for the test of all targets and those of single ones; measured, together one."""

_TRIALS = 200  # fits to three targets; all of one half in all but 1 of 10^10 searches
_SINGULAR = 1e-9
"""Of the mean variance: smaller ones are those of coordinates that were not measured."""

Mask = NDArray[np.bool_]


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
class Epochs:
    """Common targets: coordinates (n, 3) of both epochs and covariances (3n, 3n), as tested."""

    xyz: tuple[FloatArray, FloatArray]
    covariances: tuple[FloatArray, FloatArray]
    redundancy: int
    free_scale: bool
    level: float


@dataclass(frozen=True)
class State:
    """What the tests say of a datum: movements, covariances and statistics of all targets.

    `still` are the targets that may have stood still against the datum.
    """

    datum: Mask
    movements: FloatArray
    covariances: FloatArray
    statistics: FloatArray
    probabilities: FloatArray
    still: Mask
    test: GlobalTest

    @property
    def passed(self) -> bool:
        """Whether the datum together, and each one of its targets, may have stood still."""
        return self.test.passed and bool(self.still[self.datum].all())


def localised(epochs: Epochs, candidates: Mask) -> list[State]:
    """Return what the tests say of the first datum, and of each that a target left or entered.

    Where many targets moved together, their movement smears over the others, and targets leave
    until too few are left. Then the datum starts from the half that fits best.
    """
    half = max(int(candidates.sum()) // 2 + 1, FEWEST)
    states = _reduced(epochs, candidates, half)
    if candidates.sum() == half or states[-1].passed:
        return states
    others = _reduced(epochs, _best_half(epochs, candidates, half), FEWEST)
    enlarged = others[-1].datum | (candidates & others[-1].still)
    others += _reduced(epochs, enlarged, half)
    found = others[-1].datum.sum() >= half and others[-1].passed
    return [states[0], *others] if found else states


def _reduced(epochs: Epochs, datum: Mask, least: int) -> list[State]:
    """Return what the tests say while targets leave a datum until it passes or `least` are left.

    One that left and is not significant against the others comes back, once.
    """
    states, returned = [tested(epochs, datum)], np.zeros_like(datum)
    while not states[-1].passed and states[-1].datum.sum() > least:
        datum = states[-1].datum.copy()
        leaving = np.argmax(np.where(datum, states[-1].statistics, -np.inf))
        datum[leaving] = False
        if on_a_line(epochs.xyz[0][datum]):
            break
        states.append(tested(epochs, datum))
        back = states[0].datum & ~datum & ~returned & states[-1].still
        back[leaving] = False
        if back.any():
            datum = datum.copy()
            index = np.argmin(np.where(back, states[-1].statistics, np.inf))
            datum[index] = returned[index] = True
            states.append(tested(epochs, datum))
    return states


def _best_half(epochs: Epochs, candidates: NDArray[np.bool_], half: int) -> NDArray[np.bool_]:
    """Return the half of the candidates whose largest movement is least, by fits to three.

    Rousseeuw, Least median of squares regression, J. Am. Stat. Assoc. 1984, 79, 871.
    """
    first, second = epochs.xyz
    places, rng = np.flatnonzero(candidates), np.random.default_rng(0)
    best, chosen = np.inf, candidates
    for _ in range(_TRIALS):
        three = rng.choice(places, FEWEST, replace=False)
        if on_a_line(first[three]) or on_a_line(second[three]):
            continue
        fit = similarity_between(second[three], first[three], epochs.free_scale)
        distances = np.linalg.norm(fit.moved(second) - first, axis=1)
        nearest = places[np.argsort(distances[places])[:half]]
        if distances[nearest[-1]] < best:
            best, chosen = distances[nearest[-1]], np.zeros_like(candidates)
            chosen[nearest] = True
    return chosen


def tested(epochs: Epochs, datum: NDArray[np.bool_]) -> State:
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
    single = f_probability(ranks, epochs.redundancy, statistics)
    probabilities = np.minimum(single * len(first) / _ALONE, 1.0)
    rank = 3 * int(datum.sum()) - (7 if epochs.free_scale else 6)
    statistic = float((pulls * (moved - first)[datum]).sum()) / rank
    return State(
        datum,
        difference,
        covariances,
        statistics,
        probabilities,
        probabilities >= epochs.level,
        GlobalTest(
            int(datum.sum()),
            statistic,
            rank,
            epochs.redundancy,
            float(f_probability(rank, epochs.redundancy, statistic)),
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
    return ((vectors / values) @ vectors.T - added) / size


def f_probability(above: ArrayLike, below: ArrayLike, statistic: ArrayLike) -> FloatArray:
    """Return the probability of a value of F at least as large, by its degrees of freedom."""
    return np.asarray(special().fdtrc(above, below, np.maximum(statistic, 0.0)))
