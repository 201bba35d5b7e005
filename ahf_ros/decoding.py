"""Reading the band of ring targets by likelihood, under light that is nowhere even.

Every reading asks: is this place of the band marked (the colour of the dot) or not (the colour of
the surround)? Three kinds of evidence that light cannot easily fake together are added, each a
logarithm of the likelihood of marked over unmarked:

- arcs: the step across the inner and the outer edge of the band, against the step that a mark
  makes at the gray value found beside it;
- levels: the gray value itself, against those of the surround in the gap and the margin of the
  same target, as they are and as a mark would turn them;
- borders: the step along the band where two sectors meet, and its absence within them.

All valid words compete at all rotations and phases.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cache
from typing import TypeVar

import numpy as np

from ahf_ros import frame
from ahf_ros.candidates import LOG_OFFSET
from ahf_ros.codes.ring import Family, smallest_rotation
from ahf_ros.subpixel import Circles, dot_circles

_Record = TypeVar('_Record', 'Readings', 'Marks')

SAMPLES_PER_SECTOR = 10
"""Angles at which a sector is read."""

_ACROSS = 2.6  # distance of a reading from an edge, px
_NEAREST_ACROSS, _FARTHEST_ACROSS = 0.13, 0.36  # the same, dot radii
_BAND_DEPTHS = (0.3, 0.5, 0.7)  # of the band, where its level is read
_GAP_DEPTHS = (0.35, 0.65)
_DOT_DEPTHS = (0.35, 0.7)  # of the dot
_DEEPEST_SHADOW = 0.1  # of the light on the dot, elsewhere on the target
_NOISE = 1.2  # gray values, of 255
_SURROUND_SPREAD = 0.16  # of ln, of steps where there is no edge
_MARK_SPREAD, _MARK_TAIL = 0.16, 0.35  # of ln, of the step of a mark, and towards more
_BORDER_SPREAD = 0.2  # of steps along the band, in steps of a mark
_LEVEL_SPREAD = 0.12  # of ln, of levels
_FLOOR = 0.06  # density of what no hypothesis explains, such as an edge of light
_LARGEST = 4.0  # evidence of one reading
_AGREEMENT = 0.35  # of ln, between a step and what a word wants
_LEAST_STEP = 0.2  # of ln, of a mark
_CORRELATION = 2.5  # px between independent readings
_LEVEL_BIN = 0.05  # of ln
_LEVELS = np.arange(np.log(LOG_OFFSET), np.log(255 + LOG_OFFSET) + _LEVEL_BIN, _LEVEL_BIN)


@dataclass(frozen=True, slots=True)
class Readings:
    """The words read from k bands.

    Attributes
    ----------
    words : ndarray of int64, shape (k,)
        The best valid word, in the rotation read from `start`.
    phase : ndarray of int, shape (k,)
        Where the first sector begins, in samples counter-clockwise from +x of the frame.
    margin : ndarray of float64, shape (k,)
        Evidence for the best word over the best one of another ID, in units of ln.
    weakest : ndarray of float64, shape (k,)
        Evidence of the least certain sector for its own bit, in units of ln.
    explained : ndarray of float64, shape (k, 5)
        Share of the steps that are as the word wants them: onto unmarked sectors at the inner and
        the outer edge of the band, onto marked ones at both, and within the gap.
    """

    words: np.ndarray
    phase: np.ndarray
    margin: np.ndarray
    weakest: np.ndarray
    explained: np.ndarray

    @property
    def plausible(self) -> np.ndarray:
        """Whether it is worth a closer look, ndarray of bool, shape (k,)."""
        arcs = self.explained[:, :4].min(axis=1)
        return (self.margin > 1) & (self.weakest > -15) & (arcs > 0.3)

    def chosen(self, which: np.ndarray) -> Readings:
        """Return some of the readings."""
        return _chosen(self, which)


def _chosen(record: _Record, which: np.ndarray) -> _Record:
    """Return a record of arrays with some of its rows."""
    return replace(record, **{of.name: getattr(record, of.name)[which] for of in fields(record)})


@dataclass(frozen=True, slots=True)
class Marks:
    """How the marks of k targets look against their surround.

    Attributes
    ----------
    signs : ndarray of int, shape (k,)
        1 where marks are dark, -1 where they are bright.
    contrast : ndarray of float64, shape (k,)
        Gray value of dark over bright under the same light.
    bright : ndarray of float64, shape (k,)
        Usual gray value of the bright side of the dot's edge.
    """

    signs: np.ndarray
    contrast: np.ndarray
    bright: np.ndarray

    def chosen(self, which: np.ndarray) -> Marks:
        """Return the marks of some of the targets."""
        return _chosen(self, which)

    def step(self, values: np.ndarray) -> np.ndarray:
        """Return the step of ln onto a mark where the bright side has gray values (k, ...)."""
        spread = (slice(None),) + (None,) * (values.ndim - 1)
        bright = np.maximum(values, _DEEPEST_SHADOW * self.bright[spread])
        dark = self.contrast[spread] * bright
        return self.signs[spread] * np.log((dark + LOG_OFFSET) / (bright + LOG_OFFSET))


def read_bands(gray: np.ndarray, frames: np.ndarray, marks: Marks, family: Family) -> Readings:
    """Read the bands of targets.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    frames : ndarray of float64, shape (k, 3, 3)
    marks : Marks
    family : Family

    Returns
    -------
    Readings
    """
    count = family.bits * SAMPLES_PER_SECTOR
    angles = -2 * np.pi * (np.arange(count) + 0.5) / count  # counter-clockwise as seen
    major, minor, _ = frame.ellipse_axes(frames)
    size = np.sqrt(major * minor)
    inner, outer = family.band_inner, family.band_outer
    across = np.clip(_ACROSS / size, _NEAREST_ACROSS, _FARTHEST_ACROSS)[:, None]
    fixed = np.concatenate(
        [
            inner + (outer - inner) * np.array(_BAND_DEPTHS),
            1 + (inner - 1) * np.array(_GAP_DEPTHS),
            np.array(_DOT_DEPTHS),
        ]
    )
    edges = np.array([inner, inner, outer, outer]) + across * np.array([-1, 1, -1, 1])
    radii = np.concatenate([edges, np.broadcast_to(fixed, (len(frames), len(fixed)))], axis=1)
    values = frame.sample(gray, frame.project(frames, frame.circle_points(angles, radii)))
    values = np.moveaxis(np.maximum(values, 0), 2, 0)
    gap_in, band_in, band_out, outside = values[:4]
    of_band, of_gap, of_dot = values[4:7], values[7:9], values[9:11]

    arcs = [(gap_in, band_in), (outside, band_out)]
    evidence = sum(_step_evidence(surround, inside, marks) for surround, inside in arcs)
    surround = np.concatenate([of_gap, [gap_in, outside]])
    bright = np.where((marks.signs > 0)[:, None], surround, np.concatenate([of_dot, of_dot]))
    evidence += _level_evidence(bright, of_band, marks)
    evidence *= np.clip(2 * np.pi * inner * size / count / _CORRELATION, 0.08, 1)[:, None]
    depth = np.clip((outer - inner) * size / len(of_band) / _CORRELATION, 0.1, 1)[:, None]
    rises, falls = (depth * borders for borders in _border_evidence(of_band, marks))
    words, phases, margin, weakest = _best_words(evidence, rises, falls, family)

    samples = (np.arange(count) - phases[:, None]) % count // SAMPLES_PER_SECTOR
    bits = (words[:, None] >> samples & 1).astype(bool)
    explained = np.stack(_explained(arcs, of_gap, marks, bits), axis=1)
    return Readings(words, phases, margin, weakest, explained)


def _log_ratio(values: np.ndarray, others: np.ndarray) -> np.ndarray:
    return np.log((values + LOG_OFFSET) / (others + LOG_OFFSET))


def _explained(
    arcs: list[tuple[np.ndarray, np.ndarray]], gap: np.ndarray, marks: Marks, bits: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Return the shares of steps that are as a word wants them."""
    agree = []
    for surround, values in arcs:
        step = _log_ratio(values, surround)
        mark = marks.step(np.maximum(values, surround))
        # Where a mark would make no step, nothing tells it from the surround.
        marked = (np.abs(step - mark) < _AGREEMENT) & (np.abs(mark) > _AGREEMENT)
        agree.append(np.where(bits, marked, np.abs(step) < _AGREEMENT))
    shares = [
        (of_arc & which).sum(axis=1) / np.maximum(which.sum(axis=1), 1)
        for which in (~bits, bits)
        for of_arc in agree
    ]
    return *shares, (np.abs(_log_ratio(gap[1], gap[0])) < _AGREEMENT).mean(axis=1)


