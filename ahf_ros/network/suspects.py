"""Scale bars and control points are tested against the photographs before these believe them.

The photographs alone give points up to a similarity, with their covariance. With misclosures l of
what is known, their covariance C from both, and A as their change under a similarity,

    P = C^-1 - C^-1 A (A' C^-1 A)^- A' C^-1,    v = P l,    T_i = v_i' P_ii^+ v_i

tests the rows i of one bar or point against all others, and P_ii^+ v_i is what it differs from
them [1]_. The worst goes first. Where leaving out another one explains nearly as much, as always
of two, nobody can tell which is wrong: then both get the variance at which they agree, as do all
where no few are to blame [2]_. Of so few that leaving out any leaves no redundancy to test
another, that is said beforehand: an error e of one looks like one of j where e' P e is small
without j, as may be of four control points.

Control points whose precision nobody gave may be exact or not. So each is tested for any standard
deviation that they may have, and the chance is the mean over these, weighed by the likelihood that
the others give each [3]_, of what similarities do not change [4]_. With many others, or where
these agree as well as photographs measure, that is the test of a known variance; where they do
not, it is Student's, of few degrees of freedom.

References
----------
.. [1] Baarda, A testing procedure for use in geodetic networks, 1968; Förstner & Wrobel,
   Photogrammetric Computer Vision, Springer 2016, 4.6.4.
.. [2] Paule & Mandel, Consensus values and weighting factors, J. Res. NBS 87 (1982), 377-385.
.. [3] Gelfand, Dey & Chang, Model determination using predictive distributions, Bayesian
   Statistics 4 (1992), 147-167: cross-validation.
.. [4] Patterson & Thompson, Recovery of inter-block information when block sizes are unequal,
   Biometrika 58 (1971), 545-554.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ahf_ros.network.datum import movements
from ahf_ros.network.deviations import with_unit
from ahf_ros.network.knowledge import Known, of_bars, of_control
from ahf_ros.network.network import FloatArray, IntArray, Network
from ahf_ros.network.solution import Suspect
from ahf_ros.network.testing import BY_CHANCE, special

_DECISIVE = 2 * np.log(20)  # chi-square by which one is to blame rather than another: odds of 20
_UNLIKELY = 1 / 21  # probability of what is given where it is not believed: odds of 20
_GIVEN = 30  # times as likely, before tests, as any other standard deviation but for a factor of 2
_CHECKED = 1e-6  # share of a variance that others must leave for something to be tested
_RANK = 3e-5  # of singular values, relative to the largest
_HALVINGS = 40
_TINY = float(np.finfo(float).tiny)
_LEAST = 1e-12  # probability that is said
_NONE = np.array([], int)


class Examined(NamedTuple):
    """The network as far as it is believed, suspects, and warnings."""

    network: Network
    suspects: tuple[Suspect, ...]
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class _Tested:
    """Tests of groups (g,), for each standard deviation (s,) that may be there beside the given.

    Statistics, degrees of freedom, gaps and log determinants of P_ii are (s, g). `misfits` (s,)
    are minus twice the log likelihood of all groups and of what was thought of it before.
    """

    statistics: FloatArray
    freedom: IntArray
    gaps: FloatArray
    determinants: FloatArray
    misfits: FloatArray

    @property
    def shares(self) -> FloatArray:
        """How likely all groups make each standard deviation, (s,)."""
        return _shares(self.misfits)

    @property
    def by_others(self) -> FloatArray:
        """How likely all groups but the tested one make each standard deviation, (s, g)."""
        return _shares(self.misfits[:, None] - self.statistics + self.determinants)

    def expected(self, values: FloatArray) -> FloatArray:
        """Return the mean (g,) of values (s, g), as the groups but the tested one expect it."""
        return (self.by_others * values).sum(axis=0)

    @property
    def chances(self) -> FloatArray:
        """How often chance makes one of all statistics so large (Bonferroni), (g,)."""
        able = self.freedom.min(axis=0) > 0
        chances = self.expected(special().chdtrc(np.maximum(self.freedom, 1), self.statistics))
        return np.where(able, np.minimum(able.sum() * chances, 1.0), 1.0)

    @property
    def gains(self) -> FloatArray:
        """Twice the log likelihood that leaving out each gains, less its degrees of freedom."""
        without = _likelihood(self.misfits[:, None] - self.statistics)
        freedom = self.freedom.min(axis=0)
        gains = without - _likelihood(self.misfits[:, None]) - freedom
        return np.where(freedom > 0, gains, -np.inf)

    def suspect(self, names: Sequence[str], worst: int, rivals: Iterable[int]) -> Suspect:
        """Return the suspect that one of the groups is, or one of its rivals instead."""
        gap = float(self.expected(self.gaps)[worst])
        others = tuple(names[it] for it in rivals)
        return Suspect(
            names[worst],
            gap,
            gap / float(np.sqrt(self.expected(self.statistics)[worst])),
            float(self.chances[worst]),
            'unclear' if others else 'left out',
            others,
        )


def _likelihood(misfits: FloatArray) -> FloatArray:
    """Return twice the log of the mean likelihood over the rows of misfits (s, g)."""
    best = misfits.min(axis=0)
    return 2 * np.log(np.exp((best - misfits) / 2).sum(axis=0)) - best


def _shares(misfits: FloatArray) -> FloatArray:
    """Return the share of each row of misfits (s, ...) in the likelihood of all."""
    likelihood = np.exp((misfits.min(axis=0) - misfits) / 2)
    return likelihood / likelihood.sum(axis=0)


@dataclass(frozen=True)
class Weights:
    """P of rows, for any standard deviation that some of them have beside the given.

    With its square s, P is W diag(1 / (1 + s d)) W', of `factors` W (r, m) and `sizes` d (m,).
    `group` (r,) has the groups of rows, `determinant` minus the log of P's pseudo-determinant for
    s = 0, but for a constant.
    """

    group: IntArray
    factors: FloatArray
    sizes: FloatArray
    determinant: float

    @property
    def redundancy(self) -> int:
        """Rank of P."""
        return len(self.sizes)

    def whole(self, gaps: FloatArray, variance: float) -> float:
        """Return the statistic l' P l of gaps l (r,)."""
        return float(((gaps @ self.factors) ** 2 / (1 + variance * self.sizes)).sum())


