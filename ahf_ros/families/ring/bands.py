"""Bands of sectors about dots, whose family nobody knows yet.

The borders of the arcs of a band lie on a grid of as many places as its family has bits, but for
the growth of ink, which makes all arcs longer by as much at either end; the same growth is in the
radii of the band and of the dot.

Edges are where half of what is seen is ink. Blur mixes light, and not the gray values that a
camera makes of it, so that narrow arcs and gaps seem too wide or too narrow in these. Bands are
found in gray values and measured in both: their edges are closer to circles in what blur mixed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ahf_ros.base.blas import one_blas_thread
from ahf_ros.families.claims import owners, within
from ahf_ros.families.contract import DetectorSettings
from ahf_ros.families.ring.polar import angles_of
from ahf_ros.prints import RING_NAMES
from ahf_ros.prints.ring import Radii, RingPrint
from ahf_ros.vision import frame
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.circle_fit import ENOUGH, NO_FITS, Fit, fit_dots
from ahf_ros.vision.dot_search import voted_dots, whole_dots
from ahf_ros.vision.dots import Dots
from ahf_ros.vision.image import as_gray, as_light, check_image
from ahf_ros.vision.pyramid import Octave, image_pyramid, octaves
from ahf_ros.vision.robust import NORMAL, median
from ahf_ros.vision.sampling import sample_circles

MINIMUM_TARGETS = 5
"""Targets of a family from which it is learnt; twenty tell it well."""

_INK_CONTRAST = 0.1  # gray value of ink over that of paper, below which there is no gamma
_ANGLES = 480
_RADII = np.arange(1.05, 5.5, 0.05)  # of circles that are read, dot radii
_TRIED = 4  # times as many dots as are asked for, which are measured
_PART = 32  # dots about which circles are read at a time, which bounds the memory
_CENTRE = np.arange(0.025, 0.4, 0.025)  # of circles about a pinhole, dot radii
_INK, _PAPER = np.array([0.5, 0.6]), np.array([1.3, 1.4])  # of circles beside it
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
GROWTH = np.arange(-2.0, 2.01, 0.1)  # of ink, that is tried, px
_USUAL_GROWTH = 0.8  # its standard deviation, px; an arc that is longer by a sector reads as well
UNUSUAL = 0.5 * (GROWTH / _USUAL_GROWTH) ** 2 * MINIMUM_TARGETS  # log odds against that
_ERROR, _MINIMUM_ERROR = 0.3, 0.008  # of the place of a border: px, and rad at least
_STRAY = 0.05  # share of borders that light makes


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
    gray: np.ndarray, dots: Dots | Fit, families: Sequence[RingPrint]
) -> Sequence[RingPrint]:
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


def _measured(bands: Bands, code: RingPrint, inner: Radii, outer: Radii) -> RingPrint:
    """Return a family with the band that some of the bands have within bounds of its radii."""
    near = (bands.inner > inner[0] - _LOOSE) & (bands.inner < inner[1] + _LOOSE)
    near &= (bands.outer > outer[0] - _LOOSE) & (bands.outer < outer[1] + _LOOSE)
    some = bands.select(near)
    if len(some.size) < _FEW:
        return code
    odds = grid_odds(some, *arc_borders(some), code.bits).sum(axis=1) - UNUSUAL
    band = np.clip(printed_band(some, float(GROWTH[odds.argmax()])), *np.transpose([inner, outer]))
    return _with_band(code, *(np.rint(_STEPS * band) / _STEPS).tolist())


@lru_cache(maxsize=64)
def _with_band(code: RingPrint, inner: float, outer: float) -> RingPrint:
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
    return _RADII[at] + share * (_RADII[1] - _RADII[0])


def _mean(values: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Return the means of some values along the last axis, 0 where there are none."""
    return np.asarray((values * which).sum(axis=-1) / np.maximum(which.sum(axis=-1), 1))


def _distinct(bands: Bands) -> Bands:
    """Return one band of each place, the one whose edges are most exactly circles."""
    order = np.argsort(bands.spread, kind='stable')
    exact = bands.select(order)
    near = within(exact.frames, exact.size * exact.outer)

    def beside(of: np.ndarray) -> np.ndarray:
        return near(of) & (exact.image == exact.image[of, None])

    return bands.select(np.sort(order[owners(len(order), beside)]))


def printed_band(bands: Bands, growth: float) -> tuple[float, float]:
    """Return the radii of bands as printed, dot radii, if ink has grown on all edges, px."""
    dot = bands.size - growth
    inner, outer = bands.inner * bands.size + growth, bands.outer * bands.size - growth
    return float(np.median(inner / dot)), float(np.median(outer / dot))


def arc_borders(bands: Bands) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return target, angle and direction of the borders of arcs, 1 where ink begins."""
    following = np.roll(bands.ink, -1, axis=1)
    row, at = np.nonzero((bands.ink < 0.5) != (following < 0.5))
    here, there = bands.ink[row, at], following[row, at]
    angle = (at + 0.5 + (0.5 - here) / (there - here)) * (2 * np.pi / bands.ink.shape[1])
    return row, angle, np.where(there > here, 1, -1)


def lengths_along(bands: Bands) -> np.ndarray:
    """Return the lengths of a rad in the middle of bands, px."""
    return bands.size * (bands.inner + bands.outer) / 2


def grid_odds(
    bands: Bands, row: np.ndarray, angle: np.ndarray, begins: np.ndarray, bits: int
) -> np.ndarray:
    """Return the log odds of borders on a grid against any places, by growth and target."""
    along, count = lengths_along(bands), len(bands.size)
    error = np.maximum(_ERROR / along, _MINIMUM_ERROR)
    number = np.maximum(np.bincount(row, minlength=count), 1)
    # What the phase, which is fitted to the borders, could have been.
    free = np.log(np.minimum(error * bits / np.sqrt(2 * np.pi * number), 1))
    scores = np.empty((len(GROWTH), count))
    for index, growth in enumerate(GROWTH):
        place = angle + begins * growth / along[row]
        phase = grid_phases(place, row, count, bits)
        off = np.angle(np.exp(1j * bits * (place - phase[row]))) / bits
        density = np.exp(-0.5 * (off / error[row]) ** 2) / (np.sqrt(2 * np.pi) * error[row])
        odds = np.log((1 - _STRAY) * density * (2 * np.pi / bits) + _STRAY)
        scores[index] = np.bincount(row, odds, count) + free
    return scores


def grid_phases(place: np.ndarray, row: np.ndarray, count: int, bits: int) -> np.ndarray:
    """Return where the grids of targets begin, rad."""
    turns = np.exp(1j * bits * place)
    across, down = (np.bincount(row, of, count) for of in (turns.real, turns.imag))
    return np.arctan2(down, across) / bits