def _step_evidence(surround: np.ndarray, values: np.ndarray, marks: Marks) -> np.ndarray:
    """Return the evidence that a step from the surround leads onto a mark."""
    step = _log_ratio(values, surround)
    noise = _NOISE * np.hypot(1 / (values + LOG_OFFSET), 1 / (surround + LOG_OFFSET))
    unmarked = _normal(step, np.hypot(_SURROUND_SPREAD, noise))
    wanted = marks.step(np.maximum(values, surround))
    error = (step - wanted) * np.sign(wanted)
    spread, tail = np.hypot(_MARK_SPREAD, noise), np.hypot(_MARK_TAIL, noise)
    width = np.where(error > 0, tail, spread)
    marked = _normal(error, width) * width / ((spread + tail) / 2)
    evidence = np.log((marked + _FLOOR) / (unmarked + _FLOOR))
    return np.clip(evidence, -_LARGEST, _LARGEST)


def _level_evidence(bright: np.ndarray, values: np.ndarray, marks: Marks) -> np.ndarray:
    """Return the evidence of the gray values of the band, given those of bright places.

    Bright places of the target show under which light it lies: the density of their levels is that
    of the bright parts of the band, and moved by the step of a mark that of the dark ones.
    """
    seen = _bins(_flat(np.moveaxis(bright, 0, 2)))
    levels = np.broadcast_to(np.exp(_LEVELS) - LOG_OFFSET, (len(seen), len(_LEVELS)))
    moved = _LEVELS - np.abs(marks.step(levels)) - _LEVELS[0]
    moved = np.clip(np.rint(moved / _LEVEL_BIN).astype(np.intp), 0, len(_LEVELS) - 1)
    dark = np.take_along_axis(moved, seen, axis=1)
    table = np.log((_density(dark) + _FLOOR) / (_density(seen) + _FLOOR))
    table *= marks.signs[:, None]
    places = np.moveaxis(values, 0, 2)
    evidence = np.take_along_axis(table, _bins(_flat(places)), axis=1).reshape(places.shape)
    return np.clip(evidence, -_LARGEST, _LARGEST).mean(axis=2)


