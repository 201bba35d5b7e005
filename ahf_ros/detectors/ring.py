"""Identification of ring targets that light does not break.

Dots are found as whole outlines first, then, in what those do not explain, as places where many
gradients of the logarithm of the image point away from. Their ellipses are fitted, their bands
read by likelihood, and dot and band refined together to a projective frame, whose origin is the
image of the target's physical centre.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import ClassVar

import numpy as np

from ahf_ros import candidates, decoding, dots, evidence, frame, subpixel
from ahf_ros.codes.ring import Family, family
from ahf_ros.detectors.detector import DetectorSettings
from ahf_ros.image import as_gray, check_image
from ahf_ros.target import UNDECODED, Target

_SIGNS = {'auto': (1, -1), 'dark': (1,), 'bright': (-1,)}
_RAYS = 48  # about a dot
_REACH = 0.45  # about an expected edge, dot radii
_LEAST_SHARE = 0.5  # of the edge of a dot, for its band to be read
_FAINTEST = 0.8  # contrast of a dot, for its band to be read
_CERTAIN = 0.99  # confidence from which a word is reported
_READINGS = 2  # of a band, each from a better frame
_SHIFT = 0.4  # of an edge towards the dark side, px, at the most
_SMALL = 7.0  # radius of dots that such a shift spoils the reading of, px
_WHOLE = 0.9  # share of the edge of a dot that is reported without a word
_CLEARLY = 2.0  # times the evidence of another claim to the same ID
_QUIET = 0.4  # width of the margin round the band, dot radii


@dataclass(frozen=True, slots=True)
class RingDetector:
    """Identify ring targets (Schneider type) of one family.

    Attributes
    ----------
    settings : DetectorSettings
    """

    name: ClassVar[str] = 'ring'
    settings: DetectorSettings = field(default_factory=DetectorSettings)

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image; see `Detector`."""
        return _reported(self.hypotheses(image), self.settings, family(self.settings.family))

    def hypotheses(self, image: np.ndarray) -> Hypotheses:
        """Return all dots of one image and what their bands may say, before anything is decided.

        Parameters
        ----------
        image : ndarray, shape (height, width)
            As for `Detector`.

        Raises
        ------
        ValueError
            If the image is not accepted.
        """
        check_image(image)
        wanted, code = self.settings, family(self.settings.family)
        gray = as_gray(image)
        levels = candidates.pyramid(gray, candidates.halvings(wanted.max_radius))
        logs = [candidates.log_image(level) for level in levels]
        edges = [candidates.find_edges(log) for log in logs[1:]]
        gray = gray.astype(np.float32, copy=False)

        signs = _SIGNS[wanted.polarity]
        whole, whole_signs = edges[0].outlines(wanted.min_radius / 2, wanted.max_radius / 2)
        chosen = np.isin(whole_signs, signs)
        start, start_signs = frame.enlarged(whole[chosen], 1), whole_signs[chosen]
        first = _identify(gray, start, start_signs, np.ones(len(start)), code)

        rest = _unexplained(edges, first, code)
        groups = candidates.find_candidates(rest, wanted.min_radius, wanted.max_radius, signs)
        found = [first]
        if groups:
            fitted = zip(*(dots.fit_dots(logs, group) for group in groups), strict=True)
            frames, dot_signs, inliers = (np.concatenate(parts) for parts in fitted)
            found.append(_identify(gray, frames, dot_signs, inliers, code))
        return Hypotheses.joined(found)


