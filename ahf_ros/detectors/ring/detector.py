"""Identification of ring targets that light does not break.

Dots are found by whole outlines first, and then by votes of the edges that these do not explain.
Their ellipses are fitted, their bands are decoded by likelihood, and dot and band are refined
together to a projective frame, whose origin is the image of the target's physical centre.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ahf_ros.codes.ring import family
from ahf_ros.detectors.contract import DetectorSettings
from ahf_ros.detectors.ring.competition import PART, by_clear_dots, read_families
from ahf_ros.detectors.ring.faint import with_faint
from ahf_ros.detectors.ring.full_size import at_full_size
from ahf_ros.detectors.ring.hypotheses import (
    Hypotheses,
    resolve_dots,
    resolve_ids,
    resolve_overlaps,
)
from ahf_ros.detectors.ring.oblique import oblique_dots, rounding
from ahf_ros.detectors.ring.refinement import refine_centres
from ahf_ros.detectors.ring.same_prints import decoded, settle_same_prints
from ahf_ros.detectors.ring.soft import soft_dots
from ahf_ros.detectors.ring.target_circles import REACH
from ahf_ros.features import frame
from ahf_ros.features.circle_fit import Fit, fit_dots
from ahf_ros.features.dot_search import voted_dots, whole_dots
from ahf_ros.features.dots import NO_DOTS, Dots
from ahf_ros.features.ellipse_targets import targets_from_frames
from ahf_ros.features.pyramid import Octave, image_pyramid, octaves
from ahf_ros.imaging.image import as_gray, check_image
from ahf_ros.target import UNDECODED, Target, sorted_targets

_RAYS = 24  # about a dot
_MINIMUM_SHARE = 0.5  # of the edge of a dot, for its band to be read
_FAINTEST = 0.8  # contrast of a dot, dark over bright, for its band to be read
_WHOLE = 0.9  # share of the edge of a dot that is reported without a word
_MARGIN = 0.4  # width of the quiet margin round a dot or a band, dot radii


@dataclass(frozen=True, slots=True)
class RingDetector:
    """Identify ring targets (Schneider type) of one family or of several.

    Attributes
    ----------
    settings : DetectorSettings
    expected : frozenset of int
        IDs that are likely to be there; all are alike where it is empty.
    """

    settings: DetectorSettings = field(default_factory=DetectorSettings)
    expected: frozenset[int] = frozenset()

    @property
    def name(self) -> str:
        """Name in the registry."""
        return 'ring'

    @property
    def family(self) -> str:
        """Family of the codes, or several as the settings list them."""
        return self.settings.family

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image; see `Detector`."""
        check_image(image)
        return report(find_hypotheses(as_gray(image), self.settings, self.expected), self.settings)

    def refine(self, image: np.ndarray, targets: Sequence[Target]) -> list[Target]:
        """Return targets with their centres in an image; see `refine_centres`."""
        code = family(self.settings.families[0])
        return refine_centres(image, targets, code, self.settings.polarities, self.expected)

    def expecting(self, ids: frozenset[int]) -> RingDetector:
        """Return a detector that knows which IDs are likely; see `Expecting`."""
        return replace(self, expected=ids)


def find_hypotheses(
    gray: np.ndarray, settings: DetectorSettings, expected: frozenset[int] = frozenset()
) -> Hypotheses:
    """Return all dots of an image and the words that their bands may show, before any decision.

    Parameters
    ----------
    gray : ndarray of uint8 or float32, shape (height, width)
        Gray values from 0 to 255.
    settings : DetectorSettings
        What the targets look like.
    expected : frozenset of int
        IDs that are likely to be there; all are alike where it is empty.
    """
    found = read_image(gray, settings, expected)
    return with_faint(
        gray, found, lambda part: read_image(part, settings, expected, whole_only=True)
    )