def _flat(values: np.ndarray) -> np.ndarray:
    """Return values of shape (k, ...) as (k, m), also where k is 0."""
    return values.reshape(len(values), int(np.prod(values.shape[1:])))


def _bins(values: np.ndarray) -> np.ndarray:
    """Return the bins of gray values among `_LEVELS`."""
    places = np.rint((np.log(np.maximum(values, 0) + LOG_OFFSET) - _LEVELS[0]) / _LEVEL_BIN)
    return np.clip(places.astype(np.intp), 0, len(_LEVELS) - 1)


def _density(bins: np.ndarray) -> np.ndarray:
    """Return the smoothed densities of k sets of bins, shape (k, number of levels)."""
    size = len(_LEVELS)
    keys = (bins + size * np.arange(len(bins))[:, None]).ravel()
    counts = np.bincount(keys, minlength=size * len(bins)).reshape(len(bins), size)
    distance = np.arange(size)[:, None] - np.arange(size)
    kernel = np.exp(-0.5 * (distance * _LEVEL_BIN / _LEVEL_SPREAD) ** 2)
    kernel /= _LEVEL_SPREAD * np.sqrt(2 * np.pi)
    return counts / max(bins.shape[1], 1) @ kernel


def _border_evidence(band: np.ndarray, marks: Marks) -> tuple[np.ndarray, np.ndarray]:
    """Return the evidence of borders onto a mark and off it, against none, after each angle."""
    before, after = np.roll(band, 1, axis=2), np.roll(band, -2, axis=2)
    bright = np.moveaxis(np.maximum(before, after), 0, 2)
    mark = np.moveaxis(marks.step(bright), 2, 0)
    # A mark that makes no step cannot be told by one.
    mark = np.sign(mark) * np.maximum(np.abs(mark), _LEAST_STEP)
    rise = _log_ratio(after, before) / mark
    onto, none, off = (
        np.log(_normal(rise - wanted, _BORDER_SPREAD) + _FLOOR) for wanted in (1, 0, -1)
    )
    return (onto - none).sum(axis=0), (off - none).sum(axis=0)


def _normal(values: np.ndarray, spread: np.ndarray | float) -> np.ndarray:
    return np.exp(-0.5 * (values / spread) ** 2) / (spread * np.sqrt(2 * np.pi))


