"""The rings of CCTags: a glance at profiles, and rings that are brought onto the image.

Neighbouring circles are too close for their edges to be measured one by one. So all gray values
about a centre are compared with the rings of an ID at once, without the light, which is found
first. The values of each ray are a linear function of the ink of sharp rings under a normal blur.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np

from ahf_ros.families.cctag.light import EDGES, Lights, lit
from ahf_ros.families.cctag.rays import (
    ALONG,
    ANGLES,
    PROFILE,
    Rays,
    robust_rays,
)
from ahf_ros.families.cctag.templates import (
    CLIPPED,
    MASK,
    MAXIMUM_SHIFT,
    Edge,
    by_value,
    less_lines,
    rings_along,
    shares_of,
    size_steps,
    templates,
    two_discs,
)
from ahf_ros.families.words import against
from ahf_ros.prints.cctag import CircleFamily
from ahf_ros.vision import frame
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.image import as_light
from ahf_ros.vision.logistic import logistic
from ahf_ros.vision.normal import normal_integral
from ahf_ros.vision.robust import NORMAL

_TRIED_SHIFTS = -1.2, -0.6, 0.0, 0.6, 1.2  # deviations
_TRIED_BLURS, _TRIED_SHARPENINGS = (-1.0, 0.0, 1.4), (3.0, 7.0)  # the same
_GROWN = (0.85, 0.9, 0.95, 1.0, 1.05)  # radii of the outermost circle, where that was found
_PART = 512, 48  # frames of all scales and targets at a time, which bounds the memory
_SHARED = 0.55  # share of what rays show, that is the same on all, from which they are read
_CLEARLY = 0.03  # `left` by which rings must be better explained
_TELLING_OF_GAMMA = 16  # targets
_ENOUGH = 4  # certain targets, that tell of the edges of an image
_OF_CAMERA = 0.03  # standard deviation of the sharpening of one camera
_OF_IMAGE = 0.1, 0.1, _OF_CAMERA  # of growth, ln of the blur and sharpening, of an image's targets
_SCALES = tuple(np.linspace(0.93, 1.07, 9).tolist())  # of the radius, about a frame
_ALIKE = 0.9  # share of the mean of rays, that some ID explains
_LIKE_DISCS = 12.0  # px: two discs leave less than rings of so many px, by a factor of e at most
_READINGS = 5  # IDs that are brought onto the image from a frame
_REPEATS, _STAYING = 6, 0.1  # until the square of a move is a small part of the variance
_OUTLIERS = 12.0, 6.0, 3.0, 3.0  # deviations that quarter a weight, in rounds of Gauss-Newton
_MAXIMUM_CHANGE = 0.08  # of a frame in a round, radii
_PERSPECTIVE = 5e-4  # change of scale along a px where tilted by 45 degrees: 1 / focal length, px
_LEAST_TILT = 0.1  # tangent of the tilt that a circular target may have
_LEAST_VARIANCE = 1e-6  # of gray values, of their mean
_OF_VARIANCE = 2.0  # of gray values, that their model adds
_SHARPEST, _SOFTEST = 0.35, 1.5  # blur: px, and in narrow rings, which more of it would hide
_SHARPENINGS = 0.0, 4.0  # amounts of it
_HELD = 1e9  # weight of a bound
_MOST_OF_EDGES = 0.3, 0.3, 1.0  # change of shift, ln of the blur and sharpening in a round
_INDEPENDENT = 0.3  # distance of independent readings along a profile, px
_CLEAREST = 0.2  # share of rays
_AGREEING = 0.5  # share of what a ray shows, that the rings explain
_OF_TARGET = np.array([-14.1, -1.5, 3.0, -1.0, 1.0])  # of one, and of what follows
_USUAL_EDGES = 0.13, 0.3  # deviations of growth, px, and of ln of the blur, of targets
_GROWTH_HIDES = 3.0  # ln of odds, at the most growth
_SHARPENING_HIDES = 0.8  # ln of odds, of an amount of 1
_CLIPPING_HIDES = 3.0  # ln of odds, where all gray values are clipped
_PLAIN = -5.0, 5.0  # beyond which it says no more
_BY_SIZE, _USUAL_SIZE = 2.5, 12.0  # what `plain` grows by ln of the radius, from its px
_USUAL_BLURS = 14.0  # the same radius, in standard deviations of the usual blur
_AS_CLEAR = -6.0  # as it gets, by anything that is round
_HOPELESS = 1e-6, 1e-4  # probabilities of a target, up to which one ID and few IDs are enough
_UNLIKELY = 1e-3  # the same, up to which no place is settled, which hardly changes it
_FEW_READINGS = 2  # IDs that are brought onto the image before the others
_OF_ID = np.array([-1.4, 1.2])  # of one, margin


@dataclass(frozen=True, slots=True)
class Prior:
    """What is known of the edges of an image: growth of ink, px, blur, px, and sharpening.

    `expected` are IDs that are likely to be there. Empty: all IDs are equally likely.

    The deviations are standard deviations, px, of ln of the blur, which is that of the image with
    that of pixels and of interpolation, and of the sharpening, the amount of an unsharp mask.
    """

    shift: float = 0.0
    blur: float = 0.85
    sharpening: float = 0.0
    deviations: tuple[float, float, float] = (0.5, 0.35, 0.35)
    expected: frozenset[int] = frozenset()

    def cost(self, rings: Aligned, size: np.ndarray) -> np.ndarray:
        """Return what is taken from ln of the odds of rings of a size, px, shape (k,)."""
        away = self.away(rings.shift, rings.blur, rings.sharpening) / self.deviations
        independent = size * np.ptp(PROFILE) / _INDEPENDENT
        left = independent * rings.known * rings.left + (away**2).sum(axis=1)
        return left / 2 + against(rings.ids, self.expected)

    def away(self, shift: np.ndarray, blur: np.ndarray, sharpening: np.ndarray) -> np.ndarray:
        """Return how far edges are from what is known, in the units of deviations, (k, 3)."""
        return np.stack(
            [shift - self.shift, np.log(blur / self.blur), sharpening - self.sharpening], axis=1
        )

    @lru_cache(maxsize=64)  # noqa: B019, as a prior is a few numbers
    def tried(self, polarity: int) -> tuple[Edge, ...]:
        """Return the edges of templates, also clipped ones unless the polarity is 0."""
        of_shift, of_blur, of_sharpening = self.deviations
        tried = list(product(_TRIED_SHIFTS, _TRIED_BLURS, [(0.0, 0.0)]))
        others = [(more, 0.0) for more in _TRIED_SHARPENINGS]
        others += [(0.0, polarity * of) for of in CLIPPED if polarity]
        tried += list(product(_TRIED_SHIFTS[::2], [0.0], others))
        return tuple(
            (
                round(self.shift + shift * of_shift, 2),
                round(self.blur * math.exp(blur * of_blur), 2),
                round(self.sharpening + more * of_sharpening, 2),
                clipped,
            )
            for shift, blur, (more, clipped) in tried
        )

    def of_camera(self, rings: Aligned) -> Prior:
        """Return what likely targets tell of the camera of an image."""
        if len(rings.ids) < _ENOUGH:
            return Prior(expected=self.expected)
        usual = Prior().deviations[:2]
        return Prior(
            sharpening=float(np.median(rings.sharpening)),
            deviations=(*usual, _OF_CAMERA),
            expected=self.expected,
        )

    def after(self, rings: Aligned) -> Prior:
        """Return what certain targets tell of the others."""
        count = len(rings.ids)
        if count < _ENOUGH:
            return Prior(expected=self.expected)
        edges = np.stack([rings.shift, np.log(rings.blur), rings.sharpening], axis=1)
        usual = np.median(edges, axis=0)
        spread = NORMAL * np.median(np.abs(edges - usual), axis=0)
        variance = (count * spread**2 + _ENOUGH * np.square(_OF_IMAGE)) / (count + _ENOUGH)
        shift, blur, sharpening = usual.tolist()
        of_shift, of_blur, of_sharpening = np.sqrt(variance).tolist()
        deviations = of_shift, of_blur, of_sharpening
        return Prior(shift, math.exp(blur), sharpening, deviations, self.expected)


_USUAL = Prior()


@dataclass(frozen=True, slots=True)
class Aligned(ArrayRecord):
    """The rings of k IDs as they are brought onto an image."""

    frames: np.ndarray  # (k, 3, 3), of the outermost circles as printed
    ids: np.ndarray  # int, (k,)
    covariance: np.ndarray  # (k, 2, 2), of centres, px^2
    shift: np.ndarray  # (k,), by which ink has grown, px
    blur: np.ndarray  # (k,), standard deviation, px
    sharpening: np.ndarray  # (k,), amount of an unsharp mask
    colour: np.ndarray  # (k,), 1 where ink is dark, -1 where it is bright
    rays: np.ndarray  # (k,), share of the rays that show the rings by themselves
    clear: np.ndarray  # (k,), ln of the share of a ray that is not explained, of clear rays
    left: np.ndarray  # (k,), ln of the share of a ray that is not explained, on the mean
    plain: np.ndarray  # (k,), the same of any two edges, less that of the rings
    unusual: np.ndarray  # (k,), half the squares of deviations of edges, that leave a doubt
    known: np.ndarray  # (k,), share of gray values that are not clipped
    margin: np.ndarray  # (k,), ln of the odds against the next ID; NaN before it is known
    by_pixels: np.ndarray  # (k,), ln of the odds that there is a target, by pixels: 0 if not asked

    @property
    def edges(self) -> np.ndarray:
        """Shift, blur and sharpening, shape (k, 3)."""
        return np.stack([self.shift, self.blur, self.sharpening], axis=1)

    @property
    def edge_shift(self) -> np.ndarray:
        """By how much what is dark has grown, px, shape (k,)."""
        return self.shift * self.colour

    @property
    def of_target(self) -> np.ndarray:
        """Probability that there is a target, shape (k,)."""
        size = frame.mean_radii(self.frames)
        # Blur takes from large targets what their size adds.
        large = np.maximum(np.log(size / self.blur / _USUAL_BLURS), 0)
        plain = self.plain - _BY_SIZE * np.minimum(np.log(size / _USUAL_SIZE), large)
        clear = np.maximum(self.clear, _AS_CLEAR)
        features = [clear, np.clip(plain, *_PLAIN), self.unusual, self.by_pixels]
        return logistic(np.stack(features, axis=1), _OF_TARGET)

    @property
    def of_id(self) -> np.ndarray:
        """Probability that a target has the ID, shape (k,)."""
        return logistic(self.margin[:, None], _OF_ID)

    @property
    def confidence(self) -> np.ndarray:
        """Probability that there is a target with the ID, shape (k,)."""
        return self.of_target * self.of_id


NOTHING = Aligned(
    *(np.zeros((0, 3, 3)), np.zeros(0, int), np.zeros((0, 2, 2)), *np.zeros((12, 0)))
)


def identify(
    gray: np.ndarray,
    frames: np.ndarray,
    polarity: int,
    family: CircleFamily,
    prior: Prior = _USUAL,
    most: int = EDGES,
) -> Aligned:
    """Return the best reading of each target about outermost circles, edges to about a tenth.

    The light about each has so many edges at the most.
    """
    lights = Lights.about(gray, frames, most)
    lights = lights.select(show_the_same(gray, lights))
    return identify_in(gray, lights, polarity, family, prior, most)


def identify_in(
    gray: np.ndarray,
    lights: Lights,
    polarity: int,
    family: CircleFamily,
    prior: Prior = _USUAL,
    most: int = EDGES,
) -> Aligned:
    """Return what `identify` does where the light is known."""
    if not len(lights.frames):
        return NOTHING
    starts, ids, edges, rings = likely_ids(gray, lights, polarity, family, prior)
    if not rings.any():
        return NOTHING
    starts, ids, edges = (of[rings] for of in (starts, ids, edges))
    lights = lights.select(rings)
    # The likeliest ID often brings the frame to its place even if it is the wrong one.
    first = align(gray, starts[:, 0], ids[:, 0], edges[:, 0], family, prior, lights)
    likely = first.of_target > _HOPELESS[0]
    if not likely.any():
        return NOTHING
    lights = Lights.about(gray, first.frames[likely], most)
    again = likely_ids(gray, lights, polarity, family, prior)[:3]
    starts, ids, edges = (
        np.concatenate([more, of[likely]], axis=1)
        for of, more in zip((starts, ids, edges), again, strict=True)
    )
    few = np.arange(ids.shape[1]) < _FEW_READINGS
    tried = np.nonzero(np.broadcast_to(few, ids.shape))
    of_first = lights.select(tried[0])
    first = align(gray, starts[tried], ids[tried], edges[tried], family, prior, of_first)
    possible = first.of_target.reshape(-1, _FEW_READINGS).max(axis=1) > _HOPELESS[1]
    if not possible.any():
        return NOTHING
    first = first.select(np.repeat(possible, _FEW_READINGS))
    starts, ids, edges = (of[possible] for of in (starts, ids, edges))
    lights = lights.select(possible)
    tried = np.nonzero(np.broadcast_to(few, ids.shape))
    others = np.nonzero(_unlike_before(ids) & ~few)
    of_more = lights.select(others[0])
    more = align(gray, starts[others], ids[others], edges[others], family, prior, of_more)
    every = Aligned.joined([first, more])
    rows, columns = np.concatenate([tried, others], axis=1)
    every = replace(every, left=np.where(every.colour == polarity, every.left, 0.0))
    cost = np.full(ids.shape, np.inf)
    cost[rows, columns] = prior.cost(every, frame.mean_radii(starts[rows, 0]))
    index = np.zeros(ids.shape, int)
    index[rows, columns] = np.arange(len(rows))
    best = every.select(index[np.arange(len(ids)), cost.argmin(axis=1)])
    next_best = np.where(ids == best.ids[:, None], np.inf, cost).min(axis=1)
    best = replace(best, margin=next_best - cost.min(axis=1))
    likely = (best.of_target > _UNLIKELY) & (best.colour == polarity)
    best = _settled(gray, best.select(likely), family, prior, lights.select(likely))
    return best.select(best.colour == polarity)


def _unlike_before(ids: np.ndarray) -> np.ndarray:
    """Return which IDs are not in their row before, shape (k, n)."""
    same = ids[:, :, None] == ids[:, None]
    return same.argmax(axis=2) == np.arange(ids.shape[1])


def _settled(
    gray: np.ndarray, rings: Aligned, family: CircleFamily, prior: Prior, lights: Lights
) -> Aligned:
    """Return rings brought onto the image until they stay; what still moves is as uncertain."""
    moving = np.arange(len(rings.ids))
    for _ in range(_REPEATS):
        some = rings.select(moving)
        light = lights.select(moving)
        again = align(gray, some.frames, some.ids, some.edges, family, prior, light)
        away = again.frames[:, :2, 2] - some.frames[:, :2, 2]
        spread = away[:, :, None] * away[:, None]
        covariance = again.covariance + spread
        again = replace(again, covariance=covariance, margin=some.margin)
        rings = rings.replaced(moving, again)
        moving = moving[
            (away**2).sum(axis=1)
            > _STAYING * np.trace(again.covariance - spread, axis1=1, axis2=2)
        ]
        if not len(moving):
            break
    return rings


def likely_ids(
    gray: np.ndarray,
    lights: Lights,
    polarity: int,
    family: CircleFamily,
    prior: Prior,
    count: int = _READINGS,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return frames, (k, n, 3, 3), of IDs that profiles are like, (k, n), and edges, (k, n, 3).

    The last are whether there may be rings of any ID, (k,).
    """
    frames = lights.moved
    shape = len(_SCALES), len(frames), len(family.numbers)
    each = np.tile(np.arange(len(frames)), len(_SCALES))
    scaled = frame.scaled(frames[each], np.repeat(_SCALES, len(frames)))
    profiles = np.empty((len(each), len(PROFILE)), np.float32)
    clipped = np.empty(len(each), bool)
    shares, edges = np.empty(shape), np.empty((*shape, 3))
    of_each, edges_of_each = (of.reshape(len(each), *of.shape[2:]) for of in (shares, edges))
    for start in range(0, len(each), _PART[0]):
        part = slice(start, start + _PART[0])
        seen = lit(gray, scaled[part], lights.select(each[part]))
        profiles[part] = less_lines(polarity * seen.values.mean(axis=1, dtype=np.float64))
        clipped[part] = seen.clipped
    for step, of_size in by_value(size_steps(frame.mean_radii(scaled))):
        for of in (0, 1):
            some = of_size[clipped[of_size] == of]
            if not len(some):
                continue
            of_rings, tried = templates(family, step, prior.tried(polarity * of))
            found = shares_of(profiles[some], of_rings)
            found = found.reshape(len(some), -1, shape[2])
            of_each[some], edges_of_each[some] = found.max(axis=1), tried[found.argmax(axis=1)]
    rows = np.arange(len(frames))
    profile = profiles[shares.max(axis=2).argmax(axis=0) * len(frames) + rows]
    rings = _unlike_discs(profile, shares.max(axis=(0, 2)), frames)
    order = np.argsort(-shares.max(axis=0), axis=1, kind='stable')[:, :count]
    # Where narrow and wide rings take turns, growth of the ink makes one word the other.
    order = np.concatenate([order, family.numbers[-1] - order[:, :1]], axis=1)
    rows = rows[:, None]
    scale = shares.argmax(axis=0)[rows, order]
    found = edges[scale, rows, order]
    found[..., 1] = prior.blur
    return scaled[scale * len(frames) + rows], order, found, rings


