"""The rings of CCTags and the light on them, fitted to pixels together.

Rays know the light before the rings, and divide by it what the lens has mixed, which costs half of
the precision where targets are small, and doubts. Here the frame, the edges of the print and those
of light are fitted to the pixels at once, for the place of targets and for doubtful IDs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from operator import itemgetter

import numpy as np

from ahf_ros.families.cctag.alignment import align
from ahf_ros.families.cctag.fit import Fit, Usual, fitted
from ahf_ros.families.cctag.light import EDGES, Lights
from ahf_ros.families.cctag.likely_ids import likely_ids
from ahf_ros.families.cctag.patch import Patch
from ahf_ros.families.cctag.prior import Prior
from ahf_ros.families.cctag.rays import FEW_RAYS
from ahf_ros.families.cctag.rings import Aligned
from ahf_ros.families.cctag.templates import MAXIMUM_SHIFT, signed_circles
from ahf_ros.prints import CCTAG_NAMES
from ahf_ros.prints.cctag import CctagPrint, circle_family
from ahf_ros.vision import frame
from ahf_ros.vision.image import GAMMA, as_light

_LARGEST = 32.0  # px: rays place the rings of larger targets as well, and much faster
_TELLING = 12  # targets that tell what is usual
_FEWEST = 60  # pixels that are fitted
_UNUSUAL = 2.0  # deviations of a misfit, from which other light and other IDs are tried
_MOST_UNUSUAL = 5.0  # the same, up to which the place is that of the rings
_CERTAIN, _ENOUGH = 0.98, 4  # confidence of targets that tell of doubtful ones, and their number
_POSSIBLE = 0.05  # probability of a target, from which it is placed
_RIVALS = 6  # IDs that rays may show
_ODDS, _LESS = 6.0, 2.0  # ln of the odds of a target that is usual, less by each deviation
_BEYOND_DOUBT = 200.0  # cost more than the likeliest ID's, of one that is not fitted to the end
_OF_MARGIN = 0.1  # share of ln of the odds of IDs, by pixels, that is believed


def jointly(gray: np.ndarray, light: np.ndarray, rings: Aligned, family: CctagPrint) -> Aligned:
    """Return rings (k,) that are in place to a part of a px, with places that pixels give.

    They are in place in an image of light, which may be that of gray values.
    Large ones, and those that the model does not explain as well as others, stay as they are.
    """
    small = np.flatnonzero(_small(rings))
    if not len(small):
        return rings
    own = rings.select(small)
    scene = _Scene.of(gray, light, own, np.arange(len(own.ids)), family)
    for row, fit in scene.fits(own).items():
        placed = scene.placed(own.select(slice(row, row + 1)), fit)
        rings = rings.replaced(small[row : row + 1], placed)
    return rings


def contested(
    gray: np.ndarray, light: np.ndarray, rings: Aligned, polarity: int, family: CctagPrint
) -> Aligned:
    """Return readings (k,) with the places that pixels give; what is in doubt is as pixels show.

    They are of an image of light, which may be that of gray values. Doubts need enough certain
    targets, which tell how well rings are seen in this image.
    """
    enough = (_small(rings) & (rings.confidence >= _CERTAIN)).sum() >= _ENOUGH
    which = np.flatnonzero(_small(rings) & (rings.of_target >= _POSSIBLE))
    if not len(which):
        return rings
    own = rings.select(which)
    certain = own.confidence >= _CERTAIN
    telling = np.flatnonzero(certain | np.logical_not(enough))
    scene = _Scene.of(gray, light, own, telling, family)
    for row, fit in scene.fits(own).items():
        reading = own.select(slice(row, row + 1))
        unusual = scene.usual.unusual(fit)
        if enough and not (certain[row] and unusual <= _UNUSUAL):
            if unusual > _UNUSUAL or reading.of_id[0] < _CERTAIN:
                reading, fit = scene.likeliest(reading, polarity, fit)
            reading = replace(reading, by_pixels=scene.odds(fit))
        rings = rings.replaced(which[row : row + 1], scene.placed(reading, fit))
    return rings


def _small(rings: Aligned) -> np.ndarray:
    return frame.ellipse_axes(rings.frames)[0] <= _LARGEST


@dataclass(frozen=True, slots=True)
class _Scene:
    """An image, its light, and what is known of its targets."""

    gray: np.ndarray
    light: np.ndarray  # of the gray values, whose gamma is the next
    gamma: float
    family: CctagPrint
    usual: Usual = field(default_factory=Usual)
    begun: dict[int, Fit] = field(default_factory=dict)  # of some targets, by their rows

    @staticmethod
    def of(
        gray: np.ndarray, light: np.ndarray, rings: Aligned, rows: np.ndarray, family: CctagPrint
    ) -> _Scene:
        """Return an image with what the likeliest of the targets in rows tell, gamma with it.

        Rays show clearly that gray values have a gamma, and less clearly that they have none.
        """
        rows = rows[np.argsort(-rings.plain[rows], kind='stable')[:_TELLING]]
        telling = rings.select(rows)
        if light is not gray:
            return _Scene(gray, light, GAMMA, family)._told(telling, rows)[0]
        linear = _Scene(gray, gray, 1.0, family)._told(telling, rows)
        light, known = as_light(gray), (telling.frames, telling.ids, telling.edges, family)
        telling = align(light, *known, rays=FEW_RAYS)
        others = _Scene(gray, light, GAMMA, family)._told(telling, rows)
        return min(linear, others, key=itemgetter(1))[0]

    def fits(self, rings: Aligned) -> dict[int, Fit]:
        """Return what forms the pixels of targets, by their rows, where enough are known.

        Where the pixels are unlike what is usual, light of fewer edges is tried.
        """
        rings = replace(rings, sharpening=self.usual.camera.sharpening_of(rings))
        worse = self.usual.unusual
        fits = {row: fitted(it.patch, it.formed, self.usual) for row, it in self.begun.items()}
        for most in range(EDGES, 0, -1):
            every = range(len(rings.ids))
            rows = [row for row in every if row not in fits or worse(fits[row]) > _UNUSUAL]
            for index, fit in self._fits(rings.select(np.array(rows, int)), most):
                row = rows[index]
                if row not in fits or worse(fit) < worse(fits[row]):
                    fits[row] = fit
        return fits

    def _fits(self, rings: Aligned, most: int) -> Iterator[tuple[int, Fit]]:
        """Yield fits of targets in light of so many edges, by their rows."""
        lights = Lights.about(self.light, rings.frames, most)
        most_shift = MAXIMUM_SHIFT * self.family.narrow
        for row, circles in enumerate(signed_circles(self.family, rings.ids)):
            only = slice(row, row + 1)
            own, light = rings.select(only), lights.select(only)
            patch = Patch.about(self.gray, own, circles, light, self.gamma, most_shift)
            if len(patch.seen) > _FEWEST:
                formed = patch.first(own, light, self.usual.contrast)
                yield row, fitted(patch, formed, self.usual)

    def placed(self, rings: Aligned, fit: Fit) -> Aligned:
        """Return the rings of a target, (1,), where a good fit is."""
        if self.usual.unusual(fit) > _MOST_UNUSUAL:
            return rings
        return replace(
            rings,
            frames=fit.formed.frame[None],
            covariance=fit.of_centre[None],
            shift=np.array([fit.formed.shift]),
            blur=np.array([fit.formed.blur_of_rays]),
        )

    def odds(self, fit: Fit) -> np.ndarray:
        """Return ln of the odds that a fit is of a target, (1,)."""
        odds = _ODDS - _LESS * max(self.usual.unusual(fit), 0.0)
        return np.array([max(odds, -_ODDS)])

    def likeliest(self, rings: Aligned, polarity: int, fit: Fit) -> tuple[Aligned, Fit]:
        """Return the reading of a target, (1,), that pixels show, and its fit.

        Of IDs that rays may show, and those that differ in one ring or in all, the likeliest is
        taken. That is repeated for this one until it stays. IDs of other families are rivals.
        """
        lights = Lights.about(self.light, rings.frames)
        fits = {int(rings.ids[0]): fit} | self._rivals(rings, lights, polarity, fit)
        every = len(self.family.numbers) - 1
        while True:
            best = min(fits, key=lambda it: fits[it].cost)
            most = fits[best].cost + _BEYOND_DOUBT
            flips = [1 << bit for bit in range(every.bit_length())]
            others = [best ^ flip for flip in (*flips, every) if best ^ flip not in fits]
            if not others:
                break
            circles = signed_circles(self.family, np.array(others))
            for other, of in zip(others, circles, strict=True):
                patch = replace(fit.patch, circles=of)
                fits[other] = fitted(patch, fits[best].formed, self.usual, most)
        fit = fits.pop(best)
        rivals = list(fits.values())
        for name in CCTAG_NAMES:
            if name != self.family.name:
                scene = replace(self, family=circle_family(name))
                rivals += scene._rivals(rings, lights, polarity, fit).values()
        margin = min(rival.cost for rival in rivals) - fit.cost
        reading = replace(rings, ids=np.array([best]), margin=np.array([_OF_MARGIN * margin]))
        return reading, fit

    def _rivals(self, rings: Aligned, lights: Lights, polarity: int, fit: Fit) -> dict[int, Fit]:
        """Return fits of a target, (1,), by the IDs that rays may show besides in its lights."""
        known = polarity, self.family, self.usual.camera
        likely = likely_ids(self.light, lights, *known, _RIVALS)
        numbers, first = np.unique(likely.ids[0], return_index=True)
        larger = frame.mean_radii(likely.starts[0, first]) / frame.mean_radii(rings.frames)
        begun = frame.scaled(np.repeat(fit.formed.frame[None], len(first), axis=0), larger)
        circles = signed_circles(self.family, numbers)
        most = fit.cost + _BEYOND_DOUBT
        return {
            number: fitted(
                *(replace(fit.patch, circles=of), replace(fit.formed, frame=start)),
                *(self.usual, most),
            )
            for number, of, start in zip(numbers.tolist(), circles, begun, strict=True)
        }

    def _told(self, telling: Aligned, rows: np.ndarray) -> tuple[_Scene, float]:
        """Return what targets tell, those in rows, and the usual error of gray values."""
        usual = replace(self.usual, camera=Prior().of_camera(telling))
        scene = replace(self, usual=usual)
        fits = scene.fits(telling)
        if not fits:
            return scene, math.inf
        errors = np.abs(np.concatenate([of.errors for of in fits.values()]))
        begun = {int(rows[row]): fit for row, fit in fits.items()}
        scene = replace(scene, usual=usual.after(list(fits.values())), begun=begun)
        return scene, float(np.median(errors))
