"""Approximate values are brought into the frame of control points and the scale of bars.

Here gross contradictions are found, before an adjustment would spread them over all coordinates:
other units, mirrored axes, exchanged names. Small ones are left to the tests of the adjustment.
"""

from collections.abc import Iterator
from itertools import combinations, islice

import numpy as np

from ahf_ros.base.text import listed
from ahf_ros.network.datum import Datum
from ahf_ros.network.knowledge import kind
from ahf_ros.network.network import FloatArray, IntArray, Network
from ahf_ros.network.similarity import Similarity, on_a_line, similarity_between
from ahf_ros.network.solution import NetworkState

_MISFIT = 0.15  # of control points, relative to their extent, that no approximate value explains
_STRETCH = 1.2  # ratio of lengths that none explains
_MOST_TRIPLES = 300
_NARROW = 1e-3  # extent across a line of targets that hold no frame, relative to that along it
_UNITS = (10, 100, 1000, 25.4, 304.8)


def placed(
    network: Network, start: NetworkState, datum: Datum
) -> tuple[NetworkState, Datum, tuple[str, ...]]:
    """Return approximate values in the frame and scale of what is known, the datum, and warnings.

    The datum has names of three targets where it is `fixed`. Raises `ValueError` for bars or
    control points that contradict each other, with the ones that do so.
    """
    index = {name: place for place, name in enumerate(network.targets)}
    warnings = []
    control = [point for point in network.control if not point.check]
    seen = [point for point in control if np.isfinite(_at(start, index, point.name)).all()]
    unseen = sorted({point.name for point in control} - {point.name for point in seen})
    if unseen:
        warnings.append(f'control: {listed(unseen)} is in no two photographs and not used')
    if datum.kind == 'control' and not seen:
        raise ValueError('datum: control without a control point that is seen, expected some')
    known = np.array([point.xyz for point in seen]).reshape(-1, 3)
    here = np.array([_at(start, index, point.name) for point in seen]).reshape(-1, 3)
    if len(seen) >= 3:
        _check_control(tuple(point.name for point in seen), here, known)
        start = _similarity_of_most(here, known).in_frame(start)
    elif seen and datum.kind == 'control':
        warnings.append(
            f'control: {len(seen)} points hold no frame, inner constraints hold the rest of it'
        )
    start, of_bars = _scaled(network, start, index, len(seen) >= 2)
    if len(seen) in (1, 2):
        here = np.array([_at(start, index, point.name) for point in seen])
        start = Similarity(translation=known[0] - here[0]).in_frame(start)
        start = _turned(start, known, here) if len(seen) == 2 else start
    if kind(network, datum) == 'fixed':
        datum = Datum('fixed', datum.targets or _large_triangle(network, start))
    _check_datum(start, index, datum)
    if datum.kind == 'fixed':
        start = _axes(start, np.array([_at(start, index, name) for name in datum.targets]))
    return start, datum, (*warnings, *of_bars)


def _at(start: NetworkState, index: dict[str, int], name: str) -> FloatArray:
    """Return the coordinates (3,) of a target, NaN where it has none."""
    return start.points[index[name]] if name in index else np.full(3, np.nan)


def _scaled(
    network: Network, start: NetworkState, index: dict[str, int], scaled: bool
) -> tuple[NetworkState, tuple[str, ...]]:
    """Return values in the scale of bars, unless control gives it, and warnings of unseen bars.

    Bars that contradict each other, or the control points, raise `ValueError`.
    """
    warnings, ratios, names = [], [], []
    for bar in network.bars:
        distance = np.linalg.norm(_at(start, index, bar.ends[1]) - _at(start, index, bar.ends[0]))
        name = '-'.join(bar.ends)
        if not np.isfinite(distance):
            ends = [end for end in bar.ends if not np.isfinite(_at(start, index, end)).all()]
            warnings.append(
                f'scale bar {name}: {listed(ends)} is in no two photographs, the bar is not used'
            )
        elif distance == 0:
            raise ValueError(f'scale bar {name}: both ends have the same place')
        elif not bar.check:
            ratios.append(float(bar.length / distance))
            names.append(name)
    if not ratios:
        return start, tuple(warnings)
    usual = 1.0 if scaled else float(np.median(ratios))
    wrong = [place for place, ratio in enumerate(ratios) if _stretch(ratio / usual) > _STRETCH]
    if unit := _unit([ratios[place] / usual for place in wrong]):
        others = 'control points' if scaled else 'other scale bars'
        each = ', '.join(
            f'{names[place]} is {ratios[place] / usual:.4g} times as long as the {others} say'
            for place in wrong
        )
        raise ValueError(f'scale bars contradict: {each}{unit}')
    if not scaled:
        start = Similarity(scale=usual).in_frame(start)
    return start, tuple(warnings)


def _stretch(ratio: float) -> float:
    """Return the ratio or its inverse, whichever is larger."""
    return max(ratio, 1 / ratio)


def _unit(ratios: list[float]) -> str:
    """Return a hint where all ratios, if there are any, are that of two units of length."""
    for unit in _UNITS:
        if ratios and all(_stretch(_stretch(ratio) / unit) < _STRETCH for ratio in ratios):
            return f'; a factor of {unit:g}: expected all lengths in one unit'
    return ''


