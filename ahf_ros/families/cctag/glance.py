"""A glance at the mean profiles about circles, by which most of them are none of a CCTag.

Gray values about a circle are read once, for outermost circles of all radii about its centre, of
all families and colours: the mean profile of each is a part of what is read.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ahf_ros import kernels
from ahf_ros.families.cctag.rays import PROFILE, RAYS, ray_angles
from ahf_ros.families.cctag.templates import (
    CLIPPED,
    DEFOCUSED,
    SIZE_STEP,
    Edge,
    by_value,
    discs,
    less_lines,
    size_steps,
    templates,
    totals,
)
from ahf_ros.prints.cctag import CctagPrint
from ahf_ros.vision import frame
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.dots import Dots
from ahf_ros.vision.sampling import sample_circles

_EVERY = 2  # one of so many angles and radii is looked at
_EDGES: tuple[Edge, ...] = (
    *((0.0, 0.9, more, 0.0) for more in (0.0, 1.0)),
    *((shift, 0.9, 0.0, share) for shift in (-0.4, 0.0) for share in CLIPPED),
)  # of dark ink
_INNERMOST, _RATIO = 0.12, 1.035  # radius from which an outermost circle is read, and to the next
_OUTERMOST = range(-3, 2)  # steps of the radius to that of the outermost circle, where it is found
_NARROWEST = 0.5  # ring that is read, px; blur hides others
_PROMISING = 0.6  # share of a profile that rings explain, from which they are looked at
_OF_DISCS = 0.9  # of 1, so that of rings in one place those that leave least are looked at
_LOOKED_AT = 2  # frames for an ID, at the most
_APART = 0.03  # distance of the centres of different frames, radii
_LEAST_UNLIKE = 1e-6  # of squares of gray values, of their mean
_READ = 128  # circles that are read at a time
_IN_A_ROW = 8  # templates whose mean is compared before them
_COARSE = 0.1  # of a share, which it may explain less: of targets, it explains more
_FEW_DISCS = 23  # one of so many discs is compared before them all
_PART = 4096  # circles that are looked at at a time, which bounds the memory
LARGEST = 1 / 0.15
"""Radius of the outermost circle, in radii of any other."""
_STEPS = np.arange(_OUTERMOST[0], math.ceil(math.log(LARGEST, SIZE_STEP)) + 1)
"""Steps of the radius of a circle to that of the outermost circle."""
_BOUNDS = _INNERMOST * SIZE_STEP ** _STEPS[0], PROFILE[-1] * SIZE_STEP ** _STEPS[-1]
_RADII = np.geomspace(*_BOUNDS, math.ceil(math.log(_BOUNDS[1] / _BOUNDS[0], _RATIO)))
"""Radii of profiles about circles."""

_Likely = tuple[np.ndarray, np.ndarray]  # frames (k, 3, 3), and how much likelier than discs


@dataclass(frozen=True, slots=True)
class Circles(ArrayRecord):
    """Circles, and mean profiles about them."""

    frames: np.ndarray  # (k, 3, 3)
    polarity: np.ndarray  # int, (k,), 0 if it is unknown
    octave: np.ndarray  # int, (k,), the number of that in whose px they are
    highest: np.ndarray  # int, (k,), steps to the largest outermost circle
    profiles: np.ndarray  # float32, (k, n), of rays in their own light, most of like ones

    @staticmethod
    def at(gray: np.ndarray, dots: Dots, octave: int = 0, largest: float = LARGEST) -> Circles:
        """Return the circles of dots; outermost circles may be up to so many times larger."""
        highest = math.ceil(math.log(largest, SIZE_STEP))
        radii = _RADII[: np.searchsorted(_RADII, PROFILE[-1] * SIZE_STEP**highest) + 1]
        count, own = len(dots.frames), int(np.searchsorted(radii, PROFILE[-1]))
        share = np.gradient(radii[:own]).astype(np.float32)
        profiles = np.zeros((count, len(_RADII)), np.float32)
        for start in range(0, count, _READ):
            part = slice(start, start + _READ)
            seen = sample_circles(gray, dots.frames[part], ray_angles(RAYS)[::_EVERY], radii)
            np.maximum(seen, 0, out=seen)
            seen /= np.maximum(seen[..., :own] @ share / share.sum(), 1)[..., None]
            unlike = (seen[..., :own] - seen[..., :own].mean(axis=1, keepdims=True)) ** 2 @ share
            weight = 1 / (unlike + np.median(unlike, axis=1, keepdims=True) + _LEAST_UNLIKE)
            profiles[part, : len(radii)] = (weight[:, None] @ seen)[:, 0]
        octaves, steps = (np.full(count, of) for of in (octave, highest))
        return Circles(dots.frames, dots.polarity, octaves, steps, profiles)


@dataclass(frozen=True, slots=True)
class _Outermost(ArrayRecord):
    """Outermost circles that targets of circles may have."""

    circle: np.ndarray  # int, (k,), row
    octave: np.ndarray  # int, (k,), as that of the circle
    sign: np.ndarray  # int, (k,), the polarity, or 0 if it is unknown
    factor: np.ndarray  # (k,), of the radius
    radius: np.ndarray  # (k,), mean, px
    profiles: np.ndarray  # float32, (k, m), weighted, with squares of a sum of 1

    @staticmethod
    def of(circles: Circles, radii: Sequence[tuple[float, float]]) -> _Outermost:
        """Return those whose semi-major axes are within the radii, px, of their octaves."""
        low, high = np.array(radii)[circles.octave].T[..., None]
        major = frame.ellipse_axes(circles.frames)[0][:, None] * SIZE_STEP**_STEPS
        tried = (major >= low) & (major <= high) & (circles.highest[:, None] >= _STEPS)
        row, step = np.nonzero(tried)
        factor = SIZE_STEP ** _STEPS[step]
        resampled = circles.profiles @ _resampling()
        profiles = resampled.reshape(*tried.shape, len(PROFILE[::_EVERY]))[row, step]
        profiles /= np.sqrt(totals(profiles))[:, None]
        return _Outermost(
            circle=row,
            octave=circles.octave[row],
            sign=circles.polarity[row] * np.where(_STEPS[step] < _OUTERMOST.stop, 1, -1),
            factor=factor,
            radius=frame.mean_radii(circles.frames)[row] * factor,
            profiles=profiles,
        )

    def better(self, kinds: Sequence[tuple[int, CctagPrint]]) -> list[np.ndarray]:
        """Return how much likelier rings of each kind are than discs, (k,), 0 if unlikely."""
        better = [np.zeros(len(self.radius)) for _ in kinds]
        for size, of_size in by_value(size_steps(self.radius)):
            some = self.select(of_size)
            for of_kind, (polarity, family) in zip(better, kinds, strict=True):
                wide = family.narrow * some.radius >= _NARROWEST
                rows = np.flatnonzero(wide & (some.sign * polarity >= 0))
                if not len(rows):
                    continue
                # Ink is dark.
                ink = -polarity * some.profiles[rows]
                sharp = tuple((polarity * of[0], *of[1:3], polarity * of[3]) for of in _EDGES)
                found = _better(ink, family, size, sharp)
                soft = DEFOCUSED * family.narrow * SIZE_STEP**size
                if soft > _EDGES[0][1]:
                    left = np.flatnonzero(found == 0)
                    defocused = ((0.0, soft, 0.0, 0.0),)
                    # Those in focus come first.
                    found[left] = 0.5 * _better(ink[left], family, size, defocused)
                of_kind[of_size[rows]] = found * some.radius[rows]
        return better


@lru_cache(maxsize=1)
def _resampling() -> np.ndarray:
    """Return what makes weighted profiles of circles of all steps of radii, (n, steps m)."""
    at = PROFILE[::_EVERY] * SIZE_STEP ** _STEPS[:, None]
    places = np.log(at / _RADII[0]) / math.log(_RADII[1] / _RADII[0])
    last = len(_RADII) - 1
    away = np.abs(places.clip(0, last)[..., None] - np.arange(last + 1))
    resampled = less_lines(np.maximum(1 - away, 0).swapaxes(1, 2), _EVERY)
    return np.ascontiguousarray(resampled.swapaxes(0, 1).reshape(len(_RADII), -1))


@lru_cache(maxsize=512)
def _templates(
    family: CctagPrint, size: int, edges: tuple[Edge, ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return templates of rings, fewer that are like them, and those of discs, as columns.

    All sizes of both families have their place. Where the mean of templates in a row explains less
    of one than discs do, it is there itself.
    """
    of_rings, of_discs = (
        np.ascontiguousarray(of.T)
        for of in (templates(family, size, edges, _EVERY)[0], discs(size, edges, _EVERY))
    )
    of_some = of_rings.reshape(len(of_rings), -1, _IN_A_ROW).sum(axis=2)
    of_some /= np.linalg.norm(of_some, axis=0)
    lost = (of_rings.T @ of_some).max(axis=1) ** 2 < _least(of_rings.T, of_discs)
    return of_rings, np.concatenate([of_some, of_rings[:, lost]], axis=1), of_discs


