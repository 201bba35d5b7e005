"""Identification of ring targets that light does not break.

Dots are found as whole outlines first, then, in what those do not explain, as places where many
gradients of the logarithm of the image point away from. Their ellipses are fitted, their bands
read by likelihood, and dot and band refined together to a projective frame, whose origin is the
image of the target's physical centre.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ahf_ros.codes.ring import Family, family
from ahf_ros.detectors.contract import DetectorSettings
from ahf_ros.detectors.ring import decoding, reading
from ahf_ros.detectors.ring.hypotheses import CERTAIN, Hypotheses, settled_dots, settled_numbers
from ahf_ros.detectors.ring.refinement import refine_centres
from ahf_ros.features import candidates, circle_fit, dots, frame
from ahf_ros.imaging.image import as_gray, check_image
from ahf_ros.target import UNDECODED, Target

_RAYS = 24  # about a dot
_LEAST_SHARE = 0.5  # of the edge of a dot, for its band to be read
_FAINTEST = 0.8  # contrast of a dot, for its band to be read
_WHOLE = 0.9  # share of the edge of a dot that is reported without a word
_PART = 256  # dots read at a time
_QUIET = 0.4  # width of the margin round the band, dot radii


@dataclass(frozen=True, slots=True)
class RingDetector:
    """Identify ring targets (Schneider type) of one family.

    Attributes
    ----------
    settings : DetectorSettings
    """

    settings: DetectorSettings = field(default_factory=DetectorSettings)

    @property
    def name(self) -> str:
        """Name in the registry."""
        return 'ring'

    @property
    def family(self) -> str:
        """Family of the codes."""
        return self.settings.family

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image; see `Detector`."""
        return _reported(self.hypotheses(image), self.settings, family(self.settings.family))

    def refine(self, image: np.ndarray, targets: Sequence[Target]) -> list[Target]:
        """Return targets with their places in an image; see `refine_centres`."""
        wanted = self.settings
        return refine_centres(image, targets, family(wanted.family), wanted.signs)

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

        signs = wanted.signs
        whole, whole_signs = edges[0].outlines(wanted.min_radius / 2, wanted.max_radius / 2)
        chosen = np.isin(whole_signs, signs)
        start, start_signs = frame.enlarged(whole[chosen], 1), whole_signs[chosen]
        found = _identified(gray, code, start, start_signs, np.ones(len(start)))
        rest = _unexplained(edges, found, code)
        groups = candidates.find_candidates(rest, wanted.min_radius, wanted.max_radius, signs)
        if not groups:
            return found
        fitted = zip(*(dots.fit_dots(logs, group) for group in groups), strict=True)
        dots_found = (np.concatenate(parts) for parts in fitted)
        return Hypotheses.joined([found, _identified(gray, code, *dots_found)])


def _identified(
    gray: np.ndarray, code: Family, frames: np.ndarray, signs: np.ndarray, inliers: np.ndarray
) -> Hypotheses:
    """Return what the bands about distinct dots say, read in parts, which bounds the memory."""
    kept = _distinct(frames, signs, inliers)
    parts = [kept[start : start + _PART] for start in range(0, max(len(kept), 1), _PART)]
    return Hypotheses.joined([_read(gray, code, frames[part], signs[part]) for part in parts])


def _unexplained(
    edges: list[candidates.LogEdges], found: Hypotheses, code: Family
) -> dict[int, candidates.LogEdges]:
    """Return the edges of the levels from 1 on that neither targets nor whole dots explain."""
    angles = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    certain = found.confidence >= CERTAIN
    hidden = certain | (found.share >= _WHOLE)
    radii = np.where(certain, code.band_outer + _QUIET, 1 + _QUIET)[hidden, None]
    outlines = frame.project(found.frames[hidden], frame.circle_points(angles, radii))[:, :, 0]
    return {
        level: of_level.outside(list((outlines + 0.5) / 2**level - 0.5))
        for level, of_level in enumerate(edges, start=1)
    }


def _read(gray: np.ndarray, code: Family, frames: np.ndarray, signs: np.ndarray) -> Hypotheses:
    """Fit the edges of dots, and read the bands of those that have one."""
    circles = circle_fit.dot_circles(signs, _RAYS)
    fit = circle_fit.fit_circles(gray, frames, circles, reach=reading.REACH, projective=False)
    good = (fit.share >= _LEAST_SHARE) & (fit.contrast <= _FAINTEST)
    found, _ = reading.read_dots(gray, fit.chosen(good), signs[good], code)
    return found


def _distinct(frames: np.ndarray, signs: np.ndarray, quality: np.ndarray) -> np.ndarray:
    """Return which frames to keep so that no two are the same dot, the best ones first."""
    size = frame.mean_radii(frames)
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
    shown &= (found.confidence >= CERTAIN) | (wanted.report_undecoded & (found.share >= _WHOLE))
    found = found.chosen(shown)
    found = found.chosen(np.lexsort((-found.margin, found.confidence < CERTAIN)))
    _, numbers = decoding.canonical(found.words, code)
    certain = found.confidence >= CERTAIN
    dots_kept, uncontested = settled_dots(found, numbers, certain, code)
    certain = settled_numbers(found, numbers, certain & uncontested)
    targets = _as_targets(found.chosen(dots_kept), certain[dots_kept], code)
    if not wanted.report_undecoded:
        targets = [target for target in targets if target.id != UNDECODED]
    return sorted(targets, key=lambda target: (target.id, target.y, target.x))


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