@dataclass(frozen=True, slots=True)
class Hypotheses:
    """k dots, and what their bands were read as.

    Attributes
    ----------
    frames : ndarray of float64, shape (k, 3, 3)
        In px of the image.
    covariance : ndarray of float64, shape (k, 2, 2)
        Of the image of the centre, px^2.
    share : ndarray of float64, shape (k,)
        Share of the expected edges that are in their place.
    words : ndarray of int64, shape (k,)
        In the rotation read; 0 where no word is plausible.
    margin : ndarray of float64, shape (k,)
        Evidence over the best word of another ID, in units of ln.
    features : ndarray of float64, shape (k, n)
        What the confidence is computed from, see `decoding.confidence_features`.
    confidence : ndarray of float64, shape (k,)
        Probability that the word is right.
    """

    frames: np.ndarray
    covariance: np.ndarray
    share: np.ndarray
    words: np.ndarray
    margin: np.ndarray
    features: np.ndarray
    confidence: np.ndarray

    @staticmethod
    def unread(fit: subpixel.Fit) -> Hypotheses:
        """Return dots of which no band was read."""
        count = len(fit.frames)
        return Hypotheses(
            fit.frames.copy(),
            fit.covariance.copy(),
            fit.share.copy(),
            words=np.zeros(count, np.int64),
            margin=np.zeros(count),
            features=np.zeros((count, decoding.FEATURES)),
            confidence=np.zeros(count),
        )

    def update(self, which: np.ndarray, readings: decoding.Readings, fit: subpixel.Fit) -> None:
        """Take over the readings of some of the dots."""
        features = decoding.confidence_features(readings, fit.share, fit.deviation)
        self.frames[which], self.covariance[which] = fit.frames, fit.covariance
        self.share[which] = fit.share
        self.words[which], self.margin[which] = readings.words, readings.margin
        self.features[which] = features
        self.confidence[which] = decoding.confidence(features)

    def chosen(self, which: np.ndarray) -> Hypotheses:
        """Return some of the dots."""
        return Hypotheses(*(getattr(self, item.name)[which] for item in fields(self)))

    @staticmethod
    def joined(parts: list[Hypotheses]) -> Hypotheses:
        """Return the dots of several finds."""
        names = [item.name for item in fields(Hypotheses)]
        return Hypotheses(*(np.concatenate([getattr(of, n) for of in parts]) for n in names))


def _unexplained(
    edges: list[candidates.LogEdges], found: Hypotheses, code: Family
) -> dict[int, candidates.LogEdges]:
    """Return the edges of the levels from 1 on that neither targets nor whole dots explain."""
    angles = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    certain = found.confidence >= _CERTAIN
    hidden = certain | (found.share >= _WHOLE)
    radii = np.where(certain, code.band_outer + _QUIET, 1 + _QUIET)[hidden, None]
    outlines = frame.project(found.frames[hidden], frame.circle_points(angles, radii))[:, :, 0]
    return {
        level: of_level.outside(list((outlines + 0.5) / 2**level - 0.5))
        for level, of_level in enumerate(edges, start=1)
    }


def _identify(
    gray: np.ndarray, frames: np.ndarray, signs: np.ndarray, inliers: np.ndarray, code: Family
) -> Hypotheses:
    """Read the bands about dots, and refine dot and band together."""
    kept = _distinct(frames, signs, inliers)
    frames, signs = frames[kept], signs[kept]
    circles = subpixel.dot_circles(signs, _RAYS)
    fit = subpixel.fit_circles(gray, frames, circles, reach=_REACH, projective=False)
    good = (fit.share >= _LEAST_SHARE) & (fit.contrast <= _FAINTEST)
    fit, signs = fit.chosen(good), signs[good]
    which, frames = _unshifted(fit, signs)
    fit = fit.chosen(which)
    marks = evidence.Marks(signs[which], fit.contrast, fit.bright)
    found = Hypotheses.unread(fit)
    read = np.arange(len(which))
    # A band that was read right makes the frame better, and a better frame the reading.
    for _ in range(_READINGS):
        readings = decoding.read_bands(gray, frames, marks, code)
        good = readings.plausible
        read, readings, marks = read[good], readings.chosen(good), marks.chosen(good)
        circles = decoding.marked_circles(readings, marks.signs, _RAYS, code)
        fit = subpixel.fit_circles(gray, frames[good], circles, reach=_REACH, projective=True)
        frames = fit.frames
    found.update(read, readings, fit)
    return found