def _better(ink: np.ndarray, family: CctagPrint, size: int, edges: tuple[Edge, ...]) -> np.ndarray:
    """Return by how much less of profiles of ink, (k, n), rings leave than discs, ln, (k,).

    It is 0 of what is not like rings.
    """
    of_rings, of_some, of_any_disc = _templates(family, size, edges)
    least = _least(ink, of_any_disc)
    better = 0.0 * least
    rows = np.flatnonzero(np.maximum((ink @ of_some).max(axis=1), 0) ** 2 >= least - _COARSE)
    if not len(rows):
        return better
    share = np.maximum((ink[rows] @ of_rings).max(axis=1), 0) ** 2
    likely = share >= least[rows]
    rows, share = rows[likely], share[likely]
    of_discs = np.abs(ink[rows] @ of_any_disc).max(axis=1) ** 2
    less = _OF_DISCS * np.log1p(-of_discs) - np.log1p(-share)
    better[rows] = np.where(share > of_discs, less, 0)
    return better


def _least(ink: np.ndarray, of_discs: np.ndarray) -> np.ndarray:
    """Return the share of profiles that rings explain at the least, (k,): that of some discs."""
    of_some = np.abs(ink @ of_discs[:, ::_FEW_DISCS]).max(axis=1)
    return np.maximum(of_some**2, np.float32(_PROMISING))


