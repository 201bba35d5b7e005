"""Families of ring targets, learnt from photographs of targets that nobody described.

A dot with a concentric band of sectors is a ring target of some family. The borders of its arcs
lie on a grid of as many places as the family has bits, but for the growth of ink, which makes all
arcs longer by as much at either end; the same growth is in the radii of the band and of the dot.
All targets of a family share bits, radii and rules, so that a few borders of each are enough.

Edges are where half of what is seen is ink. Blur mixes light, and not the gray values that a
camera makes of it, so that narrow arcs and gaps seem too wide or too narrow in these. Bands are
found in gray values and measured in both: their edges are closer to circles in what blur mixed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from ahf_ros.blas import one_blas_thread
from ahf_ros.codes import RING_NAMES
from ahf_ros.codes.cyclic import smallest_rotation
from ahf_ros.codes.ring import BITS, Family, Radii, conforming, family
from ahf_ros.detectors.claims import owners
from ahf_ros.detectors.contract import DetectorSettings
from ahf_ros.detectors.ring.polar import angles_of
from ahf_ros.features import frame
from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.features.circle_fit import ENOUGH, NO_FITS, Fit, fit_dots
from ahf_ros.features.dot_search import voted_dots, whole_dots
from ahf_ros.features.dots import Dots
from ahf_ros.features.pyramid import Octave, image_pyramid, octaves
from ahf_ros.features.robust import NORMAL, median
from ahf_ros.features.sampling import sample_circles
from ahf_ros.imaging.image import as_gray, as_light, check_image

MINIMUM_TARGETS = 5
"""Targets of a family from which it is learnt; twenty tell it well."""

_INK_CONTRAST = 0.1  # gray value of ink over that of paper, below which there is no gamma
_ANGLES = 480
_RADII = np.arange(1.05, 5.5, 0.05)  # of circles that are read, dot radii
_TRIED = 4  # times as many dots as are asked for, which are measured
_PART = 32  # dots about which circles are read at a time, which bounds the memory
_CENTRE = np.arange(0.025, 0.4, 0.025)  # of circles about a pinhole, dot radii
_INK, _PAPER = np.array([0.5, 0.6]), np.array([1.3, 1.4])  # of circles beside it
_PINHOLE = 0.025  # radius of a hole that is seen, dot radii
_REACH, _RAYS = 0.25, 48  # of the edge of a dot: dot radii, and their number
_DEPTH = 0.25  # share of the band at either edge that says nothing of its sectors
_NOWHERE = 1e6  # radius of a band that is not there, dot radii
_CLEARLY = 0.85  # of the deviation of edges in light, where gray values have no gamma
_EXACT = 0.12  # deviation of the edges of a band from circles, dot radii
_AGREEING = 0.6  # share of the marks of a band that begin and end there
_MARKED = 0.03, 0.97  # share of a band that is marked
_CLEAREST, _FEW = 200, 3  # dots that a free band is measured on, and least number of its bands
_LEAST = 0.5  # share of ink of a direction, of which an edge of the band is half
_LOOSE = 0.3  # by which growth of ink moves the bounds of a free band, dot radii
_STEPS = 50  # of a dot radius, to which radii are measured
_ALIKE = 0.15  # difference of the radii of bands of one family, dot radii
_GROWTH = np.arange(-2.0, 2.01, 0.1)  # of ink, that is tried, px
_USUAL_GROWTH = 0.8  # its standard deviation, px; an arc that is longer by a sector reads as well
_UNUSUAL = 0.5 * (_GROWTH / _USUAL_GROWTH) ** 2 * MINIMUM_TARGETS  # log odds against that
_ERROR, _MINIMUM_ERROR = 0.3, 0.008  # of the place of a border: px, and rad at least
_STRAY = 0.05  # share of borders that light makes
_PROVEN = 10.0  # log odds of a grid against any places, from which there is a family
_OTHER = 6.0  # log odds of another number of bits, from which a target is of another family
_UNCLEAR = 0.25  # mean difference of sectors from paper and ink
_MISREAD = 0.02  # share of words
_SAME_RADII = 0.08  # difference of radii that are the same, dot radii
_OFTEN = 3  # targets with a word, which then is not misread
_SAMPLED = 50_000  # words that tell how common a rule is
_COUNTED = 15  # bits, up to which all words are counted
_PARITIES = {'': 0.45, 'even': 0.5, 'odd': 0.05}  # probabilities before words are seen
_PAIRS, _PAIRS_ALONE = 0.4, 0.05  # of opposite pairs in words of even parity, and in others
_CHANGES = 0.1  # of a limit of changes
_POSSIBLE = 0.05  # probability from which rules may hold


Rules = dict[str, Any]
"""Arguments of `conforming`."""


@dataclass(frozen=True, slots=True)
class Bands(ArrayRecord):
    """k dots with a concentric band."""

    frames: np.ndarray  # (k, 3, 3)
    size: np.ndarray  # (k,), radius of the dot, px
    polarity: np.ndarray  # (k,), 1 for a dark target on bright ground, -1 for a bright one
    inner: np.ndarray  # (k,), radius of the band as it is seen, dot radii
    outer: np.ndarray  # (k,)
    ink: np.ndarray  # (k, m), share of ink of the band at each angle, see `angles_of`
    spread: np.ndarray  # (k,), of the edges of the band about circles, dot radii
    pinhole: np.ndarray  # (k,), radius of a hole in the dot that what its centre lacks would fill
    image: np.ndarray  # int, (k,), index of the image


@dataclass(frozen=True, slots=True)
class LearntFamily:
    """A family of ring targets as photographs show it."""

    bits: int
    band: tuple[float, float]  # as printed, dot radii
    growth: float  # of ink, on all edges, px
    words: np.ndarray  # (k,), canonical words of the targets
    bands: Bands  # the targets
    odds: float  # log odds of the grid against any places of borders
    lead: float  # the same of the number of bits against the next one
    rules: Rules  # the most probable ones of `likely`
    likely: list[tuple[Rules, float]]  # rules that words may follow, and their probabilities

    @property
    def polarity(self) -> str:
        """Colour of dot and marks, 'dark' or 'bright'."""
        return 'dark' if self.bands.polarity[0] > 0 else 'bright'

    @property
    def pinhole(self) -> float:
        """Radius of the hole in the dot as printed, dot radii, 0 where none is seen."""
        of = self.bands
        printed = np.median((of.pinhole * of.size + self.growth) / (of.size - self.growth))
        seen = np.median(of.pinhole) > _PINHOLE
        return max(float(printed), _PINHOLE) if seen else 0.0

    def known(self, more: Sequence[Family] = ()) -> list[str]:
        """Return the families of this package, and more, of these words and radii, sorted."""
        codes = sorted([*map(family, RING_NAMES), *more], key=lambda code: len(code.words))
        return [
            code.name
            for code in codes
            if code.bits == self.bits
            and np.abs(np.subtract(code.band, self.band)).max() < _SAME_RADII
            and (code.ids(self.words) > 0).all()
        ]


def find_bands(images: Iterable[np.ndarray], settings: DetectorSettings) -> Bands:
    """Return the dots of images that have a concentric band, of whatever family.

    Of `settings`, the radii of dots and their polarity count.
    """
    return bands_about(dots_in(image, settings) for image in images)


DotsOfOctave = tuple[Octave, list[Dots]]
"""An octave, and the dots that each way of searching finds in it."""


def dots_in(image: np.ndarray, settings: DetectorSettings) -> list[DotsOfOctave]:
    """Return the dots of an image that may have bands, whole ones first."""
    check_image(image)
    settings = settings.narrowed(RING_NAMES)
    pyramid = image_pyramid(as_gray(image), settings.max_radius)
    return [
        (
            octave,
            [
                search(octave.pyramid, *octave.radii, settings.polarities)
                for search in (whole_dots, voted_dots)
            ],
        )
        for octave in octaves(pyramid, *settings.radii)
    ]


@one_blas_thread()
def bands_about(images: Iterable[list[DotsOfOctave]], most: int | None = None) -> Bands:
    """Return the bands about dots of images; where `most` is given, of so many of an octave.

    These are the clearest ones.
    """
    found = [_bands(np.zeros((2, 2), np.float32), NO_FITS, 0)]
    for index, image in enumerate(images):
        for octave, dots in image:
            gray = octave.pyramid.gray
            # Those with the largest share of an outline come first.
            fits = [_fit(gray, of.select(slice(most and _TRIED * most))) for of in dots]
            fit = Fit.joined([of.select(of.share >= ENOUGH) for of in fits])
            fit = fit.select(np.sort(fit.clearest(most)))
            for start in range(0, len(fit.frames), _PART):
                part = fit.select(slice(start, start + _PART))
                in_gray, in_light = _bands(gray, part, index)
                found.append((_enlarged(in_gray, octave.level), _enlarged(in_light, octave.level)))
    return _distinct(_most_circular(*map(Bands.joined, zip(*found, strict=True))))


def _enlarged(bands: Bands, level: int) -> Bands:
    """Return bands in the pixels of the image that was halved `level` times."""
    frames = frame.enlarged(bands.frames, level)
    return replace(bands, frames=frames, size=bands.size * 2**level)


def _most_circular(in_gray: Bands, in_light: Bands) -> Bands:
    """Return bands as light shows them, or gray values if edges are clearly closer to circles.

    What light does not show has an infinite spread there, and is as gray values show it.
    """
    shown = in_light.spread < in_gray.spread / _CLEARLY
    if 2 * shown.sum() < len(shown):
        return in_gray
    seen = np.flatnonzero(np.isfinite(in_light.spread))
    return in_gray.replaced(seen, in_light.select(seen))


def _fit(image: np.ndarray, dots: Dots | Fit) -> Fit:
    return fit_dots(image, dots.frames, dots.polarity, rays=_RAYS, reach=_REACH)


def with_measured_bands(
    gray: np.ndarray, dots: Dots | Fit, families: Sequence[Family]
) -> Sequence[Family]:
    """Return families of which those with a free band have the one that clear dots show.

    A family stays as it is where these are few. Radii are rounded, so that few families are made.
    """
    if all(code.bounds is None for code in families):
        return families
    fit = _fit(gray, dots)
    fit = fit.select(fit.share >= ENOUGH)
    bands = _most_circular(*_bands(gray, fit.select(fit.clearest(_CLEAREST)), 0))
    return [
        code if code.bounds is None else _measured(bands, code, *code.bounds) for code in families
    ]


def _measured(bands: Bands, code: Family, inner: Radii, outer: Radii) -> Family:
    """Return a family with the band that some of the bands have within bounds of its radii."""
    near = (bands.inner > inner[0] - _LOOSE) & (bands.inner < inner[1] + _LOOSE)
    near &= (bands.outer > outer[0] - _LOOSE) & (bands.outer < outer[1] + _LOOSE)
    some = bands.select(near)
    if len(some.size) < _FEW:
        return code
    odds = _grid_odds(some, *_borders(some), code.bits).sum(axis=1) - _UNUSUAL
    band = np.clip(_printed(some, float(_GROWTH[odds.argmax()])), *np.transpose([inner, outer]))
    return _with_band(code, *(np.rint(_STEPS * band) / _STEPS).tolist())


@lru_cache(maxsize=64)
def _with_band(code: Family, inner: float, outer: float) -> Family:
    return replace(code, band_inner=inner, band_outer=outer, bounds=None)


def _bands(gray: np.ndarray, fit: Fit, index: int) -> tuple[Bands, Bands]:
    """Return the dots of an image that have a band, as gray values and as light show them."""
    in_gray, good = _measured_in(gray, fit, index)
    in_gray, some = in_gray.select(good), fit.select(good)
    if not good.any():
        return in_gray, in_gray
    light = as_light(gray)
    in_light, good = _measured_in(light, _fit(light, some), index)
    good &= some.contrast > _INK_CONTRAST
    spread, holes = np.where(good, in_light.spread, np.inf), _holes(gray, in_gray)
    return replace(in_gray, pinhole=holes), replace(in_light, pinhole=holes, spread=spread)


def _measured_in(image: np.ndarray, fit: Fit, index: int) -> tuple[Bands, np.ndarray]:
    """Return the bands about dots, but for pinholes, and whether there are any."""
    values = sample_circles(image, fit.frames, angles_of(_ANGLES), _RADII)
    bright, dark = fit.bright[:, None, None], (fit.contrast * fit.bright)[:, None, None]
    ink = (bright - values) / np.maximum(bright - dark, 1)
    ink = np.where(fit.polarity[:, None, None] > 0, ink, 1 - ink)
    marked, edges = _edges(ink)
    usual = [median(of, marked, _NOWHERE) for of in edges]
    away = [np.abs(of - middle[:, None]) for of, middle in zip(edges, usual, strict=True)]
    spread = NORMAL * np.maximum(*(median(of, marked, _NOWHERE) for of in away))
    exact = marked & (np.maximum(*away) < 2 * _EXACT)
    inner, outer = (_mean(of, exact) for of in edges)
    depth = (_RADII - inner[:, None]) / np.maximum(outer - inner, 0.1)[:, None]
    inside = (depth > _DEPTH) & (depth < 1 - _DEPTH)
    pattern = _mean(np.clip(ink, -0.5, 1.5), np.broadcast_to(inside[:, None], ink.shape))
    dark_part = pattern > 0.5
    share = dark_part.mean(axis=1)
    good = (share > _MARKED[0]) & (share < _MARKED[1]) & (spread < _EXACT) & inside.any(axis=1)
    good &= exact.sum(axis=1) > _AGREEING * dark_part.sum(axis=1)
    # Blur leaves narrow bands less dark than the dot.
    low, high = median(pattern, ~dark_part, 0.0), median(pattern, dark_part, 1.0)
    pattern = (pattern - low[:, None]) / np.maximum(high - low, 0.2)[:, None]
    # It rounds the ends of arcs off, where there is less ink from edge to edge.
    marked, edges = _edges(ink / np.clip(pattern, _LEAST, 1)[..., None])
    exact &= marked & dark_part
    inner, outer = (_mean(of, exact) for of in edges)
    errors = [of - mean[:, None] for of, mean in zip(edges, (inner, outer), strict=True)]
    found = Bands(
        frames=fit.frames,
        size=fit.size,
        polarity=fit.polarity,
        inner=inner,
        outer=outer,
        ink=pattern,
        spread=np.sqrt(np.maximum(*(_mean(of**2, exact) for of in errors))),
        pinhole=np.zeros(len(fit.size)),
        image=np.full(len(fit.size), index),
    )
    return found, good


def _edges(ink: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return which rays cross a band, bool (k, m), and the radii of its edges on each, (k, m)."""
    inked = ink >= 0.5
    begins = ~inked[..., :-1] & inked[..., 1:]
    first = begins.argmax(axis=2)
    ends = inked[..., :-1] & ~inked[..., 1:] & (np.arange(len(_RADII) - 1) > first[..., None])
    marked = begins.any(axis=2) & ends.any(axis=2)
    return marked, [_crossing(ink, at) for at in (first, ends.argmax(axis=2))]


