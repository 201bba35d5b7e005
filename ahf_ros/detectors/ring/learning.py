"""Families of ring targets, learnt from photographs of targets that nobody described.

A dot with a concentric band about it is a ring target of some family. The borders of its arcs lie
on a grid of so many angles as the family has bits, but for the growth of ink, which makes all arcs
longer by as much at either end; the radii of the band, and of the dot itself, tell the same
growth from proportions. All targets of a family share number of bits and radii, so that a few
borders of each are enough.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ahf_ros.codes.cyclic import smallest_rotation
from ahf_ros.detectors.ring.polar import angles_of
from ahf_ros.features import frame
from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.features.circle_fit import ENOUGH, NO_FITS, Fit, fit_dots
from ahf_ros.features.dot_search import voted_dots, whole_dots
from ahf_ros.features.pyramid import image_pyramid, octaves
from ahf_ros.features.sampling import sample_circles
from ahf_ros.imaging.image import as_gray, check_image

BITS = (6, 24)
"""Fewest and most bits of a family."""

_ANGLES = 480
_RADII = np.arange(1.05, 5.5, 0.05)  # of circles, dot radii
_REACH, _RAYS = 0.25, 48  # of the edge of a dot: dot radii, and their number
_DEEP = 0.25  # share of the band at either edge that says nothing
_CONCENTRIC = 0.12  # deviation of the edges of a band from circles, dot radii
_MARKED = (0.03, 0.97)  # share of a band that is marked
_ALIKE = 0.15  # difference of radii of bands of one family, dot radii
_GROWTH = np.arange(-2.0, 2.01, 0.1)  # of ink, that is tried, px
_USUAL_GROWTH = 0.8  # px
_BORDER = 0.3  # standard deviation of the place of a border, px
_STRAY = 0.05  # share of borders that light makes
_OTHER = 6.0  # log odds of another number of bits, from which a target is of another family
_CLEAR = 0.25  # mean difference of sectors from paper and ink
_MINIMUM_TARGETS = 5


@dataclass(frozen=True, slots=True)
class Bands(ArrayRecord):
    """k dots with a concentric band.

    Attributes
    ----------
    frames : ndarray of float64, shape (k, 3, 3)
    size : ndarray of float64, shape (k,)
        Radii of the dots, px.
    polarity : ndarray of int, shape (k,)
        1 for a dark target on bright ground, -1 for a bright one on dark.
    inner, outer : ndarray of float64, shape (k,)
        Radii of the band as it is seen, dot radii.
    ink : ndarray of float64, shape (k, m)
        Share of ink of the band at each angle, see `angles_of`.
    image : ndarray of int, shape (k,)
        Index of the image.
    """

    frames: np.ndarray
    size: np.ndarray
    polarity: np.ndarray
    inner: np.ndarray
    outer: np.ndarray
    ink: np.ndarray
    image: np.ndarray


@dataclass(frozen=True, slots=True)
class LearntFamily:
    """A family of ring targets as photographs show it.

    Attributes
    ----------
    bits : int
    band : tuple of 2 float
        Radii of the band as printed, dot radii.
    growth : float
        By how much ink has grown on all edges, px.
    polarity : int
    words : ndarray of int64, shape (k,)
        Canonical words of the targets.
    bands : Bands
        The targets.
    lead : float
        Log odds of the number of bits against the next one.
    """

    bits: int
    band: tuple[float, float]
    growth: float
    polarity: int
    words: np.ndarray
    bands: Bands
    lead: float


def find_bands(
    images: Iterable[np.ndarray],
    radii: tuple[float, float] = (4.0, 1e4),
    polarities: Sequence[int] = (1, -1),
) -> Bands:
    """Return the dots of images that have a concentric band of any family."""
    found = []
    for index, image in enumerate(images):
        check_image(image)
        gray = as_gray(image)
        pyramid = image_pyramid(gray, radii[1])
        for octave in octaves(pyramid, *radii):
            part = octave.pyramid.gray
            fits = [NO_FITS]
            for search in (whole_dots, voted_dots):
                dots = search(octave.pyramid, *octave.radii, polarities)
                fits.append(
                    fit_dots(part, dots.frames, dots.polarity, rays=_RAYS, reach=_REACH, rounds=2)
                )
            fit = _distinct(Fit.joined(fits))
            bands = _bands(part, fit, index)
            found.append(
                Bands(
                    **{
                        **{n: getattr(bands, n) for n in Bands.__dataclass_fields__},
                        'frames': frame.enlarged(bands.frames, octave.level),
                        'size': bands.size * 2**octave.level,
                    }
                )
            )
    return Bands.joined(found)


def _distinct(fit: Fit) -> Fit:
    fit = fit.select(fit.share >= ENOUGH)
    kept: list[int] = []
    centres = fit.frames[:, :2, 2]
    for index in np.argsort(-fit.share, kind='stable'):
        away = np.hypot(*(centres[kept] - centres[index]).T)
        if not (away < 0.5 * fit.size[index]).any():
            kept.append(int(index))
    return fit.select(np.array(kept, int))


def _bands(gray: np.ndarray, fit: Fit, index: int) -> Bands:
    """Return the dots that have a band, of one image."""
    angles = angles_of(_ANGLES)
    values = sample_circles(gray.astype(np.float32), fit.frames, angles, _RADII)
    dark = (fit.contrast * fit.bright)[:, None, None]
    bright = fit.bright[:, None, None]
    share = (bright - values) / np.maximum(bright - dark, 1)
    ink = np.where(fit.polarity[:, None, None] > 0, share, 1 - share)
    rises = (ink[..., :-1] < 0.5) & (ink[..., 1:] >= 0.5)
    first = rises.argmax(axis=2)
    falls = (ink[..., :-1] >= 0.5) & (ink[..., 1:] < 0.5)
    falls &= np.arange(falls.shape[2]) > first[..., None]
    last = falls.argmax(axis=2)
    marked = rises.any(axis=2) & falls.any(axis=2)
    inner, outer = (_crossing(ink, at) for at in (first, last))
    middle, spread = zip(*(_usual(of, marked) for of in (inner, outer)), strict=True)
    clear = [np.abs(of - at[:, None]) < 2 * _CONCENTRIC for of, at in zip((inner, outer), middle)]
    whole = marked & clear[0] & clear[1]
    start, end = (_mean(of, whole) for of in (inner, outer))
    depth = (_RADII - start[:, None]) / np.maximum(end - start, 0.1)[:, None]
    inside = (depth > _DEEP) & (depth < 1 - _DEEP)
    pattern = (np.clip(ink, -0.5, 1.5) * inside[:, None]).sum(axis=2)
    pattern /= np.maximum(inside.sum(axis=1), 1)[:, None]
    is_marked = (pattern > 0.5).mean(axis=1)
    # Blur leaves narrow bands less dark than the dot.
    low, high = _mean(pattern, pattern <= 0.5), _mean(pattern, pattern > 0.5)
    pattern = (pattern - low[:, None]) / np.maximum(high - low, 0.2)[:, None]
    agree = whole.sum(axis=1) / np.maximum((pattern > 0.5).sum(axis=1), 1)
    good = (
        (is_marked > _MARKED[0])
        & (is_marked < _MARKED[1])
        & (agree > 0.6)
        & (spread[0] < _CONCENTRIC)
        & (spread[1] < _CONCENTRIC)
        & inside.any(axis=1)
    )
    return Bands(
        frames=fit.frames,
        size=fit.size,
        polarity=fit.polarity,
        inner=start,
        outer=end,
        ink=pattern,
        image=np.full(len(fit.size), index),
    ).select(good)


def _crossing(ink: np.ndarray, at: np.ndarray) -> np.ndarray:
    before = np.take_along_axis(ink, at[..., None], 2)[..., 0]
    after = np.take_along_axis(ink, at[..., None] + 1, 2)[..., 0]
    step = np.where(np.abs(after - before) > 1e-6, after - before, 1)
    share = np.clip((0.5 - before) / step, 0, 1)
    return _RADII[at] + share * (_RADII[1] - _RADII[0])


def _usual(values: np.ndarray, which: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    masked = np.where(which, values, np.nan)
    masked[~which.any(axis=1)] = 99.0
    usual = np.nanmedian(masked, axis=1)
    return usual, 1.4826 * np.nanmedian(np.abs(masked - usual[:, None]), axis=1)


def _mean(values: np.ndarray, which: np.ndarray) -> np.ndarray:
    return (values * which).sum(axis=1) / np.maximum(which.sum(axis=1), 1)


def learn_families(bands: Bands) -> list[LearntFamily]:
    """Return the families of bands, those with the most targets first."""
    left, learnt = np.arange(len(bands.size)), []
    while left.size >= _MINIMUM_TARGETS:
        some = bands.select(left)
        apart = np.maximum(
            np.abs(some.inner[:, None] - some.inner), np.abs(some.outer[:, None] - some.outer)
        )
        near = (apart < _ALIKE) & (some.polarity[:, None] == some.polarity)
        group = np.flatnonzero(near[near.sum(axis=1).argmax()])
        if group.size < _MINIMUM_TARGETS:
            break
        one, members = _learn(some.select(group))
        if one is not None:
            learnt.append(one)
        left = np.delete(left, group[members] if one is not None else group)
    return sorted(learnt, key=lambda it: -len(it.words))


def _learn(bands: Bands) -> tuple[LearntFamily | None, np.ndarray]:
    counts = range(BITS[0], BITS[1] + 1)
    scores = np.stack([_border_scores(bands, bits) for bits in counts])  # bits, growth, targets
    total = scores.sum(axis=2)
    best, at = np.unravel_index(total.argmax(), total.shape)
    # Targets that other numbers of bits explain far better are of another family.
    for _ in range(3):
        own = scores[best, at] > scores[:, at].max(axis=0) - _OTHER
        total = scores[:, :, own].sum(axis=2)
        best, at = np.unravel_index(total.argmax(), total.shape)
    members = np.flatnonzero(own)
    if members.size < _MINIMUM_TARGETS:
        return None, members
    bits, growth = counts[int(best)], float(_GROWTH[at])
    some = bands.select(members)
    printed = some.size - growth
    inner = np.median((some.inner * some.size + growth) / printed)
    outer = np.median((some.outer * some.size - growth) / printed)
    words, clear = _words(some, bits, growth)
    others = np.delete(total.max(axis=1), best)
    family = LearntFamily(
        bits=bits,
        band=(float(inner), float(outer)),
        growth=growth,
        polarity=int(some.polarity[0]),
        words=words[clear],
        bands=some.select(clear),
        lead=float(total.max() - others.max()),
    )
    return family, members


def _borders(bands: Bands) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return target, angle and direction of the borders of arcs."""
    ink = bands.ink
    following = np.roll(ink, -1, axis=1)
    row, at = np.nonzero((ink < 0.5) != (following < 0.5))
    here, there = ink[row, at], following[row, at]
    angle = (at + 0.5 + (0.5 - here) / (there - here)) * (2 * np.pi / ink.shape[1])
    return row, angle, np.where(there > here, 1, -1)