@dataclass(frozen=True)
class Misclosures:
    """Known minus measured: `gaps` (r,), their change under similarities, and both covariances."""

    names: tuple[str, ...]
    group: IntArray
    gaps: FloatArray
    free: FloatArray
    given: FloatArray
    measured: FloatArray

    @classmethod
    def of(cls, known: Known, points: FloatArray, covariance: FloatArray) -> Misclosures:
        """Return what bars and control points have over measured points."""
        parts = of_bars(known, points), of_control(known, points)
        rows, gaps, given = (np.concatenate(column) for column in zip(*parts, strict=True))
        names = [it.title for it in known.bars] + [it.title for it in known.control]
        group = np.r_[np.arange(len(known.bars)), np.repeat(np.arange(len(known.control)), 3)]
        group[len(known.bars) :] += len(known.bars)
        free = rows @ movements(points)
        return cls(tuple(names), group, gaps, free, given, rows @ covariance @ rows.T)

    def weights(self, kept: IntArray, common: IntArray = _NONE) -> Weights:
        """Return P of kept groups, of which those in `common` may be less precise than given."""
        rows = np.isin(self.group, kept)
        free, group = self.free[rows], self.group[rows]
        basis, sizes, _ = np.linalg.svd(free)
        contrasts = basis[:, int((sizes > _RANK * sizes[0]).sum()) :]  # no similarity changes them
        covariance = self.measured[np.ix_(rows, rows)] + np.diag(self.given[rows])
        factor = np.linalg.cholesky(contrasts.T @ covariance @ contrasts)
        factors = np.linalg.solve(factor, contrasts.T).T
        inside = factors[np.isin(group, common)]
        added, axes = np.linalg.eigh(inside.T @ inside)
        determinant = 2 * float(np.log(np.diag(factor)).sum())
        return Weights(group, factors @ axes, np.maximum(added, 0), determinant)

    def tested(self, kept: IntArray, common: IntArray = _NONE) -> _Tested:
        """Return the tests of kept groups, where those in `common` may be less precise than given.

        Standard deviations are tried by factors of two, from a quarter of what photographs have
        to the largest gap.
        """
        sigmas = np.zeros(1)
        if len(common):
            smallest = np.sqrt(np.diag(self.measured).mean()) / 4
            most = max(float(np.abs(self.gaps).max()) / smallest, 2.0)
            sigmas = np.r_[0, smallest * 2 ** np.arange(np.ceil(np.log2(most)) + 1)]
        weights, gaps = self.weights(kept, common), self.gaps[np.isin(self.group, kept)]
        columns = [_tested(weights, gaps, kept, sigma**2) for sigma in sigmas]
        statistics, freedom, differences, determinants, misfits = map(
            np.array, zip(*columns, strict=True)
        )
        misfits[1:] += 2 * np.log(_GIVEN)
        return _Tested(statistics, freedom, differences, determinants, misfits)

    def agreeing(self, kept: IntArray, blamed: IntArray) -> float:
        """Return the standard deviation, beside the given one, at which kept groups agree.

        That of blamed groups grows until the statistic of all is their redundancy.
        """
        weights, gaps = self.weights(kept, blamed), self.gaps[np.isin(self.group, kept)]
        low, high = 0.0, 2 * float(np.abs(self.gaps).max())
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            agree = weights.whole(gaps, middle**2) <= weights.redundancy
            low, high = (low, middle) if agree else (middle, high)
        return high