def _unshifted(fit: subpixel.Fit, signs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which dots to read, and their frames without the shift of the dot's edge.

    A camera's gamma makes a dark dot smaller and a bright one larger, by a third of a pixel at
    usual blur; a linear camera does not. The band, up to 3.5 radii away, needs the scale: small
    dots are read with either, others with the mean.
    """
    major, minor, _ = frame.ellipse_axes(fit.frames)
    size = np.sqrt(major * minor)
    every, small = np.arange(len(size)), np.flatnonzero(size < _SMALL)
    which = np.concatenate([every, small])
    shift = np.full(len(size), _SHIFT / 2)
    shift[small] = 0.0
    shift = np.concatenate([shift, np.full(len(small), _SHIFT)])
    changes = np.zeros((len(which), 5))
    changes[:, 2] = signs[which] * shift / size[which]
    return which, frame.moved(fit.frames[which], changes)


def _distinct(frames: np.ndarray, signs: np.ndarray, quality: np.ndarray) -> np.ndarray:
    """Return which frames to keep so that no two are the same dot, the best ones first."""
    major, minor, _ = frame.ellipse_axes(frames)
    size = np.sqrt(major * minor)
    order = np.argsort(frames[:, 0, 2], kind='stable')  # neighbours are near in this order
    x, y, size, signs = frames[order, 0, 2], frames[order, 1, 2], size[order], signs[order]
    first, last = np.searchsorted(x, x - 0.3 * size), np.searchsorted(x, x + 0.3 * size)
    kept: list[int] = []
    free = np.ones(len(frames), bool)
    for index in np.argsort(-quality[order], kind='stable'):
        if free[index]:
            kept.append(int(order[index]))
            near = slice(first[index], last[index] + 1)
            same = np.hypot(x[near] - x[index], y[near] - y[index]) < 0.3 * size[index]
            same &= signs[near] == signs[index]
            free[near] &= ~(same & (np.abs(np.log(size[near] / size[index])) < 0.3))
    return np.array(kept, np.intp)


def _reported(found: Hypotheses, wanted: DetectorSettings, code: Family) -> list[Target]:
    """Return the targets to report: one for each dot, and one for each ID at the most."""
    major, _, _ = frame.ellipse_axes(found.frames)
    shown = (major >= wanted.min_radius) & (major <= wanted.max_radius)
    shown &= (found.confidence >= _CERTAIN) | (wanted.report_undecoded & (found.share >= _WHOLE))
    found = found.chosen(shown)
    found = found.chosen(np.lexsort((-found.margin, found.confidence < _CERTAIN)))
    found = found.chosen(_first_of_each_dot(found, code))
    certain = _uncontested(found, code)
    targets = _as_targets(found, certain, code)
    if not wanted.report_undecoded:
        targets = [target for target in targets if target.id != UNDECODED]
    return sorted(targets, key=lambda target: (target.id, target.y, target.x))


def _first_of_each_dot(found: Hypotheses, code: Family) -> np.ndarray:
    """Return the first of all that lie on the same dot, or on a band that has been read."""
    major, minor, _ = frame.ellipse_axes(found.frames)
    reach = np.where(found.confidence >= _CERTAIN, code.band_outer * minor, major)
    kept: list[int] = []
    for index, centre in enumerate(found.frames[:, :2, 2]):
        distance = np.hypot(*(found.frames[kept, :2, 2] - centre).T)
        if not (distance < reach[kept]).any():
            kept.append(index)
    return np.array(kept, np.intp)


def _uncontested(found: Hypotheses, code: Family) -> np.ndarray:
    """Return which readings are certain and clearly the best claim to their ID."""
    certain = found.confidence >= _CERTAIN
    _, numbers = decoding.canonical(found.words, code)
    for number in np.unique(numbers[certain]):
        claims = np.flatnonzero(certain & (numbers == number))
        order = claims[np.argsort(-found.margin[claims], kind='stable')]
        certain[order[1:]] = False
        if len(order) > 1 and found.margin[order[1]] * _CLEARLY > found.margin[order[0]]:
            certain[order[0]] = False
    return certain


def _as_targets(found: Hypotheses, certain: np.ndarray, code: Family) -> list[Target]:
    codes, numbers = decoding.canonical(found.words, code)
    major, minor, angle = frame.ellipse_axes(found.frames)
    return [
        Target(
            id=int(numbers[index]) if certain[index] else UNDECODED,
            code=int(codes[index]) if certain[index] else 0,
            x=float(found.frames[index, 0, 2]),
            y=float(found.frames[index, 1, 2]),
            semi_major=float(major[index]),
            semi_minor=float(minor[index]),
            angle=float(angle[index]),
            confidence=float(found.confidence[index]),
            covariance=tuple(found.covariance[index].ravel().tolist()),
        )
        for index in range(len(numbers))
    ]
