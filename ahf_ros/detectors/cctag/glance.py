"""A glance at the mean profiles about circles, by which most of them are none of a CCTag.

Gray values about a circle are read once, for outermost circles of all radii about its centre, of
all families and colours: the mean profile of each is a part of what is read.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ahf_ros.codes.cctag import CircleFamily
from ahf_ros.detectors.cctag.rays import ANGLES, PROFILE
from ahf_ros.detectors.cctag.templates import (
    CLIPPED,
    SIZE_STEP,
    Edge,
    by_value,
    discs,
    less_lines,
    shares_of,
    size_steps,
    templates,
)
from ahf_ros.features import frame
from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.features.dots import Dots
from ahf_ros.features.sampling import sample_circles

_EVERY = 2  # one of so many angles and radii is looked at
_EDGES: tuple[Edge, ...] = (
    *((0.0, 0.9, more, 0.0) for more in (0.0, 1.0)),
    *((shift, 0.9, 0.0, share) for shift in (-0.4, 0.0) for share in CLIPPED),
)  # of dark ink
_DEFOCUSED = 0.6  # blur, widths of narrow rings
_INNERMOST, _RATIO = 0.12, 1.035  # radius from which an outermost circle is read, and to the next
_OUTERMOST = range(-3, 2)  # steps of the radius to that of the outermost circle, where it is found
_INNER = 0.15  # radius, of the outermost, of any other circle
_NARROWEST = 0.5  # ring that is read, px; blur hides others
_PROMISING = 0.6  # share of a profile that rings explain, from which they are looked at
_OF_DISCS = 0.9  # of 1, so that of rings in one place those that leave least are looked at
_LOOKED_AT = 2  # frames for an ID, at the most
_APART = 0.1  # distance of the centres of different frames, radii
_LEAST_UNLIKE = 1e-6  # of squares of gray values, of their mean
_PART = 128  # circles that are read at a time


@dataclass(frozen=True, slots=True)
class Circles(ArrayRecord):
    """Circles, the smallest first, and mean profiles about them."""

    frames: np.ndarray  # (k, 3, 3)
    polarity: np.ndarray  # int, (k,), 0 if it is unknown
    step: np.ndarray  # int, (k,), of radii
    profiles: np.ndarray  # float32, (k, n), of rays in their own light, most of like ones


@dataclass(frozen=True, slots=True)
class Glance:
    """Circles, and the steps from their radii to those that outermost circles may have."""

    circles: Circles
    steps: range
    radii: np.ndarray  # of profiles, (n,)

    @staticmethod
    def at(gray: np.ndarray, dots: Dots, largest: float = 1 / _INNER) -> Glance:
        """Return a glance at dots; outermost circles may be up to so many times larger."""
        last = math.ceil(math.log(largest) / math.log(SIZE_STEP))
        steps = range(_OUTERMOST[0], last + 1)
        low, high = (SIZE_STEP**step for step in (steps[0], steps[-1]))
        low, high = math.log(_INNERMOST * low), math.log(PROFILE[-1] * high)
        radii = np.exp(np.linspace(low, high, math.ceil((high - low) / math.log(_RATIO))))
        step = size_steps(frame.mean_radii(dots.frames))
        order = np.argsort(step, kind='stable')
        dots = dots.select(order)
        own = int(np.searchsorted(radii, PROFILE[-1]))
        share = np.gradient(radii[:own]).astype(np.float32)
        profiles = np.empty((len(order), len(radii)), np.float32)
        for start in range(0, len(order), _PART):
            part = slice(start, start + _PART)
            seen = sample_circles(gray, dots.frames[part], ANGLES[::_EVERY], radii)
            np.maximum(seen, 0, out=seen)
            seen /= np.maximum(seen[..., :own] @ share / share.sum(), 1)[..., None]
            unlike = (seen[..., :own] - seen[..., :own].mean(axis=1, keepdims=True)) ** 2 @ share
            weight = 1 / (unlike + np.median(unlike, axis=1, keepdims=True) + _LEAST_UNLIKE)
            profiles[part] = (weight[:, None] @ seen)[:, 0]
        return Glance(Circles(dots.frames, dots.polarity, step[order], profiles), steps, radii)

    def likely(
        self, radii: tuple[float, float], polarity: int, family: CircleFamily
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return likely frames of outermost circles, and how much likelier they are than discs."""
        circles, ups = self.circles, np.array(self.steps)
        sign = np.where(ups < _OUTERMOST.stop, polarity, -polarity)
        factor = SIZE_STEP**ups
        major = frame.ellipse_axes(circles.frames)[0][:, None] * factor
        narrow = frame.mean_radii(circles.frames)[:, None] * factor * family.narrow
        tried = (major >= radii[0]) & (major <= radii[1]) & (narrow >= _NARROWEST)
        tried &= circles.polarity[:, None] * sign >= 0
        row, up = np.nonzero(tried)
        sharp = tuple((polarity * of[0], *of[1:3], polarity * of[3]) for of in _EDGES)
        resampled = [polarity * self._resampled(by) for by in self.steps]
        better = np.zeros(len(row))
        for size, some in by_value(circles.step[row] + ups[up]):
            profiles = np.empty((len(some), len(PROFILE[::_EVERY])), np.float32)
            for by, of in by_value(up[some]):
                profiles[of] = circles.profiles[row[some[of]]] @ resampled[by]
            better[some] = _better(profiles, family, size, sharp)
            soft = _DEFOCUSED * family.narrow * SIZE_STEP**size
            if soft > _EDGES[0][1]:
                left = np.flatnonzero(better[some] == 0)
                defocused = ((0.0, soft, 0.0, 0.0),)
                # Those in focus come first.
                better[some[left]] = 0.5 * _better(profiles[left], family, size, defocused)
        likely = np.flatnonzero(better)
        frames = frame.scaled(circles.frames[row[likely]], factor[up[likely]])
        return frames, better[likely] * frame.mean_radii(frames)

    def _resampled(self, by: int) -> np.ndarray:
        """Return what makes weighted profiles of circles so many steps larger, (n, m)."""
        ratio = math.log(self.radii[1] / self.radii[0])
        at = np.log(PROFILE[::_EVERY] * SIZE_STEP**by / self.radii[0]) / ratio
        places = np.arange(len(self.radii))
        away = np.abs(at.clip(0, places[-1])[:, None] - places)
        return less_lines(np.maximum(1 - away, 0).T, _EVERY)