def _unlike_discs(profiles: np.ndarray, shares: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Return whether rings explain shares of profiles, (k,), that two discs do not explain."""
    of_two = np.empty(len(shares))
    for step, of_size in by_value(size_steps(frame.mean_radii(frames))):
        of_two[of_size] = two_discs(profiles[of_size], step)
    left_by_two, left = (np.maximum(1 - of, 1e-6) for of in (of_two, shares))
    better = np.log(left_by_two / left) >= -_LIKE_DISCS / frame.mean_radii(frames)
    return (shares >= _ALIKE) & better


def show_the_same(gray: np.ndarray, lights: Lights) -> np.ndarray:
    """Return whether most of what rays show in a light is the same on all of them, shape (k,)."""
    values = lit(gray, lights.moved, lights).values
    means, rays = less_lines(values.mean(axis=1)), less_lines(values)
    return (means**2).sum(axis=1) >= _SHARED * (rays**2).sum(axis=2).mean(axis=1)


def in_light(gray: np.ndarray, rings: Aligned, family: CircleFamily) -> np.ndarray:
    """Return an image of light, where rings show clearly that its gray values have a gamma.

    Blur mixes light, and not gray values, which matters where rings are narrow.
    """
    some = rings.select(np.argsort(-rings.plain, kind='stable')[:_TELLING_OF_GAMMA])
    light = as_light(gray)
    again = _settled(light, some, family, _USUAL, Lights.about(light, some.frames))
    telling = np.maximum(some.of_target, again.of_target)
    return light if telling @ (again.left - some.left + _CLEARLY) < 0 else gray


def align(
    gray: np.ndarray,
    frames: np.ndarray,
    ids: np.ndarray,
    edges: np.ndarray,
    family: CircleFamily,
    prior: Prior = _USUAL,
    lights: Lights | None = None,
) -> Aligned:
    """Bring the rings of IDs (k,) onto an image from frames (k, 3, 3), known to about a tenth.

    The edges to begin with, (k, 3), are growth of ink and blur, px, and sharpening. The lights are
    those about the frames, unless they are given.
    """
    if lights is None:
        lights = Lights.about(gray, frames)
    parts = [slice(start, start + _PART[1]) for start in range(0, len(frames), _PART[1])]
    return Aligned.joined(
        [NOTHING]
        + [
            _aligned(
                gray, frames[part], ids[part], edges[part], family, prior, lights.select(part)
            )
            for part in parts
        ]
    )


def _aligned(
    gray: np.ndarray,
    frames: np.ndarray,
    ids: np.ndarray,
    edges: np.ndarray,
    family: CircleFamily,
    prior: Prior,
    lights: Lights,
) -> Aligned:
    """Return what `align` does, by Gauss-Newton with robust weights."""
    count = len(frames)
    shift, blur, sharpening = edges.T
    for outlier in _OUTLIERS:
        size = frame.mean_radii(frames)
        seen = lit(gray, frames, lights)
        ink, slope, *by_edges = rings_along(family, ids, size, shift, blur, sharpening)
        rays = robust_rays(seen, ink, outlier)
        by_radius = [slope, slope * ALONG, slope * ALONG**2]
        normal, right = rays.equations(np.stack([*by_radius, *by_edges], axis=1), ink)
        variance = (rays.weight * rays.errors**2).sum(axis=(1, 2)) / rays.weight.sum(axis=(1, 2))
        area = size**2 * (PROFILE[1] - PROFILE[0]) * (ANGLES[1] - ANGLES[0])
        each = (
            np.minimum(area, 1.0) / (variance + _LEAST_VARIANCE) / _OF_VARIANCE
        )  # pixels are independent
        normal, right = normal * each[:, None, None], right * each[:, None]
        normal[:, range(5), range(5)] += 1e-6
        usual = usual_perspective(frames)
        normal[:, 5:7, 5:7] += usual
        right[:, 5:7] -= (usual @ frames[:, 2, :2, None])[..., 0]
        known = np.array(prior.deviations) ** -2
        normal[:, range(7, 10), range(7, 10)] += known
        right[:, 7:] -= prior.away(shift, blur, sharpening) * known
        change = np.linalg.solve(normal, right[..., None])[..., 0]
        # What goes beyond a bound is held there, so that the others do not make up for it.
        bounded = np.clip(sharpening + change[:, 9], *_SHARPENINGS) - sharpening
        held = np.where(bounded == change[:, 9], 0.0, _HELD)
        normal[:, 9, 9] += held
        right[:, 9] += held * bounded
        change = np.linalg.solve(normal, right[..., None])[..., 0]
        limit = np.concatenate([np.full(7, _MAXIMUM_CHANGE), _MOST_OF_EDGES])
        change = np.clip(change, -limit, limit)
        frames = frame.moved(frames, change[:, :7])
        narrow = family.narrow * size
        shift = np.clip(shift + change[:, 7], -MAXIMUM_SHIFT * narrow, MAXIMUM_SHIFT * narrow)
        blur = np.clip(
            blur * np.exp(change[:, 8]), _SHARPEST, np.maximum(_SOFTEST * narrow, _SHARPEST)
        )
        sharpening = np.clip(sharpening + change[:, 9], *_SHARPENINGS)
    covariance = frame.centre_covariance(frames, np.linalg.inv(normal)[:, :2, :2])
    seen = lit(gray, frames, lights)
    size = frame.mean_radii(frames)
    ink = rings_along(family, ids, size, shift, blur, sharpening)[0]
    rays = Rays.of(seen, ink, np.broadcast_to(ALONG, seen.values.shape))
    squares = (of**2 @ ALONG for of in (rays.errors, rays.deviations(seen.values)))
    left, shown = (of.astype(np.float64) for of in squares)
    agreeing = (left < (1 - _AGREEING) * shown) & (
        np.sign(rays.step) == np.sign(np.median(rays.step, axis=1))[:, None]
    )
    rest = np.log(np.maximum(left, 1e-6) / np.maximum(shown, 1e-6))
    good = np.where(agreeing, np.exp(-rest), 1e-3)
    known = (rays.gain @ ALONG).mean(axis=1) / ALONG.sum()
    return Aligned(
        frames=frames,
        ids=ids,
        covariance=covariance,
        shift=shift,
        blur=blur,
        sharpening=sharpening,
        colour=-np.sign(np.median(rays.step, axis=1)),
        rays=agreeing.mean(axis=1),
        clear=np.quantile(rest, _CLEAREST, axis=1),
        left=rest.mean(axis=1),
        plain=_plain(
            rays.model + rays.errors / np.maximum(rays.gain, 0.05),
            rays.model,
            good[..., None] * rays.weight * rays.gain**2,
            blur / size,
        ),
        unusual=_unusual(shift, blur, prior) * np.minimum(3 * (1 - agreeing.mean(axis=1)), 1)
        + _hiding(shift, sharpening, known, family.narrow * size),
        known=known,
        margin=np.full(count, np.nan),
        by_pixels=np.zeros(count),
    )


def _unusual(shift: np.ndarray, blur: np.ndarray, prior: Prior) -> np.ndarray:
    """Return half the squares of deviations of edges, (k,): chance finds rings of any growth."""
    deviations = np.stack([shift - prior.shift, np.log(blur / prior.blur)], axis=1) / _USUAL_EDGES
    return (deviations**2).sum(axis=1) / 2


def _hiding(
    shift: np.ndarray, sharpening: np.ndarray, known: np.ndarray, narrow: np.ndarray
) -> np.ndarray:
    """Return by how much growth, sharpening and clipping hide narrow rings of so many px, (k,)."""
    grown = _GROWTH_HIDES * (shift / (MAXIMUM_SHIFT * narrow)) ** 8
    sharpened = _SHARPENING_HIDES * sharpening**2 / (1 + np.abs(sharpening))
    others = sharpened + _CLIPPING_HIDES * (1 - known)
    return grown + others * (MASK / narrow) ** 2


def usual_perspective(frames: np.ndarray) -> np.ndarray:
    """Return the inverse covariances of the perspective of frames, (k, 2, 2), that is expected.

    Scale changes along the minor axis of a tilted target, the more the more it is foreshortened.
    """
    _, axes, directions = np.linalg.svd(frame.local_affine(frames))
    tilt = np.sqrt(np.maximum((axes[:, 0] / axes[:, 1]) ** 2 - 1, 0))
    most = np.stack([np.full(len(frames), _LEAST_TILT), tilt + _LEAST_TILT], axis=1)
    weight = (most * _PERSPECTIVE * frame.mean_radii(frames)[:, None]) ** -2
    return directions.transpose(0, 2, 1) * weight[:, None] @ directions


def _plain(seen: np.ndarray, rings: np.ndarray, good: np.ndarray, blur: np.ndarray) -> np.ndarray:
    """Return by how much better rings explain a profile than two edges of any height do, (k,).

    It is the difference of ln of what is left of the weighted mean of rays. What is seen, what
    the rings make of it and the weights `good` have the shape (k, rays, n). The blur is in radii.
    """
    shown = good.sum(axis=1)
    profiles, inks = ((good * of).sum(axis=1) / np.maximum(shown, 1e-9) for of in (seen, rings))
    weights = np.sqrt(shown / shown.sum(axis=1, keepdims=True))
    edges = np.linspace(PROFILE[0], PROFILE[-1], 66)[3:-3, None]
    line, _ = np.linalg.qr(np.stack([weights, PROFILE * weights], axis=2))
    steps = normal_integral((edges - PROFILE) / blur[:, None, None])
    values = np.concatenate([profiles[:, None], inks[:, None], steps], axis=1) * weights[:, None]
    values -= (values @ line) @ line.transpose(0, 2, 1)
    profile, ink, steps = values[:, 0], values[:, 1], values[:, 2:]
    total = np.maximum((profile**2).sum(axis=1), 1e-12)
    steps = steps / np.maximum(np.linalg.norm(steps, axis=2, keepdims=True), 1e-9)
    along, alike = (steps @ profile[..., None])[..., 0], steps @ steps.transpose(0, 2, 1)
    both = along[:, :, None] ** 2 + along[:, None] ** 2
    both -= 2 * alike * along[:, :, None] * along[:, None]
    of_two = (both / np.maximum(1 - alike**2, 1e-3)).max(axis=(1, 2)) / total
    of_ink = (ink * profile).sum(axis=1) ** 2 / np.maximum((ink**2).sum(axis=1), 1e-12) / total
    return np.log(np.maximum(1 - of_two, 1e-6) / np.maximum(1 - of_ink, 1e-6))
