"""Polar images of targets: gray values on circles about their dots, and how their ink looks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ahf_ros import kernels
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.black import AS_IT_IS, BLACK, PRINTED, black_lift, lifted
from ahf_ros.vision.circle_fit import Fit
from ahf_ros.vision.image import SATURATED
from ahf_ros.vision.logarithm import LOG_OFFSET
from ahf_ros.vision.noise import reading_noise
from ahf_ros.vision.normal import normal_integral
from ahf_ros.vision.profiles import USUAL_BLUR
from ahf_ros.vision.robust import NORMAL, medians

CORRELATION = 2.5
"""Distance of independent readings, px."""

LIGHT_EDGE = 0.3
"""Step of ln I from which it is an edge of light."""

DOT, GAP, MARGIN = np.array([0.3, 0.6]), np.array([0.35, 0.65]), np.array([0.3, 0.65])
"""Where levels are read: dot radii, shares of the gap, and dot radii beyond the band."""

DEPTHS = np.array([0.2, 0.4, 0.6, 0.8])
"""The same in the band, shares of it."""

PART = 256
"""Targets at a time, which bounds the memory."""

SOFT_EDGE = 1.6
"""Distance from an edge at which it ends, in its blur."""

INNERMOST = 0.3
"""Radius of the first circle, dot radii."""

CIRCLES = 56
"""Of a polar image, which are then less than a tenth of a dot radius apart."""

_MARGIN = 0.95  # of the last circle beyond the band, dot radii
_LEVELS = np.array([0.75, 1.4])  # where those of dot and gap are read, radii of the dot as seen
_MINIMUM_SHARE = 0.3  # of ink that a level tells, between those of dot and gap
_NARROW = 4.5  # width of a gap that blur fills, in deviations of it
_MINIMUM_LEVEL = 1.0  # gray value that ratios are taken of
_NOISE = (1.2, 40.0)  # smallest and largest noise, gray values
_EVEN = 0.015  # deviation of ln of ground in even light
_UNLIKE = 4.0  # standard deviations of ground, from which a level is unlike the rest
_LIGHT = 0.34  # share of the ground that differs, or has edges, from which that is light
_GLARE_EDGES = 0.03  # share of the ground, more than edges of glare have
_PLACES = 3  # of a circle that something covers of dark ground, at most; spots light up more
_UNEVEN = 1.5  # ratio of the light on two tenths of the ground, the darkest and the brightest
_PARTS, _READINGS = 20, 7  # of the ground about a target, and of each on a circle
_WHITE_OUT = 0.6  # share of the ground that is saturated, from which that is no glare
_ASIDE = 0.15  # least distance from the band at which its ground may end, dot radii
_TURN = 15  # between squares that are tried, degrees
_SQUARE = 0.7  # weight of a square, which has an angle that suits stripes, where a disc has 1
_WHITE = 0.5  # share of the step of ink, in ln, from which what ends the ground is white
_NO_GLARE = 256.0  # more than any gray value


@dataclass(frozen=True, slots=True)
class PolarImages(ArrayRecord):
    """Gray values about k dots, at m angles on n circles, and how dots and marks look.

    Attributes
    ----------
    gray : ndarray of float32, shape (i, n, m)
        Of i images, circle by circle; black is lifted, see `ahf_ros.vision.black`.
    row : ndarray of int, shape (k,)
        Which of these images is that of a dot.
    reach : ndarray of float64, shape (k, m)
        Up to which radius the image shows the target and its ground at an angle, dot radii.
    outermost : ndarray of float64, shape (k,)
        Radius of the last circle, dot radii.
    polarity : ndarray of int, shape (k,)
        1 where marks are dark, -1 where they are bright.
    contrast : ndarray of float64, shape (k,)
        Gray value of dark over bright under the same light.
    lift : ndarray of float64, shape (k,)
        Gray values that black is lifted to.
    size : ndarray of float64, shape (k,)
        Radius of the dot, px.
    blur : ndarray of float64, shape (k,)
        Of edges, standard deviation in px.
    noise : ndarray of float64, shape (k,)
        Of gray values.
    plate : ndarray of float64, shape (k, m)
        Radius at which dark ground ends on white paper at an angle, dot radii; infinite where it
        does not.
    shade, glare : ndarray of float32, shape (k,)
        Gray values of ground up to which something covers it, of dark ground from which on, and
        from which glare lies on it; infinite where white is paper.
    brightest : ndarray of float64, shape (k,)
        Gray value of the bright dot, which is that of its ink in full light, where black ground is
        left as it is: noise hides in it how much light there is. 0 elsewhere.
    """

    gray: np.ndarray
    row: np.ndarray
    reach: np.ndarray
    outermost: np.ndarray
    polarity: np.ndarray
    contrast: np.ndarray
    lift: np.ndarray
    size: np.ndarray
    blur: np.ndarray
    noise: np.ndarray
    plate: np.ndarray
    shade: np.ndarray
    glare: np.ndarray
    brightest: np.ndarray

    @property
    def radii(self) -> np.ndarray:
        """Radii of the circles, dot radii, shape (k, n)."""
        return np.linspace(INNERMOST, self.outermost, self.gray.shape[1], axis=1)

    def select(self, which: np.ndarray | slice) -> PolarImages:
        """Return some of the dots; their images are those of all, which are not copied."""
        whole = replace(self, gray=self.row)
        return replace(ArrayRecord.select(whole, which), gray=self.gray)

    def rim(self, outer: float) -> np.ndarray:
        """Return up to which radii a plate is dark, and from which paper is white, (k, 2, m).

        Between them blur mixes both. At the `outer` radius of the band nothing of it is white.
        """
        aside = (SOFT_EDGE * self.blur / self.size)[:, None]
        inside = np.maximum(self.plate - aside, outer)
        return np.stack([inside, self.plate + aside / 2], axis=1)

    def at(self, radii: np.ndarray) -> np.ndarray:
        """Return gray values at radii (k, r), dot radii, at all angles, (k, r, m)."""
        return kernels.gray_at(self.gray, self.row, INNERMOST, self.outermost, radii)

    def inked(self, paper: np.ndarray, seen: np.ndarray) -> np.ndarray:
        """Return the gray values of ink of the dot's colour where paper has some, (k, ...).

        Ink that would be brighter than white is as bright as what is `seen` if that is white.
        """
        polarity, contrast = (
            _along(of, paper).astype(np.float32) for of in (self.polarity, self.contrast)
        )
        one = np.float32(1)
        ink = paper * np.where(polarity > 0, contrast, one)
        ink /= np.where(polarity > 0, one, contrast)
        white = (seen >= SATURATED) & (polarity < 0)
        return np.where(white, np.minimum(ink, seen), ink) if white.any() else ink

    def printed(self, paper: np.ndarray, share: np.ndarray, seen: np.ndarray) -> np.ndarray:
        """Return the gray values of paper of which a share is ink."""
        return paper + share * (self.inked(paper, seen) - paper)

    def paper(self, seen: np.ndarray, share: np.ndarray) -> np.ndarray:
        """Return the gray values of bare paper, of which a share is ink where it is `seen`."""
        dark = self.polarity > 0
        ink = _along(np.where(dark, self.contrast, 1 / self.contrast), seen).astype(np.float32)
        return np.asarray(seen / (1 + share * (ink - 1)))

    def logs(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return ln(I + offset) of gray values (k, ...), and the deviation of its noise."""
        raised = np.maximum(values, 0) + np.float32(LOG_OFFSET)
        return np.log(raised), _along(self.noise, values).astype(np.float32) / raised

    @staticmethod
    def levels(values: np.ndarray) -> np.ndarray:
        """Return ln(I + offset) of gray values."""
        return np.asarray(np.log(np.maximum(values, 0) + np.float32(LOG_OFFSET)))