def _tested(
    weights: Weights, gaps: FloatArray, groups: IntArray, variance: float
) -> tuple[FloatArray, IntArray, FloatArray, FloatArray, float]:
    """Return a row of all that tests know, for one variance beside the given."""
    scaled = weights.factors / (1 + variance * weights.sizes)
    pulls = scaled @ (weights.factors.T @ gaps)
    largest = (scaled * weights.factors).sum(axis=1).max()
    statistics, freedom = np.zeros(len(groups)), np.zeros(len(groups), int)
    differences, determinants = np.zeros(len(groups)), np.zeros(len(groups))
    for place, number in enumerate(groups):
        own = weights.group == number
        sizes, axes = np.linalg.eigh(scaled[own] @ weights.factors[own].T)
        checked = sizes > _CHECKED * largest
        along = (axes.T @ pulls[own])[checked]
        statistics[place] = float((along**2 / sizes[checked]).sum())
        differences[place] = float(np.linalg.norm(along / sizes[checked]))
        freedom[place] = int(checked.sum())
        determinants[place] = np.log(sizes[checked]).sum()
    determinant = weights.determinant + float(np.log1p(variance * weights.sizes).sum())
    return statistics, freedom, differences, determinants, float(gaps @ pulls) + determinant


@dataclass
class _Findings:
    """What is left out, what cannot be told apart, and the standard deviation that is added."""

    kept: IntArray
    suspects: list[Suspect]
    blamed: IntArray
    added: float


def examined(
    network: Network, known: Known, points: FloatArray, covariance: FloatArray, keep: bool
) -> Examined:
    """Return the network without bars and control points that contradict the photographs.

    `known` has those that are used and checks; points (n, 3) of the layout and their covariance
    are of the photographs alone, in about the frame and scale of what is known. Checks are
    witnesses where those that are used contradict each other. Suspects are kept where `keep` says
    so.
    """
    closures = Misclosures.of(known, points, covariance)
    told = np.array([it.check for it in known.bars] + [it.check for it in known.control], bool)
    used = np.flatnonzero(~told)
    if not len(used):
        return Examined(network, (), ())
    redundancy = closures.weights(used).redundancy
    if not redundancy:
        return Examined(network, (), () if told.any() else (_unchecked(closures, used),))
    found = _found(closures, used)
    if any(it.rivals for it in found.suspects) and told.any():
        heard = _found(closures, np.arange(len(told)))
        ours = {closures.names[it] for it in used}
        if all(it.name in ours and not it.rivals for it in heard.suspects):
            found = heard
    warnings = _words(network, closures, found, keep)
    if not (found.suspects or len(found.blamed) or told.any()):
        warnings += _inseparable(closures, used, redundancy)
    if keep:
        kept = tuple(
            replace(it, verdict='kept') if it.verdict == 'left out' else it
            for it in found.suspects
        )
        return Examined(network, kept, warnings)
    return Examined(_believed(network, closures, found), tuple(found.suspects), warnings)


def _found(closures: Misclosures, among: IntArray) -> _Findings:
    """Return who is to blame among groups: few, those whose precision nobody gave, or all.

    All are where even a larger variance makes too many of them suspects, or none.
    """
    given = np.bincount(closures.group, closures.given)
    if found := _search(closures, among, among[given[among] == 0]):
        return found
    found = _search(closures, among, among)
    return found if found and found.suspects else _all_to_blame(closures, among)


