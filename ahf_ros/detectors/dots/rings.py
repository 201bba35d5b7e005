"""Rings of dots that may be targets, in their frames, and which of them are reported.

The edges of disc and border give the frames: circles of three radii separate the image of the
physical centre from the centres of ellipses.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ahf_ros.codes.dots import DotFamily
from ahf_ros.detectors.claims import best_targets
from ahf_ros.detectors.contract import DetectorSettings
from ahf_ros.detectors.dots.confidence import (
    MAXIMUM_SHARE,
    target_features,
    target_probability,
    word_features,
    word_probability,
)
from ahf_ros.detectors.dots.reading import dot_points, read_rings
from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.features.circle_fit import Fit, fit_circles_of_any_blur
from ahf_ros.features.circles import Circles
from ahf_ros.features.dots import Dots
from ahf_ros.features.ellipse_targets import ellipse_fields
from ahf_ros.features.frame import ellipse_axes, mean_radii
from ahf_ros.features.homography import local_frames
from ahf_ros.features.pyramid import ImagePyramid
from ahf_ros.target import UNDECODED, DottedTarget

_RAYS = 40  # round each circle
_REACH = 0.3  # how far from a circle its edge is looked for, radii of the disc: half the border
_MINIMUM_REACH = 1.35  # the same of small discs, px: what a profile needs

FAMILY = 'dots'
"""Name of the family, whichever data file describes it."""

CERTAIN = 0.95
"""Confidence from which a target is reported."""

_PART = 512  # discs fitted at a time, which bounds the memory
_PLAUSIBLE = 0.4  # share of the edges of disc and border, for the ring to be read
_MISSING = 0.1  # share of the steps that are missing where there are edges, beyond the blur's
_OF_BLUR = 2.0  # share of the steps that blur hides, in its radii of the disc
_BETWEEN = 2.0  # evidence for a dot halfway between places, where targets have none
_MAXIMUM_CONTRAST = 0.85  # contrast of a disc, dark over bright


def fit_targets(
    gray: np.ndarray, frames: np.ndarray, polarity: np.ndarray, code: DotFamily
) -> Fit:
    """Fit the edges of disc and border.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    frames : ndarray of float64, shape (k, 3, 3)
        Of the discs, to about a pixel.
    polarity : ndarray of int, shape (k,)
        1 for dark targets, -1 for bright ones.
    code : DotFamily
    """
    reach = np.maximum(_REACH, _MINIMUM_REACH / mean_radii(frames))[:, None]
    circles = target_circles(polarity, code)
    return fit_circles_of_any_blur(gray, frames, circles, reach=reach, projective=True, rounds=3)


def target_circles(polarity: np.ndarray, code: DotFamily) -> Circles:
    """Return the edges of disc and border.

    Parameters
    ----------
    polarity : ndarray of int, shape (k,)
        1 for dark targets, -1 for bright ones.
    code : DotFamily
    """
    angles = 2 * np.pi * np.arange(_RAYS) / _RAYS
    radii = np.array([1.0, code.ground_radius, code.border_radius])
    signs = np.repeat([1, -1, 1], _RAYS)
    group = np.repeat([0, 1, 1], _RAYS)
    of_points = polarity[:, None] * signs
    return Circles(np.tile(angles, 3), np.repeat(radii, _RAYS), group, of_points)


@dataclass(frozen=True, slots=True)
class Rings(ArrayRecord):
    """k rings of dots.

    Attributes
    ----------
    frames, covariance : ndarray of float64, shape (k, 3, 3) and (k, 2, 2)
        Of the discs, and of their centres, px^2.
    polarity : ndarray of int, shape (k,)
        1 for dark targets, -1 for bright ones.
    words : ndarray of int64, shape (k,)
        As read, counter-clockwise in the image from the first place.
    phase : ndarray of float64, shape (k,)
        Direction of that place in the frame, rad clockwise from +x.
    edge_shift : ndarray of float64, shape (k,)
        Of the edges of disc and border, as in `Fit`, px.
    radius : ndarray of float64, shape (k,)
        Of the small dots as seen, in radii of the disc.
    target_features, word_features : ndarray of float64, shape (k, n) and (k, m)
        As `confidence` weighs them.
    """

    frames: np.ndarray
    covariance: np.ndarray
    polarity: np.ndarray
    words: np.ndarray
    phase: np.ndarray
    edge_shift: np.ndarray
    radius: np.ndarray
    target_features: np.ndarray
    word_features: np.ndarray

    @property
    def of_target(self) -> np.ndarray:
        """Probability that there is a target, shape (k,)."""
        return target_probability(self.target_features)

    @property
    def whole(self) -> np.ndarray:
        """Whether disc and border are seen as in good light, shape (k,)."""
        return np.asarray((self.target_features[:, :2] >= MAXIMUM_SHARE).all(axis=1))

    @property
    def of_word(self) -> np.ndarray:
        """Probability that there is a target with that word, shape (k,)."""
        return self.of_target * word_probability(self.word_features)


def read_discs(pyramid: ImagePyramid, discs: Dots, code: DotFamily) -> Rings:
    """Return the rings of dots about discs, as far as they lie in the image.

    Parameters
    ----------
    pyramid : ImagePyramid
    discs : Dots
    code : DotFamily
    """
    count = max(len(discs.frames), 1)
    return Rings.joined(
        [
            _read_part(pyramid, discs.select(np.s_[start : start + _PART]), code)
            for start in range(0, count, _PART)
        ]
    )


def _read_part(pyramid: ImagePyramid, discs: Dots, code: DotFamily) -> Rings:
    fit = fit_targets(pyramid.gray, discs.frames, discs.polarity, code)
    fit = fit.select((fit.share >= _PLAUSIBLE) & (fit.contrast <= _MAXIMUM_CONTRAST))
    readings = read_rings(pyramid.logs[0], fit, code)
    # Circles of other radii can have their edges within reach, but not the steps.
    missing = fit.share - readings.seen - _OF_BLUR * fit.blur / fit.size
    likely = (missing <= _MISSING) & (readings.between <= _BETWEEN) & readings.inside
    fit, readings = fit.select(likely), readings.select(likely)
    return Rings(
        frames=fit.frames,
        covariance=fit.covariance,
        polarity=fit.polarity,
        words=readings.words,
        phase=readings.phase,
        edge_shift=fit.edge_shift,
        radius=readings.radius,
        target_features=target_features(readings, fit),
        word_features=word_features(readings, fit),
    )


def report(rings: Rings, settings: DetectorSettings, code: DotFamily) -> list[DottedTarget]:
    """Return one target for each place and each ID, the most certain one.

    Parameters
    ----------
    rings : Rings
    settings : DetectorSettings
    code : DotFamily
    """
    major = ellipse_axes(rings.frames)[0]
    minimum, maximum = settings.radii
    ids = code.ids(rings.words)
    decoded = (rings.of_word >= CERTAIN) & (ids > 0)
    shown = decoded | (settings.report_undecoded & (rings.whole | (rings.of_target >= CERTAIN)))
    which = np.flatnonzero(shown & (major >= minimum) & (major <= maximum))
    targets = _targets(rings.select(which), np.where(decoded, ids, UNDECODED)[which], code)
    return best_targets(targets, code.border_radius)


def _targets(rings: Rings, ids: np.ndarray, code: DotFamily) -> list[DottedTarget]:
    decoded = ids != UNDECODED
    places = ellipse_fields(rings.frames, rings.covariance, rings.edge_shift)
    codes = np.where(decoded, code.canonical(rings.words), 0).tolist()
    certainty = np.where(decoded, rings.of_word, 0.0).tolist()
    words = np.where(decoded, rings.words, 0).tolist()
    return [
        DottedTarget(
            id=identifier,
            code=of_code,
            confidence=sure,
            polarity=sign,
            family='' if identifier == UNDECODED else FAMILY,
            **ellipses(frame[None], word, phase, radius, code),
            **place,
        )
        for identifier, of_code, sure, sign, frame, word, phase, radius, place in zip(
            ids.tolist(),
            codes,
            certainty,
            rings.polarity.tolist(),
            rings.frames,
            words,
            rings.phase.tolist(),
            rings.radius.tolist(),
            places,
            strict=True,
        )
    ]


def ellipses(
    frame: np.ndarray, word: int, phase: float, radius: float, code: DotFamily
) -> dict[str, Any]:
    """Return the ellipses of disc, border and dots as `DottedTarget` has them.

    Parameters
    ----------
    frame : ndarray of float64, shape (1, 3, 3)
    word : int
        As read from the first place, counter-clockwise in the image.
    phase : float
        Direction of that place in the frame, rad clockwise from +x.
    radius : float
        Of the small dots, in radii of the disc.
    code : DotFamily
    """
    which = np.flatnonzero(word >> np.arange(code.bits) & 1)
    points = dot_points(phase - 2 * np.pi * which / code.bits, code)
    points = np.concatenate([np.zeros((2, 2)), points])
    radii = np.array([1.0, code.border_radius] + [radius] * len(which))
    frames = local_frames(frame, points, radii)[0]
    columns = (frames[:, 0, 2], frames[:, 1, 2], *ellipse_axes(frames))
    return {'dots': tuple(zip(*(of.tolist() for of in columns), strict=True)), 'template_dots': 2}