def read_image(
    gray: np.ndarray,
    settings: DetectorSettings,
    expected: frozenset[int] = frozenset(),
    *,
    whole_only: bool = False,
) -> Hypotheses:
    """Return the dots and words that an image shows at its own contrast.

    Parameters
    ----------
    gray, settings, expected
        As for `find_hypotheses`.
    whole_only : bool
        Whether only dots with a whole outline are looked for.
    """
    families = [family(name) for name in settings.families]
    pyramid = image_pyramid(gray, settings.max_radius)
    images = (pyramid.gray, *pyramid.halves)
    found: list[Hypotheses] = []
    for octave in octaves(pyramid, *settings.radii):
        parts: list[tuple[Fit, Hypotheses]] = []
        for search in (_whole,) if whole_only else (_whole, _voted, _oblique):
            dots = search(octave, settings.polarities, found)
            if not len(dots.frames):
                continue
            fits = _fitted(octave.pyramid.gray, dots)
            if not any(read.certain.any() for read in found):
                families = by_clear_dots(octave.pyramid.gray, fits, families)
            read = read_families(octave.pyramid.gray, fits, families, expected)
            parts.append((fits, read))
            found.append(at_full_size(images[: octave.level], read))
        # What is out of focus is sharper in the next half.
        for level in range(octave.level + 1, 0 if whole_only else len(images)):
            soft = soft_dots(parts)
            if not len(soft.frames):
                break
            half = images[level].astype(np.float32, copy=False)
            fits = _fitted(half, soft)
            parts = [(fits, read_families(half, fits, families, expected))]
            found.append(at_full_size(images[:level], parts[0][1]))
    if not found:
        return Hypotheses.unread(_fitted(pyramid.gray, NO_DOTS), families[0])
    return Hypotheses.joined(found)


def _whole(octave: Octave, polarities: Sequence[int], _found: Sequence[Hypotheses]) -> Dots:
    """Return the dots of an octave with a whole outline."""
    return whole_dots(octave.pyramid, *octave.radii, polarities)


def _voted(octave: Octave, polarities: Sequence[int], found: Sequence[Hypotheses]) -> Dots:
    """Return the dots of an octave that edges vote for which nothing explains yet."""
    outlines = [
        outline
        for read in found
        for outline in _outlines(read.select(read.certain | (read.share >= _WHOLE)), octave.level)
    ]
    return voted_dots(octave.pyramid, *octave.radii, polarities, explained=outlines)


def _oblique(octave: Octave, polarities: Sequence[int], found: Sequence[Hypotheses]) -> Dots:
    """Return the dots of an octave that edges vote for where a view is seen straight ahead."""
    if not found:
        return NO_DOTS
    certain = Hypotheses.joined([read.select(read.certain) for read in found])
    rounded = rounding(certain)
    if rounded is None:
        return NO_DOTS
    outlines = _outlines(certain, octave.level)
    return oblique_dots(octave.pyramid.gray, rounded, *octave.radii, polarities, outlines)


def _outlines(explained: Hypotheses, level: int) -> np.ndarray:
    """Return the outlines of targets and dots, with a margin, px of a half of the image."""
    _, minor, _ = frame.ellipse_axes(explained.frames)
    radii = np.where(explained.certain, explained.reach / minor, 1.0) + _MARGIN
    shown = radii * minor > 2**level  # others have no edges in that half
    outlines = frame.circle_outlines(explained.frames[shown], radii[shown])
    return (outlines + 0.5) / 2**level - 0.5


def _fitted(gray: np.ndarray, dots: Dots) -> Fit:
    """Return the fits of the dots whose bands are worth reading."""
    parts = []
    for start in range(0, max(len(dots.frames), 1), PART):
        part = dots.select(slice(start, start + PART))
        fit = fit_dots(
            gray,
            part.frames,
            part.polarity,
            rays=_RAYS,
            reach=REACH,
            min_share=_MINIMUM_SHARE,
            max_contrast=_FAINTEST,
        )
        parts.append(fit)
    return Fit.joined(parts)


def report(hypotheses: Hypotheses, settings: DetectorSettings) -> list[Target]:
    """Return the targets to report: one for each dot, and one for each ID at the most."""
    major, _, _ = frame.ellipse_axes(hypotheses.frames)
    whole = settings.report_undecoded & (hypotheses.share >= _WHOLE)
    minimum, maximum = settings.radii
    of_size = (major >= minimum) & (major <= maximum)
    hypotheses = settle_same_prints(hypotheses.select(of_size), settings.families)
    whole = whole[of_size]
    hypotheses = hypotheses.select(hypotheses.certain | whole)
    hypotheses = hypotheses.select(np.lexsort((-hypotheses.margin, ~hypotheses.certain)))
    names, codes, ids = decoded(hypotheses)
    keys = np.unique(
        [f'{name} {number}' for name, number in zip(names, ids, strict=True)], return_inverse=True
    )[1]
    kept, uncontested = resolve_dots(hypotheses, keys, hypotheses.certain, hypotheses.reach)
    certain = resolve_overlaps(hypotheses, hypotheses.certain & uncontested)
    certain = resolve_ids(hypotheses, keys, certain)
    ids = np.where(certain, ids, UNDECODED)
    if not settings.report_undecoded:
        kept = kept[certain[kept]]
    some = hypotheses.select(kept)
    columns = (some.frames, some.covariance, ids[kept], codes[kept], some.confidence)
    return sorted_targets(targets_from_frames(*columns, names[kept]))