def _all_to_blame(closures: Misclosures, among: IntArray) -> _Findings:
    """Return that groups contradict each other, and none more than others."""
    test = closures.tested(among)
    worst = int(np.argmax(test.gains))
    names = [closures.names[it] for it in among]
    suspect = test.suspect(names, worst, np.delete(np.arange(len(among)), worst))
    return _Findings(among, [suspect], among, closures.agreeing(among, among))


def _search(closures: Misclosures, among: IntArray, common: IntArray) -> _Findings | None:
    """Return the suspects, the worst first, None where half of what is known would be.

    Groups in `common` have a variance beside the given one, at which all agree.
    """
    kept, suspects = among, list[Suspect]()
    while 2 * len(suspects) < len(among):
        test = closures.tested(kept, common)
        gains = test.gains
        worst = int(np.argmax(gains))
        blamed = np.intersect1d(common, kept) if test.shares[0] < _UNLIKELY else _NONE
        if test.chances[worst] >= BY_CHANCE:
            added = closures.agreeing(kept, blamed) if len(blamed) else 0.0
            return _Findings(kept, suspects, blamed, added)
        near = np.flatnonzero(gains > gains[worst] - _DECISIVE)
        rivals = near[near != worst]
        suspects.append(test.suspect([closures.names[it] for it in kept], worst, rivals))
        if len(rivals):
            blamed = np.union1d(blamed, kept[[worst, *rivals]])
            return _Findings(kept, suspects, blamed, closures.agreeing(kept, blamed))
        kept = np.delete(kept, worst)
    return None


def _believed(network: Network, closures: Misclosures, found: _Findings) -> Network:
    """Return the network whose suspects are checks, and whose blamed ones have their variance."""
    left_out = {it.name for it in found.suspects if it.verdict == 'left out'}
    blamed = {closures.names[it] for it in found.blamed}
    bars, control = list(network.bars), list(network.control)
    for place, bar in enumerate(bars):
        if bar.title in left_out:
            bars[place] = replace(bar, check=True)
        elif bar.title in blamed and not bar.check:
            bars[place] = replace(bar, sigma=float(np.hypot(bar.sigma, found.added)))
    for place, point in enumerate(control):
        if point.title in left_out:
            control[place] = replace(point, check=True)
        elif point.title in blamed and not point.check:
            covariance = point.covariance + found.added**2 * np.eye(3)
            control[place] = replace(point, covariance=covariance)
    return replace(network, bars=tuple(bars), control=tuple(control))


def _words(
    network: Network, closures: Misclosures, found: _Findings, keep: bool
) -> tuple[str, ...]:
    """Return what was found in words."""
    unit = network.unit
    warnings = [
        f'{" or ".join((it.name, *it.rivals))} is wrong: they contradict each other by '
        f'{with_unit(it.gap, unit)}, {it.gap / it.sigma:.1f} standard deviations, and nothing '
        'says which. Measure them again'
        if it.rivals
        else f'{it.name} contradicts the rest by {with_unit(it.gap, unit)}, '
        f'{it.gap / it.sigma:.1f} standard deviations (probability '
        f'{max(it.probability, _LEAST):.1g}): '
        + ('it is used all the same' if keep else 'it is left out')
        for it in found.suspects
    ]
    if len(found.blamed):
        names = [closures.names[it] for it in found.blamed]
        given = closures.given[np.isin(closures.group, found.blamed)]
        told = float(np.sqrt(given.mean()))
        fits = with_unit(float(np.hypot(told, found.added)), unit)
        used = 'is used instead' if not keep else 'would fit'
        what = ', '.join(names) if len(names) < 4 else f'{names[0]} and {len(names) - 1} others'
        warnings.append(
            f'{what}: a standard deviation of {with_unit(told, unit)} contradicts the '
            f'photographs; one of {fits} {used}'
        )
    return tuple(warnings)


def _unchecked(closures: Misclosures, used: IntArray) -> str:
    """Return that nothing checks what is known."""
    names = [closures.names[it] for it in used]
    them, are = ('it', 'is') if len(names) == 1 else ('them', 'are')
    return (
        f'{", ".join(names)} {are} believed: nothing checks {them}. Give another one, or a check'
    )


def _inseparable(closures: Misclosures, used: IntArray, redundancy: int) -> tuple[str, ...]:
    """Return that an error of one may look like one of another, if so few are known."""
    if redundancy >= 2 * closures.tested(used).freedom.max():
        return ()
    return (
        f'{", ".join(closures.names[it] for it in used)} agree, but are too few to tell which one '
        'is wrong if one is. Three scale bars or five control points do, or a check',
    )