def _better(
    profiles: np.ndarray, family: CircleFamily, size: int, edges: tuple[Edge, ...]
) -> np.ndarray:
    """Return by how much less of profiles, (k, n), rings leave than discs, ln, (k,).

    It is 0 of what is not like rings.
    """
    share = shares_of(profiles, templates(family, size, edges, _EVERY)[0], most=0).max(axis=1)
    likely = np.flatnonzero(share >= _PROMISING)
    of_discs = shares_of(profiles[likely], discs(size, edges, _EVERY)).max(axis=1)
    better = np.zeros(len(share))
    less = _OF_DISCS * np.log1p(-of_discs) - np.log1p(-share[likely])
    better[likely] = np.where(share[likely] > of_discs, less, 0)
    return better


def likely_rings(
    glances: Sequence[Glance], radii: tuple[float, float], polarity: int, family: CircleFamily
) -> np.ndarray:
    """Return the frames of outermost circles whose mean profile looks like rings, (k, 3, 3).

    The bounds are those of the semi-major axis. An ID is there once, so that some times as many
    frames are enough, those that are most like rings and least like discs.
    """
    found = [of.likely(radii, polarity, family) for of in glances]
    frames, better = (np.concatenate(of) for of in zip(*found, strict=True))
    size, centres = frame.mean_radii(frames), frames[:, :2, 2]
    kept: list[int] = []
    free = np.ones(len(size), bool)
    for index in np.argsort(-better, kind='stable').tolist():
        if len(kept) == _LOOKED_AT * len(family.numbers):
            break
        if free[index]:
            away = np.hypot(*(centres - centres[index]).T)
            free &= away >= _APART * np.maximum(size, size[index])
            kept.append(index)
    return frames[kept]