def polar_images(
    gray: np.ndarray,
    dots: Fit,
    band: tuple[float, float],
    count: int,
    circles: int = CIRCLES,
    ratio: np.ndarray | float | None = None,
    *,
    covers: bool = False,
) -> PolarImages:
    """Return the polar images of targets at some angles, see `angles_of`, on some circles.

    Black is lifted to a `ratio` of ink and paper, see `black_lift`, which is `lift_ratio` if none
    is given. What is brighter than dark ground is mostly light, as spots lie between others;
    whether it `covers` the ground is asked.
    """
    inner, outer = band
    outermost = outer + _MARGIN
    radii = np.linspace(INNERMOST, outermost, circles)
    ratio = lift_ratio(gray, dots, band) if ratio is None else ratio
    contrast, lift = _appearance(gray, dots, band, ratio)
    values, reach = on_circles(gray, dots.frames, angles_of(count), radii, lift)
    ground = values[:, [np.abs(radii - place).argmin() for place in _on_ground(band)]]
    apart = 2 * np.pi * inner * dots.size / count
    noise = np.clip(reading_noise(gray, dots.frames, outermost), *_NOISE)
    levels = ground, _later(ground, apart), noise, dots.polarity
    shade, glare = _usual_levels(*levels, covers=covers)
    return PolarImages(
        gray=values,
        row=np.arange(len(values)),
        reach=reach,
        outermost=np.full(len(values), outermost),
        polarity=dots.polarity,
        contrast=contrast,
        lift=lift,
        size=dots.size,
        blur=dots.blur,
        noise=noise,
        plate=np.full((len(values), count), np.inf),
        shade=shade,
        glare=glare,
        brightest=np.where((dots.polarity < 0) & np.equal(ratio, AS_IT_IS), dots.bright, 0.0),
    )


