"""What is known of the edges of an image before a CCTag is read, and what IDs cost by it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from ahf_ros.families.cctag.rays import PROFILE
from ahf_ros.families.cctag.rings import Aligned, Likely
from ahf_ros.families.cctag.templates import CLIPPED, DEFOCUSED, Edge
from ahf_ros.families.words import against
from ahf_ros.vision.robust import NORMAL

_TRIED_SHIFTS = -1.2, -0.6, 0.0, 0.6, 1.2  # deviations
_TRIED_BLURS, _TRIED_SHARPENINGS = (-1.0, 0.0, 1.4), (3.0, 7.0)  # the same
_SOFTER = 1.6  # ratio of blurs that are tried of rings out of focus
_ENOUGH = 4  # certain targets, that tell of the edges of an image
_OF_CAMERA = 0.03  # standard deviation of the sharpening of one camera
_OF_IMAGE = 0.1  # of growth, ln of the blur and sharpening, of an image's targets
_INDEPENDENT = 0.3  # distance of independent readings along a profile, px
_AT_BEST = 0.4  # share of what an ID leaves of a mean profile, that is left where it is aligned


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

    def least_cost(self, first: Aligned, likely: Likely, size: np.ndarray) -> np.ndarray:
        """Return what IDs that are not aligned cost at the least, (k, n).

        What the first of them leaves of each ray is noise, which the others leave as well.
        """
        noise = np.exp(first.left)[:, None]
        left = noise + (1 - noise) * _AT_BEST * (1 - likely.shares)
        independent = (size * np.ptp(PROFILE) / _INDEPENDENT * first.known)[:, None]
        cost = independent * np.log(left) / 2 + against(likely.ids, self.expected)
        return np.asarray(cost)

    def away(self, shift: np.ndarray, blur: np.ndarray, sharpening: np.ndarray) -> np.ndarray:
        """Return how far edges are from what is known, in the units of deviations, (k, 3)."""
        return np.stack(
            [shift - self.shift, np.log(blur / self.blur), sharpening - self.sharpening], axis=1
        )

    @lru_cache(maxsize=256)  # noqa: B019, as a prior is a few numbers
    def tried(self, polarity: int, narrow: float) -> tuple[Edge, ...]:
        """Return the edges of templates, for narrow rings of so many px.

        They include those out of focus, and clipped ones unless the polarity is 0.
        """
        of_shift, of_blur, of_sharpening = self.deviations
        tried = list(product(_TRIED_SHIFTS, _TRIED_BLURS, [(0.0, 0.0)]))
        others = [(more, 0.0) for more in _TRIED_SHARPENINGS]
        others += [(0.0, polarity * of) for of in CLIPPED if polarity]
        tried += list(product(_TRIED_SHIFTS[::2], [0.0], others))
        edges = [
            (
                round(self.shift + shift * of_shift, 2),
                round(self.blur * math.exp(blur * of_blur), 2),
                round(self.sharpening + more * of_sharpening, 2),
                clipped,
            )
            for shift, blur, (more, clipped) in tried
        ]
        blur = max(blur for _, blur, *_ in edges)
        while blur < DEFOCUSED * narrow:
            blur *= _SOFTER
            edges.append((self.shift, round(blur, 2), 0.0, 0.0))
        return tuple(edges)

    def sharpening_of(self, rings: Aligned) -> np.ndarray:
        """Return the sharpening of rings (k,), or that of the camera if it is known."""
        known = _OF_CAMERA / self.deviations[2]
        return np.asarray(known * self.sharpening + (1 - known) * rings.sharpening)

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
        variance = (count * spread**2 + _ENOUGH * _OF_IMAGE**2) / (count + _ENOUGH)
        shift, blur, sharpening = usual.tolist()
        of_shift, of_blur, of_sharpening = np.sqrt(variance).tolist()
        deviations = of_shift, of_blur, of_sharpening
        return Prior(shift, math.exp(blur), sharpening, deviations, self.expected)


USUAL = Prior()
"""What is known without any target."""