def _holes(gray: np.ndarray, bands: Bands) -> np.ndarray:
    """Return the radii of the holes that would make the centres of dots as they are, (k,)."""
    values = sample_circles(gray, bands.frames, angles_of(_ANGLES // 20), _CENTRE)
    about, beyond = (
        np.median(sample_circles(gray, bands.frames, angles_of(_ANGLES // 20), of), axis=(1, 2))
        for of in (_INK, _PAPER)
    )
    step = np.where(np.abs(beyond - about) > 1, beyond - about, 1)
    lack = ((values.mean(axis=1) - about[:, None]) / step[:, None]) @ _CENTRE / _CENTRE.sum()
    return np.asarray(_CENTRE[-1] * np.sqrt(np.maximum(lack, 0)))


def _crossing(ink: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the radii at which rays turn to ink or from it, after some circles."""
    before, after = (np.take_along_axis(ink, (at + of)[..., None], 2)[..., 0] for of in (0, 1))
    step = np.where(np.abs(after - before) > 1e-6, after - before, 1)
    share = np.clip((0.5 - before) / step, 0, 1)
    crossing: np.ndarray = _RADII[at] + share * (_RADII[1] - _RADII[0])
    return crossing


def _mean(values: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Return the means of some values along the last axis, 0 where there are none."""
    return np.asarray((values * which).sum(axis=-1) / np.maximum(which.sum(axis=-1), 1))


def _distinct(bands: Bands) -> Bands:
    """Return one band of each place, the one whose edges are most exactly circles."""
    order = np.argsort(bands.spread, kind='stable')
    exact = bands.select(order)
    centres, reach = exact.frames[:, :2, 2], exact.size * exact.outer

    def beside(index: int) -> np.ndarray:
        near = np.hypot(*(centres - centres[index]).T) < reach[index]
        return near & (exact.image == exact.image[index])

    return bands.select(np.sort(order[owners(len(order), beside)]))


def learn_families(bands: Bands) -> list[LearntFamily]:
    """Return the families of bands, those with the most targets first."""
    left, learnt = np.arange(len(bands.size)), []
    while left.size >= MINIMUM_TARGETS:
        some = bands.select(left)
        apart = [np.abs(of[:, None] - of) for of in (some.inner, some.outer)]
        near = (np.maximum(*apart) < _ALIKE) & (some.polarity[:, None] == some.polarity)
        group = np.flatnonzero(near[near.sum(axis=1).argmax()])
        if group.size < MINIMUM_TARGETS:
            break
        members, found = _learn(some.select(group))
        if len(found.words) >= MINIMUM_TARGETS and found.odds > _PROVEN:
            learnt.append(found)
        left = np.delete(left, group[members])
    return sorted(learnt, key=lambda it: -len(it.words))


def _learn(bands: Bands) -> tuple[np.ndarray, LearntFamily]:
    """Return the indices of bands of one family, and this."""
    counts, arcs = range(BITS[0], BITS[1] + 1), _borders(bands)
    scores = np.stack([_grid_odds(bands, *arcs, bits) for bits in counts])  # bits, growth, target
    own = np.ones(len(bands.size), bool)
    for _ in range(3):
        total = scores[:, :, own].sum(axis=2) - _UNUSUAL
        best, at = np.unravel_index(total.argmax(), total.shape)
        # Targets that another number of bits explains far better are of another family.
        own = scores[best, at] > scores[:, at].max(axis=0) - _OTHER
    bits, growth = counts[int(best)], _peak(_GROWTH, scores[best][:, own].sum(axis=1))
    some = bands.select(own)
    words, clear = _words(some, bits, growth)
    different, count = np.unique(words[clear], return_counts=True)
    likely = likely_rules(different, count >= _OFTEN, bits)
    rules = likely[0][0]
    clear &= conforming(words, bits, **rules)
    found = LearntFamily(
        bits=bits,
        band=_printed(some, growth),
        growth=growth,
        words=words[clear],
        bands=some.select(clear),
        odds=float(total.max()),
        lead=float(total.max() - np.delete(total.max(axis=1), best).max()),
        rules=rules,
        likely=likely,
    )
    return np.flatnonzero(own), found


def _peak(at: np.ndarray, values: np.ndarray) -> float:
    """Return where evenly spaced values, (n,), have their maximum, by the parabola through it."""
    best = int(np.clip(values.argmax(), 1, len(at) - 2))
    before, there, after = values[best - 1 : best + 2]
    bend = max(2 * there - before - after, 1e-9)
    aside = np.clip((after - before) / (2 * bend), -0.5, 0.5)
    return float(at[best] + aside * (at[1] - at[0]))


def _printed(bands: Bands, growth: float) -> tuple[float, float]:
    """Return the radii of bands as printed, dot radii, if ink has grown on all edges, px."""
    dot = bands.size - growth
    inner, outer = bands.inner * bands.size + growth, bands.outer * bands.size - growth
    return float(np.median(inner / dot)), float(np.median(outer / dot))


def _borders(bands: Bands) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return target, angle and direction of the borders of arcs, 1 where ink begins."""
    following = np.roll(bands.ink, -1, axis=1)
    row, at = np.nonzero((bands.ink < 0.5) != (following < 0.5))
    here, there = bands.ink[row, at], following[row, at]
    angle = (at + 0.5 + (0.5 - here) / (there - here)) * (2 * np.pi / bands.ink.shape[1])
    return row, angle, np.where(there > here, 1, -1)


def _along(bands: Bands) -> np.ndarray:
    """Return the lengths of a rad in the middle of bands, px."""
    return bands.size * (bands.inner + bands.outer) / 2


def _grid_odds(
    bands: Bands, row: np.ndarray, angle: np.ndarray, begins: np.ndarray, bits: int
) -> np.ndarray:
    """Return the log odds of borders on a grid against any places, by growth and target."""
    along, count = _along(bands), len(bands.size)
    error = np.maximum(_ERROR / along, _MINIMUM_ERROR)
    number = np.maximum(np.bincount(row, minlength=count), 1)
    # What the phase, which is fitted to the borders, could have been.
    free = np.log(np.minimum(error * bits / np.sqrt(2 * np.pi * number), 1))
    scores = np.empty((len(_GROWTH), count))
    for index, growth in enumerate(_GROWTH):
        place = angle + begins * growth / along[row]
        phase = _phase(place, row, count, bits)
        off = np.angle(np.exp(1j * bits * (place - phase[row]))) / bits
        density = np.exp(-0.5 * (off / error[row]) ** 2) / (np.sqrt(2 * np.pi) * error[row])
        odds = np.log((1 - _STRAY) * density * (2 * np.pi / bits) + _STRAY)
        scores[index] = np.bincount(row, odds, count) + free
    return scores


def _phase(place: np.ndarray, row: np.ndarray, count: int, bits: int) -> np.ndarray:
    """Return where the grids of targets begin, rad."""
    turns = np.exp(1j * bits * place)
    across, down = (np.bincount(row, of, count) for of in (turns.real, turns.imag))
    phase: np.ndarray = np.arctan2(down, across) / bits
    return phase


def _words(bands: Bands, bits: int, growth: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the canonical words of bands, and whether these are clear."""
    row, angle, begins = _borders(bands)
    count, angles = bands.ink.shape
    phase = _phase(angle + begins * growth / _along(bands)[row], row, count, bits)
    inside = np.arange(bits)[:, None] + np.linspace(0.25, 0.75, 9)
    places = inside * (2 * np.pi / bits) + phase[:, None, None]
    at = np.rint(places * (angles / (2 * np.pi)) - 0.5).astype(int) % angles
    levels = np.clip(bands.ink[np.arange(count)[:, None, None], at], 0, 1).mean(axis=2)
    marked = levels > 0.5
    words = (marked << np.arange(bits)).sum(axis=1)
    return smallest_rotation(words, bits), np.abs(levels - marked).mean(axis=1) < _UNCLEAR


def likely_rules(words: np.ndarray, sure: np.ndarray, bits: int) -> list[tuple[Rules, float]]:
    """Return the rules that different words may follow, the most probable ones first.

    The words are drawn from those of a family up to the largest one seen, since some print the
    first words only. Each of n words has the probability 1 / n, so that the rules which leave the
    fewest words are the likeliest that all follow. Sure words follow them; a few others may be
    misread.
    """
    if bits <= _COUNTED:
        every = np.arange(1, 1 << bits)
        every, weight = every[every == smallest_rotation(every, bits)], 1.0
    else:
        drawn = np.random.default_rng(0).integers(1, (1 << bits) - 1, _SAMPLED)
        every, weight = smallest_rotation(drawn, bits), (1 << bits) / bits / _SAMPLED
    every = every[every <= words.max(initial=1)]
    misread = np.log(_MISREAD / max(weight * len(every), 1))
    rules, odds = [], []
    for rule, before in _possible_rules(bits):
        good = conforming(words, bits, **rule)
        if not good[sure].all():
            continue
        count, left = good.sum(), max(weight * conforming(every, bits, **rule).sum(), 1)
        drawn = np.log(np.maximum(left - np.arange(count), 1)).sum()  # none of them twice
        rules.append(rule)
        odds.append(np.log(before) - drawn + (~good).sum() * misread)
    share = np.exp(np.array(odds) - np.max(odds))
    share /= share.sum()
    order = np.argsort(-share, kind='stable').tolist()
    return [
        (rules[at], float(share[at])) for at in order if at == order[0] or share[at] > _POSSIBLE
    ]


def _possible_rules(bits: int) -> Iterator[tuple[Rules, float]]:
    """Yield the rules of words, with their probabilities before any word is seen."""
    limits = range(2, bits - bits % 2, 2)
    for parity, of_parity in _PARITIES.items():
        of_pairs = _PAIRS if parity == 'even' else _PAIRS_ALONE
        pairs = {0: 1 - of_pairs, 1: of_pairs} if bits % 2 == 0 else {0: 1.0}
        for least, of_least in pairs.items():
            rule: Rules = {'parity': parity} if parity else {}
            rule |= {'opposite_pairs': least} if least else {}
            yield rule, of_parity * of_least * (1 - _CHANGES)
            for limit in limits:
                yield rule | {'changes': limit}, of_parity * of_least * _CHANGES / len(limits)
