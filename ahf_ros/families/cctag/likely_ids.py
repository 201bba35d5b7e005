"""The likeliest IDs of targets, by the mean profiles of their rays."""

from __future__ import annotations

import numpy as np

from ahf_ros.families.cctag.light import Lights, lit
from ahf_ros.families.cctag.prior import Prior
from ahf_ros.families.cctag.rays import PROFILE, RAYS
from ahf_ros.families.cctag.rings import Likely
from ahf_ros.families.cctag.templates import (
    SIZE_STEP,
    by_value,
    less_lines,
    shares_of,
    size_steps,
    templates,
    two_discs,
)
from ahf_ros.prints.cctag import CctagPrint
from ahf_ros.vision import frame

_SCALES = np.linspace(0.93, 1.07, 9)  # of the radius, about a frame
_WIDE = np.linspace(PROFILE[0] * _SCALES[0], PROFILE[-1] * _SCALES[-1], 80)
"""Radii at which rays are read once for all scales."""
_RESAMPLED = np.maximum(
    1 - np.abs(np.outer(_SCALES, PROFILE)[:, None] - _WIDE[:, None]) / (_WIDE[1] - _WIDE[0]), 0
).astype(np.float32)
"""What interpolates rays at the radii of each scale, (scales, radii, n)."""
_PART = 48  # targets at a time, which bounds the memory
_LIKE_DISCS = 12.0  # px: two discs leave less than rings of so many px, by a factor of e at most
_READINGS = 5  # IDs that are brought onto the image from a frame


def likely_ids(
    gray: np.ndarray,
    lights: Lights,
    polarity: int,
    family: CctagPrint,
    prior: Prior,
    count: int = _READINGS,
) -> Likely:
    """Return so many IDs that the mean profiles about targets are like, and one more."""
    frames = lights.moved
    shape = len(_SCALES), len(frames), len(family.numbers)
    each = np.tile(np.arange(len(frames)), len(_SCALES))
    scaled = frame.scaled(frames[each], np.repeat(_SCALES, len(frames)))
    profiles, clipped = _mean_profiles(gray, lights)
    profiles = less_lines(polarity * profiles.reshape(-1, len(PROFILE)))
    shares, edges = np.empty(shape), np.empty((*shape, 3))
    of_each, edges_of_each = (of.reshape(len(each), *of.shape[2:]) for of in (shares, edges))
    for step, of_size in by_value(size_steps(frame.mean_radii(scaled))):
        for of in (0, 1):
            some = of_size[clipped[each[of_size]] == of]
            if not len(some):
                continue
            edges_tried = prior.tried(polarity * of, family.narrow * SIZE_STEP**step)
            of_rings, tried = templates(family, step, edges_tried)
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
    starts = scaled[scale * len(frames) + rows]
    return Likely(starts, order, found, shares[scale, rows, order], rings)


def _mean_profiles(gray: np.ndarray, lights: Lights) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean profiles of rays in light at all scales, and whether many are clipped.

    The shapes are (scales, k, n) and (k,). Rays are read once, and interpolated at each scale.
    """
    count, scales = len(lights.frames), len(_SCALES)
    profiles = np.empty((scales, count, len(PROFILE)), np.float32)
    clipped = np.zeros(count, bool)
    for start in range(0, count, _PART):
        rows = np.arange(start, min(start + _PART, count))
        part = lights.select(rows)
        seen = lit(gray, part.moved, part, RAYS, _WIDE)
        clipped[rows] = seen.apart > 0
        # A ray is seen in its own light, which is its mean up to the end of the profile.
        own = seen.values @ _RESAMPLED.mean(axis=2).T
        weight = np.float32(1 / RAYS) / np.maximum(own, np.float32(1e-3))
        profiles[:, rows] = (weight.swapaxes(1, 2) @ seen.values).swapaxes(0, 1) @ _RESAMPLED
    return profiles, clipped


def _unlike_discs(profiles: np.ndarray, shares: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Return whether rings explain shares of profiles, (k,), that two discs do not explain."""
    of_two = np.empty(len(shares))
    for step, of_size in by_value(size_steps(frame.mean_radii(frames))):
        of_two[of_size] = two_discs(profiles[of_size], step)
    left_by_two, left = (np.maximum(1 - of, 1e-6) for of in (of_two, shares))
    return np.asarray(np.log(left_by_two / left) >= -_LIKE_DISCS / frame.mean_radii(frames))