def _border_scores(bands: Bands, bits: int) -> np.ndarray:
    """Return the log odds of borders on a grid against any place, by growth and target."""
    row, angle, rising = _borders(bands)
    count = len(bands.size)
    along = bands.size * (bands.inner + bands.outer) / 2  # px a rad
    scores = np.empty((len(_GROWTH), count))
    error = np.maximum(_BORDER / along, 0.008)
    number = np.maximum(np.bincount(row, minlength=count), 1)
    for index, growth in enumerate(_GROWTH):
        place = angle + rising * growth / along[row]
        turns = np.exp(1j * bits * place)
        phase = np.angle(
            np.bincount(row, turns.real, count) + 1j * np.bincount(row, turns.imag, count)
        )
        off = np.angle(np.exp(1j * (bits * place - phase[row]))) / bits
        density = np.exp(-0.5 * (off / error[row]) ** 2) / (np.sqrt(2 * np.pi) * error[row])
        odds = np.log((1 - _STRAY) * density * (2 * np.pi / bits) + _STRAY)
        free = np.log(np.minimum(error * bits / np.sqrt(2 * np.pi * number), 1))
        scores[index] = np.bincount(row, odds, count) + free
    # An arc that is longer by a sector reads as well; one by less than a pixel is usual.
    scores -= 0.5 * (_GROWTH[:, None] / _USUAL_GROWTH) ** 2 / max(count, 1) * _MINIMUM_TARGETS
    return scores


def _words(bands: Bands, bits: int, growth: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the canonical words of bands, and whether they are clear."""
    row, angle, rising = _borders(bands)
    count = len(bands.size)
    along = bands.size * (bands.inner + bands.outer) / 2
    turns = np.exp(1j * bits * (angle + rising * growth / along[row]))
    phase = (
        np.angle(np.bincount(row, turns.real, count) + 1j * np.bincount(row, turns.imag, count))
        / bits
    )
    m = bands.ink.shape[1]
    offsets = np.linspace(-0.25, 0.25, 9)
    places = (np.arange(bits)[:, None] + 0.5 + offsets) * (2 * np.pi / bits) + phase[:, None, None]
    index = np.rint(places / (2 * np.pi) * m - 0.5).astype(int) % m
    levels = np.clip(bands.ink[np.arange(count)[:, None, None], index], 0, 1)
    means = levels.mean(axis=2)
    marked = means > 0.5
    clear = np.abs(means - marked).mean(axis=1) < _CLEAR
    words = (marked << np.arange(bits)).sum(axis=1)
    return smallest_rotation(words, bits), clear