def _similarity_of_most(here: FloatArray, known: FloatArray) -> Similarity:
    """Return the movement of points here (n, 3) to known ones that fits more than half of them.

    Of triples, the one is taken whose median distance is least (Rousseeuw and Leroy 1987, p. 197).
    """
    triples = np.array(list(islice(combinations(range(len(here)), 3), _MOST_TRIPLES)))
    most = min(len(here), len(here) // 2 + 2)

    def nearest(chosen: IntArray) -> tuple[float, IntArray]:
        moved = similarity_between(here[chosen], known[chosen]).moved(here)
        distances = np.linalg.norm(moved - known, axis=1)
        order = np.argsort(distances, kind='stable')[:most]
        return float(distances[order[-1]]), order

    able = [it for it in triples if not on_a_line(here[it], _NARROW)] or [np.arange(len(here))]
    best = min((nearest(it) for it in able), key=lambda pair: pair[0])[1]
    return similarity_between(here[best], known[best])


def _check_control(names: tuple[str, ...], here: FloatArray, known: FloatArray) -> None:
    """Raise `ValueError` if no similarity brings most points here (n, 3) near the known ones.

    It does so, too, where an exchange or another unit explains those that are far.
    """
    far = _deviations(_similarity_of_most(here, known), here, known) >= _MISFIT
    if not far.any():
        return
    if len(names) > 3 and _misfit(here * [1, 1, -1], known) < _MISFIT:
        raise ValueError(
            'control points are mirrored, expected right-handed axes: change the sign of one axis '
            'or exchange two'
        )
    for explanation, changed in _explanations(names, known):
        if _misfit(here, changed) < _MISFIT:
            raise ValueError(f'control points contradict the photographs: {explanation}')
    if len(names) < 4 or far.sum() > (len(names) - 1) // 2:
        raise ValueError(
            f'control points contradict the photographs: {listed(names)} do not have the shape '
            'of the network, whatever pair is exchanged; expected the coordinates of these IDs'
        )


def _explanations(names: tuple[str, ...], known: FloatArray) -> Iterator[tuple[str, FloatArray]]:
    """Yield what may be wrong, with known points as they then are.

    Three points in any order have a similar triangle only by chance.
    """
    for unit in _UNITS:
        for place in range(len(names)):
            for factor in (unit, 1 / unit):
                changed = known.copy()
                changed[place] *= factor
                yield f'{names[place]} is in another unit (factor {unit:g})', changed
    for first, second in combinations(range(len(names)), 2):
        changed = known.copy()
        changed[[first, second]] = known[[second, first]]
        yield f'{names[first]} and {names[second]} are exchanged', changed


def _misfit(here: FloatArray, known: FloatArray) -> float:
    """Return the largest deviation after a similarity, relative to the known points' extent."""
    return float(_deviations(similarity_between(here, known), here, known).max())


def _deviations(movement: Similarity, here: FloatArray, known: FloatArray) -> FloatArray:
    """Return the deviations (n,) after a movement, relative to the known points' extent."""
    extent = np.sqrt(((known - known.mean(axis=0)) ** 2).sum(axis=1).mean())
    deviations = np.linalg.norm(movement.moved(here) - known, axis=1)
    return deviations / extent if extent > 0 else np.full(len(here), np.inf)


def _turned(start: NetworkState, known: FloatArray, here: FloatArray) -> NetworkState:
    """Turn and, without bars, scale the network about the first of two points to the second."""
    old, new = here[1] - here[0], known[1] - known[0]
    middle = old / np.linalg.norm(old) + new / np.linalg.norm(new)
    if np.linalg.norm(middle) < 1e-9:  # opposite: any half turn across them
        middle = np.linalg.svd(old[None])[2][1]
    middle = middle / np.linalg.norm(middle)
    rotation = 2 * np.outer(middle, middle) - np.eye(3)
    factor = float(np.linalg.norm(new) / np.linalg.norm(old))
    shift = known[0] - factor * rotation @ known[0]
    return Similarity(rotation, shift, factor).in_frame(start)


def _large_triangle(network: Network, start: NetworkState) -> tuple[str, ...]:
    """Return the names of three targets that span a large triangle."""
    points = start.points
    first = np.nanargmax(np.linalg.norm(points - np.nanmean(points, axis=0), axis=1))
    from_first = points - points[first]
    second = np.nanargmax(np.linalg.norm(from_first, axis=1))
    third = np.nanargmax(np.linalg.norm(np.cross(from_first, from_first[second]), axis=1))
    return tuple(network.targets[place] for place in (first, second, third))


def _check_datum(start: NetworkState, index: dict[str, int], datum: Datum) -> None:
    """Raise `ValueError` unless the named targets of a datum are seen and not on a line."""
    if not datum.targets:
        return
    points = np.array([_at(start, index, name) for name in datum.targets])
    finite = np.isfinite(points).all(axis=1)
    unseen = [name for name, found in zip(datum.targets, finite, strict=True) if not found]
    if unseen:
        raise ValueError(
            f'datum: {listed(unseen)} is in no two photographs, expected seen targets'
        )
    if datum.kind == 'fixed' and len(points) != 3:
        raise ValueError(f'datum: {len(points)} fixed targets, expected 3')
    if on_a_line(points, _NARROW):
        raise ValueError(
            f'datum: {listed(datum.targets)} hold no frame, expected three or more targets '
            'that are not on a line'
        )


def _axes(start: NetworkState, points: FloatArray) -> NetworkState:
    """Return values whose frame has its origin, x axis and plane z = 0 at three points (3, 3)."""
    x = points[1] - points[0]
    z = np.cross(x, points[2] - points[0])
    x, z = x / np.linalg.norm(x), z / np.linalg.norm(z)
    rotation = np.stack([x, np.cross(z, x), z])
    return Similarity(rotation, -rotation @ points[0]).in_frame(start)
