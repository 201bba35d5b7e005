"""Rings of dots that may be targets, in their frames, and which of them are reported.

The edges of disc and border give the frames: circles of three radii separate the image of the
physical centre from the centres of ellipses.

There has to be a target, no pattern of light that resembles one, and its word has to be right.
Each is a logistic regression on rendered scenes, whose weights are in `fitted_weights.json`.
`benchmarks.confidence` fits them, and shows how far the result can be trusted.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros.base.target import UNDECODED, DottedTarget
from ahf_ros.families.claims import best_of_places
from ahf_ros.families.contract import DetectorSettings
from ahf_ros.families.dots.reading import Readings, dot_points, expecting, read_rings
from ahf_ros.prints.dots import DotRingPrint
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.circle_fit import Fit, fit_circles_of_any_blur, on_circles
from ahf_ros.vision.dots import Dots
from ahf_ros.vision.ellipse_targets import ellipse_fields
from ahf_ros.vision.frame import ellipse_axes, mean_radii
from ahf_ros.vision.homography import local_frames
from ahf_ros.vision.logistic import logistic, read_weights
from ahf_ros.vision.pyramid import ImagePyramid

_RAYS = 40  # round each circle
_REACH = 0.3  # how far from a circle its edge is looked for, radii of the disc: half the border
_MINIMUM_REACH = 1.35  # the same of small discs, px: what a profile needs

PLAUSIBLE = 0.4  # share of the edges of disc and border that are seen
CERTAIN = 0.95  # confidence from which a target is reported
WEIGHTS = Path(__file__).with_name('fitted_weights.json')

_PART = 512  # discs fitted at a time, which bounds the memory
_BETWEEN = 2.0  # evidence for a dot halfway between places, where targets have none

_MAXIMUM_SHARE = 0.85
# Of the steps at disc and border, and of their edges, for a target in good light.
_MAXIMUM_HEIGHT = 0.5  # beyond which it says no more, of a dot, in the one that the blur leaves it
_MINIMUM_DOUBT = -6.0  # below which it says no more, ln of the odds that a place misleads
_OF_TARGET, _OF_WORD = read_weights(WEIGHTS, 'dots_confidence', 'target', 'word')


def fit_targets(
    gray: np.ndarray, frames: np.ndarray, polarity: np.ndarray, code: DotRingPrint
) -> Fit:
    """Fit the edges of disc and border; the frames of the discs are known to about a pixel."""
    angles = 2 * np.pi * np.arange(_RAYS) / _RAYS
    radii = np.repeat([1.0, code.ground_radius, code.border_radius], _RAYS)
    group, signs = np.repeat([0, 1, 1], _RAYS), np.repeat([1, -1, 1], _RAYS)
    circles = on_circles(np.tile(angles, 3), radii, group, polarity[:, None] * signs)
    reach = np.maximum(_REACH, _MINIMUM_REACH / mean_radii(frames))[:, None]
    return fit_circles_of_any_blur(gray, frames, circles, reach=reach, projective=True, rounds=3)


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
        Growth of what is dark in light, by the edges of disc and border, px.
    radius : ndarray of float64, shape (k,)
        Of the small dots as seen, in radii of the disc.
    target_features, word_features : ndarray of float64, shape (k, n) and (k, m)
        What the probabilities of target and word depend on.
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
        return np.asarray((self.target_features[:, :2] >= _MAXIMUM_SHARE).all(axis=1))

    @property
    def of_word(self) -> np.ndarray:
        """Probability that there is a target with that word, shape (k,)."""
        return self.of_target * word_probability(self.word_features)


NO_RINGS = Rings(
    frames=np.zeros((0, 3, 3)),
    covariance=np.zeros((0, 2, 2)),
    polarity=np.zeros(0, int),
    words=np.zeros(0, int),
    phase=np.zeros(0),
    edge_shift=np.zeros(0),
    radius=np.zeros(0),
    target_features=np.zeros((0, 3)),
    word_features=np.zeros((0, 4)),
)
"""An empty record."""


def target_features(readings: Readings, fit: Fit) -> np.ndarray:
    """Return what separates targets from other things, shape (k, 3).

    The share of the steps of ln I at disc and border; the share of the edges in their place; the
    step of the dot that is seen best, in the one that the blur leaves it. All limited.
    """
    return np.stack(
        [
            np.minimum(readings.seen, _MAXIMUM_SHARE),
            np.minimum(fit.share, _MAXIMUM_SHARE),
            np.clip(readings.height, 0, _MAXIMUM_HEIGHT),
        ],
        axis=1,
    )


def word_features(readings: Readings, fit: Fit) -> np.ndarray:
    """Return what separates right words from wrong ones, shape (k, 4).

    ln of the odds that the evidence at any one place misleads, limited; then `target_features`.
    """
    doubt = np.log(np.exp(-np.abs(readings.evidence)).sum(axis=1))
    return np.column_stack([np.maximum(doubt, _MINIMUM_DOUBT), target_features(readings, fit)])


def target_probability(features: np.ndarray) -> np.ndarray:
    """Return the probabilities that there are targets, shape (k,)."""
    return logistic(features, _OF_TARGET)


def word_probability(features: np.ndarray) -> np.ndarray:
    """Return the probabilities that the words of targets are right, shape (k,).

    They are at most those that no place misleads. The regression alone makes good edges outweigh
    a place that shows little, which they do not: half of the wrong IDs came from that.
    """
    not_misled = 1 / (1 + np.exp(features[:, 0]))
    return np.minimum(logistic(features, _OF_WORD), not_misled)


def read_discs(
    pyramid: ImagePyramid,
    discs: Dots,
    code: DotRingPrint,
    expected: frozenset[int] = frozenset(),
) -> Rings:
    """Return the rings of dots about discs, as far as they lie in the image.

    `expected` are IDs that are likely to be there. Empty: all IDs are equally likely.
    """
    parts = [
        _read_part(pyramid, discs.select(np.s_[start : start + _PART]), code, expected)
        for start in range(0, len(discs.frames), _PART)
    ]
    return Rings.joined([NO_RINGS, *parts])


def _read_part(
    pyramid: ImagePyramid, discs: Dots, code: DotRingPrint, expected: frozenset[int]
) -> Rings:
    fit = fit_targets(pyramid.gray, discs.frames, discs.polarity, code)
    fit = fit.select(fit.share >= PLAUSIBLE)
    readings = read_rings(pyramid.logs[0], fit, code)
    likely = readings.inside & (readings.between <= _BETWEEN)
    fit, readings = fit.select(likely), readings.select(likely)
    if expected:
        readings = expecting(readings, code, expected)
    return Rings(
        frames=fit.frames,
        covariance=fit.covariance,
        polarity=fit.polarity,
        words=readings.words,
        phase=readings.phase,
        edge_shift=fit.growth,
        radius=readings.radius,
        target_features=target_features(readings, fit),
        word_features=word_features(readings, fit),
    )


def likely_targets(
    rings: Rings, settings: DetectorSettings, code: DotRingPrint
) -> list[DottedTarget]:
    """Return the targets whose words are certain, or all that there are if these are reported.

    Each has its likeliest ID. There is one in each place.
    """
    shown = (rings.of_word >= CERTAIN) & (code.ids(rings.words) > 0)
    shown |= settings.report_undecoded & (rings.whole | (rings.of_target >= CERTAIN))
    shown &= settings.of_size(ellipse_axes(rings.frames)[0])
    return best_of_places(_targets(rings.select(shown), code), code.border_radius)


def _targets(rings: Rings, code: DotRingPrint) -> list[DottedTarget]:
    ids = code.ids(rings.words)
    valid = ids > 0
    places = ellipse_fields(rings.frames, rings.covariance, rings.edge_shift)
    codes = np.where(valid, code.canonical(rings.words), 0).tolist()
    certainty = np.where(valid, rings.of_word, 0.0).tolist()
    words = np.where(valid, rings.words, 0).tolist()
    return [
        DottedTarget(
            id=identifier,
            code=of_code,
            confidence=sure,
            polarity=sign,
            family=code.name,
            dots=_ellipses(frame, word, phase, radius, code),
            template_dots=2,
            **place,
        )
        for identifier, of_code, sure, sign, frame, word, phase, radius, place in zip(
            np.where(valid, ids, UNDECODED).tolist(),
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


def _ellipses(
    frame: np.ndarray, word: int, phase: float, radius: float, code: DotRingPrint
) -> tuple[Any, ...]:
    """Return the ellipses of disc, border and dots of one ring as `DottedTarget` has them."""
    which = np.flatnonzero(word >> np.arange(code.bits) & 1)
    points = dot_points(phase - 2 * np.pi * which / code.bits, code)
    points = np.concatenate([np.zeros((2, 2)), points])
    radii = np.array([1.0, code.border_radius] + [radius] * len(which))
    frames = local_frames(frame[None], points, radii)[0]
    columns = (frames[:, 0, 2], frames[:, 1, 2], *ellipse_axes(frames))
    return tuple(zip(*(of.tolist() for of in columns), strict=True))
