"""Identification of ring targets that light does not break.

Dots are found as whole outlines first, then, in what those do not explain, as points that many
gradients of the logarithm of the image point away from. Their ellipses are fitted, their bands
read by likelihood, and dot and band refined together to a projective frame, whose origin is the
image of the target's physical centre.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ahf_ros.codes.ring import Family, canonical, family
from ahf_ros.detectors.contract import DetectorSettings
from ahf_ros.detectors.ring.frames import fit_dots
from ahf_ros.detectors.ring.hypotheses import CERTAIN, Hypotheses, resolve_dots, resolve_ids
from ahf_ros.detectors.ring.reading import read_bands
from ahf_ros.detectors.ring.refinement import refine_centres
from ahf_ros.features import frame
from ahf_ros.features.dot_search import voted_dots, whole_dots
from ahf_ros.features.dots import Dots
from ahf_ros.features.ellipse_targets import targets_from_frames
from ahf_ros.features.pyramid import image_pyramid
from ahf_ros.imaging.image import as_gray, check_image
from ahf_ros.target import UNDECODED, Target, sorted_targets

_RAYS = 24  # about a dot
_MINIMUM_SHARE = 0.5  # of the edge of a dot, for its band to be read
_FAINTEST = 0.8  # contrast of a dot, dark over bright, for its band to be read
_WHOLE = 0.9  # share of the edge of a dot that is reported without a word
_PART = 256  # dots read at a time, which bounds the memory
_MARGIN = 0.4  # width of the quiet margin round a dot or a band, dot radii
_OUTLINE = 2 * np.pi * np.arange(32) / 32  # angles of the polygon that hides an object


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
        return report(find_hypotheses(image, self.settings), self.settings)

    def refine(self, image: np.ndarray, targets: Sequence[Target]) -> list[Target]:
        """Return targets with their places in an image; see `refine_centres`."""
        return refine_centres(image, targets, family(self.family), self.settings.polarities)


def find_hypotheses(image: np.ndarray, settings: DetectorSettings) -> Hypotheses:
    """Return all dots of one image and what their bands may say, before anything is decided.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        As for `Detector`.
    settings : DetectorSettings
        What the targets look like.

    Raises
    ------
    ValueError
        If the image is not accepted.
    """
    check_image(image)
    code = family(settings.family)
    wanted = (settings.min_radius, settings.max_radius, settings.polarities)
    pyramid = image_pyramid(as_gray(image), settings.max_radius)
    whole = read_dots(pyramid.gray, whole_dots(pyramid, *wanted), code)
    voted = voted_dots(pyramid, *wanted, explained=explained_outlines(whole, code))
    return Hypotheses.joined([whole, read_dots(pyramid.gray, voted, code)])


def read_dots(gray: np.ndarray, dots: Dots, code: Family) -> Hypotheses:
    """Fit the edges of dots, and read the bands of those that have one, some at a time.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    dots : Dots
    code : Family
    """
    parts = []
    for start in range(0, max(len(dots.frames), 1), _PART):
        part = dots.select(np.s_[start : start + _PART])
        fit = fit_dots(gray, part.frames, part.polarity, _RAYS)
        good = (fit.share >= _MINIMUM_SHARE) & (fit.contrast <= _FAINTEST)
        parts.append(read_bands(gray, fit.select(good), part.polarity[good], code)[0])
    return Hypotheses.joined(parts)


def explained_outlines(hypotheses: Hypotheses, code: Family) -> np.ndarray:
    """Return outlines of targets and of whole dots, whose edges need no other explanation.

    Returns
    -------
    ndarray of float64, shape (n, m, 2)
        px.
    """
    certain = hypotheses.confidence >= CERTAIN
    explained = certain | (hypotheses.share >= _WHOLE)
    radii = np.where(certain, code.band_outer + _MARGIN, 1 + _MARGIN)[explained, None]
    points = frame.circle_points(_OUTLINE, radii)
    return frame.project(hypotheses.frames[explained], points)[:, :, 0]


def report(hypotheses: Hypotheses, settings: DetectorSettings) -> list[Target]:
    """Return the targets to report: one for each dot, and one for each ID at the most."""
    code = family(settings.family)
    major, _, _ = frame.ellipse_axes(hypotheses.frames)
    whole = settings.report_undecoded & (hypotheses.share >= _WHOLE)
    shown = (hypotheses.confidence >= CERTAIN) | whole
    shown &= (major >= settings.min_radius) & (major <= settings.max_radius)
    hypotheses = hypotheses.select(shown)
    uncertain = hypotheses.confidence < CERTAIN
    hypotheses = hypotheses.select(np.lexsort((-hypotheses.margin, uncertain)))
    codes, ids = canonical(hypotheses.words, code)
    certain = hypotheses.confidence >= CERTAIN
    kept, uncontested = resolve_dots(hypotheses, ids, certain, code)
    certain = resolve_ids(hypotheses, ids, certain & uncontested)
    ids = np.where(certain, ids, UNDECODED)
    if not settings.report_undecoded:
        kept = kept[certain[kept]]
    some = hypotheses.select(kept)
    return sorted_targets(
        targets_from_frames(some.frames, some.covariance, ids[kept], codes[kept], some.confidence)
    )