def likely_rings(
    circles: Circles,
    radii: Sequence[tuple[float, float]],
    kinds: Sequence[tuple[int, CctagPrint]],
) -> list[list[np.ndarray]]:
    """Return the frames of outermost circles whose mean profile looks like rings, (k, 3, 3) each.

    They are those of octaves, and in each of kinds: polarities and families. The bounds of octaves
    are those of the semi-major axis, px. An ID is there once, so that some times as many frames
    are enough, those that are most like rings and least like discs.
    """
    found: list[list[list[_Likely]]] = [[[] for _ in kinds] for _ in radii]
    order = np.argsort(frame.mean_radii(circles.frames), kind='stable')
    for start in range(0, max(len(order), 1), _PART):
        part = circles.select(order[start : start + _PART])
        tried = _Outermost.of(part, radii)
        for number, better in enumerate(tried.better(kinds)):
            for octave, of_octave in enumerate(found):
                some = np.flatnonzero((better != 0) & (tried.octave == octave))
                frames = frame.scaled(part.frames[tried.circle[some]], tried.factor[some])
                of_octave[number].append((frames, better[some]))
    return [
        [
            _best(parts, _LOOKED_AT * len(kind[1].numbers))
            for parts, kind in zip(of, kinds, strict=True)
        ]
        for of in found
    ]


def _best(parts: Sequence[_Likely], most: int) -> np.ndarray:
    """Return the best frames of different places."""
    frames, better = (np.concatenate(of) for of in zip(*parts, strict=True))
    frames = frames[np.argsort(-better, kind='stable')]
    centres, apart = frames[:, :2, 2], _APART * frame.mean_radii(frames)
    return frames[kernels.place_owners(centres, apart, np.zeros(len(frames), int), most)]
