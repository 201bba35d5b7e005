"""The best reading of targets about circles that may be their outermost ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ahf_ros.families.cctag.alignment import align
from ahf_ros.families.cctag.light import EDGES, Lights, lit
from ahf_ros.families.cctag.likely_ids import likely_ids
from ahf_ros.families.cctag.prior import USUAL, Prior
from ahf_ros.families.cctag.rays import FEW_RAYS
from ahf_ros.families.cctag.rings import NOTHING, Aligned, Likely
from ahf_ros.families.cctag.templates import less_lines
from ahf_ros.prints.cctag import CctagPrint
from ahf_ros.vision import frame
from ahf_ros.vision.image import as_light

_SHARED = 0.55  # share of the contrast of rays that is the same on all, at the least
_CLEARLY = 0.03  # `left` by which rings must be better explained
_CLEAREST = 16  # targets by which an image is compared with its light
_REPEATS, _STAYING = 6, 0.1  # until the square of a move is a small part of the variance
_HOPELESS = 1e-6, 1e-4  # probabilities of a target, up to which one ID is enough: at first, later
_IN_PLACE = 0.03  # change of a frame, radii, that leaves the light about it as it is
_UNLIKELY = 1e-3  # the same, up to which no place is settled, which hardly changes it
_BEYOND_DOUBT = 8.0  # cost more than that of the likeliest ID, from which no other is tried


def likely_lights(gray: np.ndarray, frames: np.ndarray, most: int = EDGES) -> Lights:
    """Return light of so many edges at the most about frames that show the same all around."""
    lights = Lights.about(gray, frames, most)
    return lights.select(show_the_same(gray, lights))


def show_the_same(gray: np.ndarray, lights: Lights) -> np.ndarray:
    """Return whether most of what rays show in a light is the same on all of them, shape (k,)."""
    values = lit(gray, lights.moved, lights, FEW_RAYS).values
    means, rays = less_lines(values.mean(axis=1)), less_lines(values)
    return np.asarray((means**2).sum(axis=1) >= _SHARED * (rays**2).sum(axis=2).mean(axis=1))


def identify(
    gray: np.ndarray,
    lights: Lights,
    polarity: int,
    family: CctagPrint,
    prior: Prior = USUAL,
    most: int = EDGES,
) -> Aligned:
    """Return the best reading of each target about outermost circles, edges to about a tenth.

    The light about them has so many edges at the most, also where their place is better known.
    """
    likely = likely_ids(gray, lights, polarity, family, prior)
    likely, lights = likely.select(likely.rings), lights.select(likely.rings)
    # The likeliest ID often brings the frame to its place even if it is the wrong one.
    first = align(gray, *likely.first, family, prior, lights, FEW_RAYS)
    possible = first.of_target > _HOPELESS[0]
    if not possible.any():
        return NOTHING
    first, likely = first.select(possible), likely.select(possible)
    lights = lights.select(possible)
    moved = np.flatnonzero(_moved(lights.frames, first.frames))
    if len(moved):
        anew = Lights.about(gray, first.frames[moved], most)
        others = likely_ids(gray, anew, polarity, family, prior)
        again = align(gray, *others.first, family, prior, anew, FEW_RAYS)
        likely = likely.replaced(moved, others).beside(likely)
        first, lights = first.replaced(moved, again), lights.replaced(moved, anew)
    possible = first.of_target > _HOPELESS[1]
    if not possible.any():
        return NOTHING
    likely, lights = likely.select(possible), lights.select(possible)
    best = _likeliest(gray, first.select(possible), likely, lights, polarity, family, prior)
    possible = (best.of_target > _UNLIKELY) & (best.colour == polarity)
    best = _settled(gray, best.select(possible), family, prior, lights.select(possible))
    return best.select(best.colour == polarity)


def _moved(frames: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return whether the light about frames (k, 3, 3) is not that about others, (k,)."""
    size, other = frame.mean_radii(frames), frame.mean_radii(others)
    away = np.hypot(*(frames - others)[:, :2, 2].T)
    return np.asarray(np.maximum(away, np.abs(size - other)) > _IN_PLACE * size)


def _likeliest(
    gray: np.ndarray,
    first: Aligned,
    likely: Likely,
    lights: Lights,
    polarity: int,
    family: CctagPrint,
    prior: Prior,
) -> Aligned:
    """Return the best readings, (k,), of which the first IDs are aligned, with their margins.

    Others are aligned unless their mean profiles leave no doubt that they are worse.
    """
    count, size = len(first.ids), frame.mean_radii(likely.starts[:, 0])
    cost = np.where(likely.repeated, np.inf, prior.least_cost(first, likely, size))
    doubtful = cost < prior.cost(first, size)[:, None] + _BEYOND_DOUBT
    doubtful[:, 0] = False
    rows, columns = np.nonzero(doubtful)
    starts, ids, edges = likely.at(rows, columns)
    others = align(gray, starts, ids, edges, family, prior, lights.select(rows), FEW_RAYS)
    every = Aligned.joined([first, others])
    every = replace(every, left=np.where(every.colour == polarity, every.left, 0.0))
    rows, columns = (
        np.concatenate([of_first, of_others])
        for of_first, of_others in ((np.arange(count), rows), (np.zeros(count, int), columns))
    )
    cost[rows, columns] = prior.cost(every, size[rows])
    index = np.zeros(cost.shape, int)
    index[rows, columns] = np.arange(len(rows))
    best = every.select(index[np.arange(count), cost.argmin(axis=1)])
    least, next_best = np.partition(cost, 1, axis=1)[:, :2].T
    return replace(best, margin=next_best - least)


def _settled(
    gray: np.ndarray, rings: Aligned, family: CctagPrint, prior: Prior, lights: Lights
) -> Aligned:
    """Return rings brought onto the image until they stay; what still moves is as uncertain."""
    moving = np.arange(len(rings.ids))
    for _ in range(_REPEATS if len(moving) else 0):
        some = rings.select(moving)
        light = lights.select(moving)
        known = some.frames, some.ids, some.edges, family, prior, light
        again = align(gray, *known, in_place=True)
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


def in_light(
    gray: np.ndarray, rings: Aligned, family: CctagPrint
) -> tuple[np.ndarray, Aligned, Lights]:
    """Return an image of light, where rings show clearly that its gray values have a gamma.

    Blur mixes light, and not gray values, which matters where rings are narrow. The image is the
    same otherwise. The rings are brought onto it, in the lights that follow.
    """
    order = np.argsort(-rings.plain, kind='stable')
    clearest, others = order[:_CLEAREST], order[_CLEAREST:]
    light, some = as_light(gray), rings.select(clearest)
    lights, again = _in_its_light(light, some, family)
    weight = np.maximum(some.of_target, again.of_target)
    if weight @ (again.left - some.left + _CLEARLY) >= 0:
        light, (lights, again) = gray, _in_its_light(gray, some, family)
    more, rest = _in_its_light(light, rings.select(others), family)
    back = np.argsort(order)
    again = Aligned.joined([again, rest]).select(back)
    return light, again, Lights.joined([lights, more]).select(back)


def _in_its_light(gray: np.ndarray, rings: Aligned, family: CctagPrint) -> tuple[Lights, Aligned]:
    lights = Lights.about(gray, rings.frames)
    known = rings.frames, rings.ids, rings.edges, family
    return lights, align(gray, *known, lights=lights)