def angles_of(count: int) -> np.ndarray:
    """Return the angles at which bands are read, counter-clockwise as seen, rad, (count,)."""
    return -2 * np.pi * (np.arange(count) + 0.5) / count


def on_circles(
    gray: np.ndarray, frames: np.ndarray, angles: np.ndarray, radii: np.ndarray, lift: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return gray values on circles about targets, whose black is lifted, (k, n, m).

    With them comes up to which of the radii, ascending, shape (n,) or (k, n), an image shows
    targets at angles, (k, m).
    """
    directions = np.array([np.cos(angles), np.sin(angles)])
    radii = np.broadcast_to(radii, (len(frames), radii.shape[-1]))
    return kernels.circle_values(gray, frames, directions, radii, lift.astype(np.float32))


def _appearance(
    gray: np.ndarray, dots: Fit, band: tuple[float, float], ratio: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray]:
    """Return contrasts of dots, and gray values that black is to be lifted to, shape (k,) each.

    The contrast is that of the dot's edge. Where a camera sharpens, that edge is darker than marks
    are. The levels beside the edge, without what blur mixes there, then tell more, but only up to
    the usual contrast of prints, because light may change between. Where blur fills the gap, the
    ground beyond the band tells it.
    """
    angles = 2 * np.pi * np.arange(24) / 24
    inner, outer = band
    radius = 1 + dots.polarity * dots.edge_shift / dots.size
    beside = radius[:, None] * _LEVELS
    ground = np.broadcast_to(outer + MARGIN, (len(radius), len(MARGIN)))
    at = angles, np.hstack([beside, ground]), np.zeros(len(radius))
    values, _ = on_circles(gray, dots.frames, *at)
    inside, outside, *beyond = np.maximum(values, _MINIMUM_LEVEL).swapaxes(0, 1)
    deep, near = normal_integral((radius[:, None] - beside) * (dots.size / dots.blur)[:, None]).T
    by_levels, bare = (
        _unmixed(medians(inside / of), deep, share) ** dots.polarity
        for of, share in ((outside, near), (np.mean(beyond, axis=0), 0.0))
    )
    contrast = np.maximum(dots.contrast, np.minimum(by_levels, PRINTED))
    narrow = (inner - 1) * dots.size < _NARROW * np.maximum(dots.blur, USUAL_BLUR)
    contrast = np.where(narrow, np.minimum(contrast, np.maximum(bare, PRINTED)), contrast)
    lift = black_lift(contrast, dots.bright, ratio)
    dark, bright = (lifted(of, lift) for of in (contrast * dots.bright, dots.bright))
    return np.maximum(dark, _MINIMUM_LEVEL) / np.maximum(bright, _MINIMUM_LEVEL), lift


def _unmixed(ratio: np.ndarray, first: np.ndarray, second: np.ndarray | float) -> np.ndarray:
    """Return ink over paper, from the ratio of levels of which blur makes shares ink, (k,)."""
    ink = 1 + (ratio - 1) / np.maximum(first - second * ratio, _MINIMUM_SHARE)
    return np.asarray(np.maximum(ink, 1 / SATURATED))


def _on_ground(band: tuple[float, float]) -> np.ndarray:
    """Return the radii at which levels are read on the ground beside a band, dot radii."""
    inner, outer = band
    return np.append(1 + (inner - 1) * GAP, outer + MARGIN)


def lift_ratio(gray: np.ndarray, dots: Fit, band: tuple[float, float]) -> np.ndarray:
    """Return the ratios of ink and paper to which black is lifted, shape (k,).

    Black marks stay as they are in uneven light. Ground that is black may be uneven by sharpening.
    """
    ratio = np.full(len(dots.frames), PRINTED)
    marks = np.flatnonzero((dots.polarity > 0) & (dots.contrast < BLACK))
    if marks.size:
        ratio[marks[in_uneven_light(gray, dots.frames[marks], band)]] = AS_IT_IS
    return ratio


def in_uneven_light(gray: np.ndarray, frames: np.ndarray, band: tuple[float, float]) -> np.ndarray:
    """Return whether shadows or patterns lie on the ground of targets, (k, 3, 3), bool, (k,)."""
    radii, angles = _on_ground(band), angles_of(_PARTS * _READINGS)
    values, _ = on_circles(gray, frames, angles, radii, np.zeros(len(frames)))
    parts = values.reshape(len(frames), len(radii), _PARTS, _READINGS).mean(axis=(1, 3))
    low, high = np.quantile(np.maximum(parts, 0) + LOG_OFFSET, [0.1, 0.9], axis=1)
    return np.asarray(high > _UNEVEN * low)


def _later(ground: np.ndarray, apart: np.ndarray) -> np.ndarray:
    """Return the readings at angles that are far enough from those of readings (k, 4, m)."""
    count = ground.shape[2]
    lags = np.clip(np.ceil(CORRELATION / np.maximum(apart, 1e-9)), 1, count // 4).astype(np.intp)
    later = (np.arange(count) + lags[:, None]) % count
    return np.asarray(np.take_along_axis(ground, later[:, None], axis=2))


def _usual_levels(
    ground: np.ndarray,
    later: np.ndarray,
    noise: np.ndarray,
    polarity: np.ndarray,
    *,
    covers: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """Return `PolarImages.shade` and `glare` of ground (k, 4, m), shape (k,) each.

    A small part of white ground that is darker is covered. So is, if that is asked, one of dark
    ground that is brighter, unless it lies in many places about the target, as spots of light do,
    or has soft borders or is blown out, as glare has and is. Darker parts of dark ground lie
    beside bright marks, where cameras sharpen. White ground that is brighter, has soft borders
    and leaves much of a target as it is, is under glare. All else is light.
    """
    logs, of_later = (np.log(of + np.float32(LOG_OFFSET)) for of in (ground, later))
    values = logs.reshape(len(logs), logs.shape[1] * logs.shape[2])
    usual = medians(values)
    spread = medians(np.abs(values - usual[:, None])) * NORMAL
    width = _UNLIKE * np.maximum(np.maximum(spread, _EVEN), noise / np.exp(usual))
    aside = (logs - usual[:, None, None]) * polarity[:, None, None] < -width[:, None, None]
    other = (aside[:, ::2] | aside[:, 1::2]).mean(axis=(1, 2))
    across, along = logs[:, 1::2] - logs[:, ::2], (of_later - logs)[:, ::2]
    edges = (np.maximum(np.abs(across), np.abs(along)) > LIGHT_EDGE).mean(axis=(1, 2))
    soft, dark = edges <= _GLARE_EDGES, polarity > 0
    blown = (aside & (ground >= SATURATED)).any(axis=(1, 2))
    outermost = aside[:, -1]
    spots = (outermost & ~np.roll(outermost, 1, axis=1)).sum(axis=1) > _PLACES
    light = (other > _LIGHT) | (edges > _LIGHT) | ~(dark | (covers & ~soft & ~blown & ~spots))
    nothing = np.where(dark, 0.0, np.inf)
    shade = np.where(light, nothing, np.exp(usual - polarity * width) - LOG_OFFSET)
    white = (ground >= SATURATED).mean(axis=(1, 2))
    glare = np.minimum(np.exp(usual + width) - LOG_OFFSET, SATURATED)
    glare = np.where(soft, glare, _NO_GLARE)
    glare = np.where(white > _WHITE_OUT, np.inf, glare)
    return shade.astype(np.float32), glare.astype(np.float32)


def on_dark_ground(
    polar: PolarImages, band: tuple[float, float], which: np.ndarray | bool = True
) -> PolarImages:
    """Return polar images that say where the dark ground about some bright targets ends.

    What is brighter than the gap by as much as ink is, in most directions, is white paper: the
    ground was a disc or a square, turned anyhow, that is little larger than the band. Light may
    change between two places, but not in most directions to the same side.
    """
    inner, outer = band
    bright = np.flatnonzero((polar.polarity < 0) & which)
    if not bright.size:
        return polar
    some = polar.select(bright)
    gap = some.at(np.tile(1 + (inner - 1) * GAP, (len(bright), 1))).mean(axis=1)
    aside = np.maximum(SOFT_EDGE * some.blur / some.size, _ASIDE)
    step = np.exp(-_WHITE * np.log(some.contrast))[:, None].astype(np.float32)
    white = (np.maximum(gap, 0) + np.float32(LOG_OFFSET)) * step - np.float32(LOG_OFFSET)
    ends, beyond, weight = _outlines(*some.gray.shape[:0:-1], outer)
    votes, outermost, _ = kernels.ground_votes(
        some.gray, some.row, white, some.radii, outer + aside, beyond
    )
    ended = outermost > 0
    if not ended.any():
        return polar
    plate = polar.plate.copy()
    plate[bright[ended]] = ends[(votes[ended] * weight).argmax(axis=1)]
    return replace(polar, plate=plate)


@lru_cache(maxsize=16)
def _outlines(count: int, circles: int, outer: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return radii of discs and squares at some angles, (shapes, m), largest first.

    Then comes how many circles lie beyond, and what votes for a shape weigh.
    """
    radii = np.linspace(INNERMOST, outer + _MARGIN, circles)
    sizes = radii[radii > outer][::-1]
    turns = np.append(np.arange(0, 90, _TURN), np.nan)
    across = np.deg2rad((np.rad2deg(angles_of(count)) - turns[:, None] + 45) % 90 - 45)
    ends = sizes[:, None, None] / np.nan_to_num(np.cos(across), nan=1.0)
    ends = ends.reshape(-1, count)
    beyond = circles - np.searchsorted(radii, ends - 1e-9)
    weight = np.tile(np.where(np.isnan(turns), 1, _SQUARE), len(sizes))
    return np.where(beyond > 0, ends, np.inf), beyond, weight


def _along(of_targets: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return values of targets, shape (k,), with the axes of others, shape (k, ...)."""
    return of_targets.reshape(-1, *(1,) * (values.ndim - 1))