@cache
def _rotations(family: Family) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return all rotations of all words, sorted by word, their first places, and their bits.

    The bits, shape (2 n, number of rotations), are followed by the products of neighbours.
    """
    number = np.arange(len(family.words))
    rotated, numbers = [family.words], [number]
    for _ in range(family.bits - 1):
        last = rotated[-1]
        rotated.append(last >> 1 | (last & 1) << (family.bits - 1))
        numbers.append(number)
    words, first = np.unique(np.concatenate(rotated), return_index=True)
    number = np.concatenate(numbers)[first]
    order = np.argsort(number, kind='stable')
    words, number = words[order], number[order]
    bits = (words >> np.arange(family.bits)[:, None] & 1).astype(np.float32)
    starts = np.flatnonzero(np.diff(number, prepend=-1))
    return words, starts, np.concatenate([bits, bits * np.roll(bits, -1, axis=0)])


def _best_words(
    marked: np.ndarray,
    rises: np.ndarray,
    falls: np.ndarray,
    family: Family,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return word, phase, margin and weakest sector of the best reading of each band."""
    count, bits = len(marked), family.bits
    words, starts, features = _rotations(family)
    phases = np.arange(SAMPLES_PER_SECTOR)
    samples = phases[:, None] + np.arange(bits * SAMPLES_PER_SECTOR)
    shape = (count, len(phases), bits, SAMPLES_PER_SECTOR)
    sectors = marked[:, samples % samples.shape[1]].reshape(shape).sum(axis=3)
    borders = phases[:, None] + SAMPLES_PER_SECTOR * np.arange(1, bits + 1) - 1
    onto, off = (steps[:, borders % samples.shape[1]] for steps in (rises, falls))
    # A border between the bits a and b gives: onto (1 - a) b + off a (1 - b).
    single = sectors + off + np.roll(onto, 1, axis=2)
    evidence = np.concatenate([single, -(onto + off)], axis=2).astype(np.float32)

    best = np.zeros(count, np.int64)
    phase, margin = np.zeros(count, np.intp), np.zeros(count)
    for index in range(count):
        scores = evidence[index] @ features
        of_word = scores.max(axis=0)
        of_number = np.maximum.reduceat(of_word, starts)
        best[index] = of_word.argmax()
        phase[index] = scores[:, best[index]].argmax()
        second, first = np.partition(of_number, len(of_number) - 2)[-2:]
        margin[index] = first - second
    own = np.take_along_axis(sectors, phase[:, None, None], axis=1)[:, 0]
    signs = 2 * features[:bits, best].T - 1
    weakest = (own * signs).min(axis=1)
    return words[best], phase, margin, weakest


def marked_circles(readings: Readings, signs: np.ndarray, rays: int, family: Family) -> Circles:
    """Return where a reading expects edges: round the dot and along the marked sectors.

    Parameters
    ----------
    readings : Readings
    signs : ndarray of int, shape (k,)
        1 for a dark dot, -1 for a bright one.
    rays : int
        Number of points round the dot.
    family : Family
    """
    dot = dot_circles(signs, rays)
    count = family.bits * SAMPLES_PER_SECTOR
    angles = -2 * np.pi * (np.arange(count) + 0.5) / count
    sample = (np.arange(count) - readings.phase[:, None]) % count
    sector, place = np.divmod(sample, SAMPLES_PER_SECTOR)
    # Next to its ends an arc is rounded off by the blur.
    inner_part = (place > 0) & (place < SAMPLES_PER_SECTOR - 1)
    marked = (readings.words[:, None] >> sector & 1 & inner_part) * signs[:, None]
    return Circles(
        np.concatenate([dot.angles, angles, angles]),
        np.concatenate([dot.radii, np.repeat([family.band_inner, family.band_outer], count)]),
        np.concatenate([dot.polarity, -marked, marked], axis=1),
    )


def confidence(readings: Readings, share: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """Return the probability that readings are right."""
    return np.where(
        (readings.margin > 5) & (readings.weakest > 0) & (share > 0.7),
        0.95,
        0.1,
    )


def canonical(words: np.ndarray, family: Family) -> tuple[np.ndarray, np.ndarray]:
    """Return the code words and IDs of words in any rotation, all of the family."""
    codes = smallest_rotation(words, family.bits)
    return codes, np.searchsorted(family.words, codes) + 1
