"""Identification of ring targets that light does not break.

Dots are found by whole outlines first, and then by votes of the edges that these do not explain.
Their ellipses are fitted, their bands are decoded by likelihood, and dot and band are refined
together to a projective frame, whose origin is the image of the target's physical centre.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial

import numpy as np

from ahf_ros.codes.ring import Family, family
from ahf_ros.detectors.contract import DetectorSettings
from ahf_ros.detectors.ring.competition import PART, by_clear_dots, read_families
from ahf_ros.detectors.ring.explained import NOTHING, WHOLE, Explained
from ahf_ros.detectors.ring.faint import with_faint
from ahf_ros.detectors.ring.full_size import at_full_size
from ahf_ros.detectors.ring.glance import may_be_targets
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
from ahf_ros.features.circle_fit import NO_FITS, Fit, fit_dots
from ahf_ros.features.dot_search import voted_dots, whole_dots
from ahf_ros.features.dots import NO_DOTS, Dots
from ahf_ros.features.ellipse_targets import targets_from_frames
from ahf_ros.features.pyramid import Octave, image_pyramid, octaves
from ahf_ros.imaging.image import as_gray, check_image
from ahf_ros.target import UNDECODED, Target, UndecodedTarget, sorted_targets

_RAYS = 24  # about a dot
_MINIMUM_SHARE = 0.5  # of the edge of a dot, for its band to be read
_UNLIKELY = 0.02  # confidence of a word below which a dot counts as unread
_FAINTEST = 0.8  # contrast of a dot, dark over bright, for its band to be read


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
    def patience(self) -> int:
        """Filters tried in vain after which a search ends; see `Discerning`."""
        return 2

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
    explained = NOTHING

    def explain(read: Hypotheses, level: int) -> Hypotheses:
        nonlocal explained
        whole = at_full_size(images[: level + 1], read)
        explained = Explained.joined([explained, Explained.by(whole)])
        return whole

    for octave in octaves(pyramid, *settings.radii):
        gray = octave.pyramid.gray
        parts: list[tuple[Fit, Hypotheses]] = []
        unlikely = NO_FITS
        for search in (_whole,) if whole_only else (_whole, _voted, _oblique):
            dots = search(octave, settings.polarities, explained)
            if not len(dots.frames):
                continue
            fits, others = _fitted(gray, dots, families, settings)
            explain(Hypotheses.unread(others, families[0]), octave.level)
            if not explained.certain.any():
                families = by_clear_dots(gray, fits, families)
            read = read_families(gray, fits, families, expected)
            parts.append((fits, read))
            unlikely = Fit.joined([unlikely, others])
            found.append(explain(read, octave.level))
        # What is out of focus is sharper in the next half.
        for level in range(octave.level + 1, 0 if whole_only else len(images)):
            again = partial(_fitted_again, gray, settings=settings)
            blurred = soft_dots(parts, unlikely, again)
            if not len(blurred.frames):
                break
            gray = images[level].astype(np.float32, copy=False)
            few = len(blurred.frames) <= PART  # which are read however little they show
            fits, unlikely = _fitted(gray, blurred, families, settings, every=few)
            parts = [(fits, read_families(gray, fits, families, expected))]
            found.append(explain(parts[0][1], level))
    if not found:
        return Hypotheses.unread(NO_FITS, families[0])
    return Hypotheses.joined(found)


def _whole(octave: Octave, polarities: Sequence[int], _explained: Explained) -> Dots:
    """Return the dots of an octave with a whole outline."""
    return whole_dots(octave.pyramid, *octave.radii, polarities)


def _voted(octave: Octave, polarities: Sequence[int], explained: Explained) -> Dots:
    """Return the dots of an octave that edges vote for which nothing explains yet."""
    outlines = explained.outlines_in(octave.level)
    return voted_dots(octave.pyramid, *octave.radii, polarities, explained=outlines)


def _oblique(octave: Octave, polarities: Sequence[int], explained: Explained) -> Dots:
    """Return the dots of an octave that edges vote for where a view is seen straight ahead."""
    certain = explained.select(explained.certain)
    rounded = rounding(certain.frames)
    if rounded is None:
        return NO_DOTS
    outlines = explained.select(explained.clear).outlines_in(octave.level)
    return oblique_dots(octave.pyramid.gray, rounded, *octave.radii, polarities, outlines)


def _fitted(
    gray: np.ndarray,
    dots: Dots,
    families: Sequence[Family],
    settings: DetectorSettings,
    every: bool = False,
) -> tuple[Fit, Fit]:
    """Return the fits of the dots whose bands are worth reading, or of every one, and of others.

    Those are measured once, which is enough to see that they are no targets.
    """
    worth, others = [], []
    for start in range(0, max(len(dots.frames), 1), PART):
        part = dots.select(slice(start, start + PART))
        once = _fit_once(gray, part.frames, part.polarity, settings)
        likely = np.ones(len(once.frames), bool)
        if not every and not settings.report_undecoded:
            likely = may_be_targets(gray, once.frames, families, many=len(dots.frames) > PART)
        others.append(once.select(~likely))
        worth.append(_fitted_again(gray, once.select(likely), settings))
    return Fit.joined(worth), Fit.joined(others)


def _fitted_again(gray: np.ndarray, once: Fit, settings: DetectorSettings) -> Fit:
    """Return better fits of dots whose edges are where those of a dot are."""
    fit = _fit_once(gray, once.frames, once.polarity, settings, once.blur)
    return fit.select((fit.share >= _MINIMUM_SHARE) & (fit.contrast <= _FAINTEST))


def _fit_once(
    gray: np.ndarray,
    frames: np.ndarray,
    polarity: np.ndarray,
    settings: DetectorSettings,
    blur: np.ndarray | None = None,
) -> Fit:
    return fit_dots(
        gray,
        frames,
        polarity,
        rays=_RAYS,
        reach=REACH,
        rounds=1,
        blur=blur,
        covariances=settings.report_undecoded,
    )


def report(hypotheses: Hypotheses, settings: DetectorSettings) -> list[Target]:
    """Return the targets to report: one for each dot, and one for each ID at the most."""
    major, _, _ = frame.ellipse_axes(hypotheses.frames)
    whole = settings.report_undecoded & (hypotheses.share >= WHOLE)
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
    if not settings.report_undecoded:
        kept = kept[certain[kept]]
    likely, ids = ids[kept], np.where(certain, ids, UNDECODED)
    some = hypotheses.select(kept)
    columns = (some.frames, some.covariance, ids[kept], codes[kept], some.confidence)
    targets = targets_from_frames(*columns, names[kept])
    rows = zip(targets, some.certain.tolist(), names[kept].tolist(), likely.tolist(), strict=True)
    return sorted_targets(_explained(*row) for row in rows)


def _explained(target: Target, certain: bool, likely_family: str, likely_id: int) -> Target:
    """Return a target, with the reason if it is not decoded.

    Parameters
    ----------
    target : Target
    certain : bool
        Whether its word alone was certain.
    likely_family, likely_id
        Of its most likely word.
    """
    if target.id != UNDECODED:
        return target
    if not certain and target.confidence < _UNLIKELY:
        return UndecodedTarget(**asdict(target), reason='unread')
    reason = 'contested' if certain else 'uncertain'
    return UndecodedTarget(
        **asdict(target), reason=reason, likely_id=likely_id, likely_family=likely_family
    )
