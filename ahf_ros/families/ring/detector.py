"""Identification of ring targets that light does not break.

Dots are found by whole outlines first, and then by votes of the edges that these do not explain.
Their ellipses are fitted, their bands are decoded by likelihood, and dot and band are refined
together to a projective frame, whose origin is the image of the target's physical centre.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import numpy as np

from ahf_ros.base.blas import one_blas_thread
from ahf_ros.base.target import Target, sorted_targets
from ahf_ros.families.contract import Confirmed, DetectorSettings
from ahf_ros.families.pyramid_detector import PyramidDetector
from ahf_ros.families.ring.bands import with_measured_bands
from ahf_ros.families.ring.choice import choose_families, further_families
from ahf_ros.families.ring.confirming import read_known
from ahf_ros.families.ring.contests import among_others, resolve
from ahf_ros.families.ring.families import (
    as_described,
    contested,
    decoded,
    read_families,
    settle_same_prints,
)
from ahf_ros.families.ring.full_size import at_full_size
from ahf_ros.families.ring.hypotheses import Hypotheses
from ahf_ros.families.ring.known import WHOLE, Explained, Prior
from ahf_ros.families.ring.parts import ImagePart, dots_in, image_parts
from ahf_ros.families.ring.proposals import (
    PROPOSALS,
    Proposal,
    measure_alike,
    measure_dots,
    measure_likely,
    propose_whole,
    with_rims,
)
from ahf_ros.families.ring.refinement import refine_centres
from ahf_ros.families.undecoded import undecoded
from ahf_ros.prints.ring import RingPrint
from ahf_ros.vision import frame
from ahf_ros.vision.circle_fit import NO_FITS, Fit
from ahf_ros.vision.dots import Dots
from ahf_ros.vision.ellipse_targets import frames_of, targets_from_frames
from ahf_ros.vision.faint import faint_parts
from ahf_ros.vision.image import as_gray, check_image
from ahf_ros.vision.parts import Part
from ahf_ros.vision.pyramid import ImagePyramid, Octave, bare_pyramid, image_pyramid, octaves

_PART = 128  # dots of one colour that are read at a time


@dataclass(frozen=True, slots=True)
class RingDetector(PyramidDetector):
    """Identify ring targets (Schneider type) of one family or of several."""

    name: ClassVar[str] = 'ring'
    patience: ClassVar[int] = 2

    @property
    def design(self) -> tuple[RingPrint, ...]:
        """Printed designs of the families."""
        return self.settings.codes(RingPrint)

    def search(self, pyramid: ImagePyramid) -> list[Target]:
        """Identify the targets of one image; see `Searching`."""
        return self.explain(pyramid)[0]

    @one_blas_thread()
    def explain(self, pyramid: ImagePyramid) -> tuple[list[Target], np.ndarray]:
        """Identify the targets of one image, and say what dots are left; see `Explaining`."""
        read = hypotheses_in if self.stretches else read_pyramid
        hypotheses = read(pyramid, self.settings, self.expected)
        found = report(hypotheses, self.settings, self.contested)
        return found, unexplained(hypotheses).frames

    @one_blas_thread()
    def confirm(self, image: np.ndarray, targets: Sequence[Target]) -> Confirmed:
        """Return what an image shows in the places of targets; see `Confirming`."""
        check_image(image)
        pyramid = bare_pyramid(as_gray(image), self.settings.max_radius)
        described = {code.name for code in self.design}
        targets = [it for it in targets if it.family in described]
        names = {it.family for it in targets}
        shown = [code for code in self.design if code.name in names]
        of_image = pyramid, self.settings, self.expected
        read = read_known(*of_image, targets)
        found, known = report(read, self.settings, self.contested), {it.print for it in targets}
        others = [it for it in found if it.print not in known]
        if others:  # one reading of a dot is not enough for what was not seen there before
            read = read.select(~read.on_dots(frames_of(others)))
            found = [it for it in found if it.print in known]

        @one_blas_thread()
        def search(parts: Sequence[Part]) -> list[Target]:
            views = image_parts(pyramid.image, parts, self.settings.max_radius)
            of_parts = read_pyramid(*of_image, PROPOSALS, shown, views, read)
            for it in views:
                of_parts = _with_faint_parts(it, of_parts, self.settings, self.expected)
            return report(of_parts, self.settings, self.contested)

        return Confirmed(found, search)

    @one_blas_thread()
    def refine(self, image: np.ndarray, targets: Sequence[Target]) -> list[Target]:
        """Return targets with their centres in an image; see `refine_centres`."""
        polarities = self.settings.polarities
        return refine_centres(image, targets, self.design, polarities, self.expected)


def find_hypotheses(
    gray: np.ndarray, settings: DetectorSettings, expected: frozenset[int] = frozenset()
) -> Hypotheses:
    """Return all dots of an image and the words that their bands may show, before any decision.

    Parts of faint contrast are stretched and read as images of their own. Of what they show, only
    certain words that the image itself does not show are added. `gray` may be uint8 as well.
    """
    return hypotheses_in(image_pyramid(gray, settings.max_radius), settings, expected)


def hypotheses_in(
    pyramid: ImagePyramid, settings: DetectorSettings, expected: frozenset[int]
) -> Hypotheses:
    """Find the dots and words in an image pyramid; see `find_hypotheses`."""
    found = read_pyramid(pyramid, settings, expected)
    return _with_faint_parts(ImagePart(0, 0, pyramid), found, settings, expected)


def _with_faint_parts(
    view: ImagePart, found: Hypotheses, settings: DetectorSettings, expected: frozenset[int]
) -> Hypotheses:
    """Return what was found in an image, and what parts of faint contrast show beside it."""
    for part in faint_parts(view.pyramid.image):
        seen = read_image(part.gray, settings, expected, (propose_whole,))
        seen = seen.select(seen.certain)
        x, y = view.x + part.x, view.y + part.y
        seen = replace(seen, frames=frame.translated(seen.frames, x, y))
        new = ~seen.on_dots(found.frames[found.certain])
        found = Hypotheses.joined([found, seen.select(new)])
    return found


def read_image(
    gray: np.ndarray,
    settings: DetectorSettings,
    expected: frozenset[int] = frozenset(),
    proposals: Sequence[Proposal] = PROPOSALS,
) -> Hypotheses:
    """Return the dots and words that an image shows at its own contrast.

    Dots are proposed in several ways, one after the other. What is read of the dots of one
    explains edges, which the next ones need not look at.
    """
    return read_pyramid(image_pyramid(gray, settings.max_radius), settings, expected, proposals)


@dataclass(frozen=True, slots=True)
class _Seen:
    """What was read of an image so far, and what this explains, in px of the image."""

    found: tuple[Hypotheses, ...]
    explained: Explained

    def after(self, read: Hypotheses) -> _Seen:
        """Return the same with what was read next."""
        explained = Explained.joined([self.explained, Explained.by(read)])
        return _Seen((*self.found, read), explained)

    @property
    def targets(self) -> Explained:
        """The certain targets that were read."""
        return self.explained.select(self.explained.certain)

    def left(self, dots: Fit, level: int) -> Fit:
        """Return the dots of the image halved `level` times that lie on no certain target."""
        return dots.select(~self.targets.on_them(dots.frames, level))

    def with_targets(self, later: _Seen) -> _Seen:
        """Return the same with what is certain of all that was read until `later`."""
        seen = self
        for read in later.found[len(self.found) :]:
            seen = seen.after(read.select(read.certain))
        return seen

    def prior(self, expected: frozenset[int], level: int) -> Prior:
        """Return what is known of targets in the image halved `level` times."""
        return Prior.after(expected, self.targets.shifts / 2**level)


def read_pyramid(
    pyramid: ImagePyramid,
    settings: DetectorSettings,
    expected: frozenset[int],
    proposals: Sequence[Proposal] = PROPOSALS,
    shown: Sequence[RingPrint] = (),
    parts: Sequence[ImagePart] | None = None,
    before: Hypotheses | None = None,
) -> Hypotheses:
    """Find the dots and words in an image pyramid, or in parts of it; see `read_image`.

    What was read of the image before is part of the result.

    Without families that are known to be shown, a glance at the clearest dots tells them, or a
    closer look in the end. Dots that were left unread until then are read with these.
    """
    families: Sequence[RingPrint] = settings.codes(RingPrint)
    polarities = settings.polarities
    shown = list(families if len(families) == 1 else shown)
    images = pyramid.images
    begin = before if before is not None else Hypotheses.unread(NO_FITS, families[0])
    seen = _Seen((begin,), Explained.by(begin))
    measured: list[tuple[Octave, Fit]] = []
    every = settings.report_undecoded
    again = partial(
        read_pyramid, pyramid, settings, expected, proposals, parts=parts, before=before
    )
    for octave in octaves(pyramid, *settings.radii):
        fits = [NO_FITS]
        for propose in proposals:
            part = None  # proposals take memory of their own
            search = partial(_proposed, propose, polarities)
            proposed = dots_in(parts, octave, seen.explained, search)
            if not len(proposed.frames):
                continue
            part = octave.pyramid.gray
            proposed = with_rims(proposed, families, octave.radii[0])
            dots = measure_dots(part, proposed, covariances=every)
            families = with_measured_bands(part, dots, families)
            by_name = {code.name: code for code in families}
            shown = [by_name[code.name] for code in shown]
            if not shown:
                shown = choose_families(part, dots, families)
                if shown and any(len(read.words) for read in seen.found):
                    return again(shown)
            codes = shown or families[:1]
            likely, others = NO_FITS, dots
            if shown or every:
                likely, others = measure_likely(part, dots, None if every else codes)
            unread = Hypotheses.unread(others, families[0])
            seen = seen.after(at_full_size(images[: octave.level + 1], unread))
            seen = _read(part, octave, images, likely, codes, seen, expected, every=every)
            fits.append(dots)
        measured.append((octave, Fit.joined(fits)))
    for octave, _ in measured if shown and (pyramid.edges or parts) else ():
        alike = dots_in(parts, octave, seen.targets, lambda it, known: known.alike(it))
        seen = _with_alike(octave, images, shown, alike, seen, expected)
    for octave, dots in measured:
        while left := [code for code in families if code not in shown]:
            part = octave.pyramid.gray
            rest = seen.left(dots, octave.level)
            codes = further_families(part, rest, left, shown)
            if not codes:
                break
            if not shown:
                return again(codes)
            clear = seen.explained.select(seen.explained.clear)
            dots = dots.select(~clear.on_them(dots.frames, octave.level))
            likely, _ = measure_likely(part, dots, codes)
            seen = _read(part, octave, images, likely, codes, seen, expected, every=every)
            shown = shown + codes
    read = Hypotheses.joined(seen.found)
    if len(shown) > 1:
        read = contested(read)
    return as_described(read, settings.codes(RingPrint))


def _proposed(
    propose: Proposal, polarities: Sequence[int], octave: Octave, explained: Explained
) -> Dots:
    return propose(octave, polarities, explained)


def _with_alike(
    octave: Octave,
    images: Sequence[np.ndarray],
    codes: Sequence[RingPrint],
    alike: Dots,
    seen: _Seen,
    expected: frozenset[int],
) -> _Seen:
    """Return what is seen once dots in the shapes of certain targets about them are read as well.

    All else was read in the shape of the dots.
    """
    if not len(alike.frames):
        return seen
    gray = octave.pyramid.gray
    likely = measure_alike(gray, alike)
    return seen.with_targets(
        _read(gray, octave, images, likely, codes, seen, expected, every=False)
    )


def _read(
    gray: np.ndarray,
    octave: Octave,
    images: Sequence[np.ndarray],
    dots: Fit,
    codes: Sequence[RingPrint],
    seen: _Seen,
    expected: frozenset[int],
    *,
    every: bool,
) -> _Seen:
    """Return what is seen once dots are read in the image of an octave, the most hopeful first.

    Thousands of spots of light or letters look a little like dots with a band. They are mostly of
    one colour, and must not crowd out the other. Where a part of the dots of a colour shows no
    target, less hopeful ones are left unread, unless `every` one is asked for.
    """
    left = [dots.select(dots.polarity == polarity) for polarity in (1, -1)]
    while any(len(of.frames) for of in left):
        part = Fit.joined([of.select(slice(_PART)) for of in left])
        prior = seen.prior(expected, octave.level)
        read = read_families(gray, part, codes, prior)
        seen = seen.after(at_full_size(images[: octave.level + 1], read))
        shown = set(read.polarity[read.certain])
        for index, polarity in enumerate((1, -1)):
            rest = left[index].select(slice(_PART, None))
            if not (every or polarity in shown):
                unread = Hypotheses.unread(rest, codes[0])
                seen = seen.after(at_full_size(images[: octave.level + 1], unread))
                rest = NO_FITS
            left[index] = rest
    return seen


def unexplained(hypotheses: Hypotheses) -> Hypotheses:
    """Return the dots on no certain target whose edges are where they should be."""
    explained = Explained.by(hypotheses.select(hypotheses.certain))
    dots = hypotheses.in_place & hypotheses.exact
    left = hypotheses.select(dots & ~hypotheses.certain)
    return left.select(~explained.on_them(left.frames, 0))


def report(
    hypotheses: Hypotheses, settings: DetectorSettings, contested: bool = False
) -> list[Target]:
    """Return the targets to report: one for each dot, and one for each ID of a colour at the most.

    Certain ones that others contradict are among them, undecoded, if `contested`.
    """
    major, _, _ = frame.ellipse_axes(hypotheses.frames)
    whole = settings.report_undecoded & (hypotheses.share >= WHOLE)
    of_size = settings.of_size(major)
    hypotheses = among_others(hypotheses.select(of_size))
    hypotheses = settle_same_prints(hypotheses, settings.codes(RingPrint))
    whole = whole[of_size]
    hypotheses = hypotheses.select(hypotheses.certain | whole)
    hypotheses = hypotheses.select(np.argsort(-hypotheses.confidence, kind='stable'))
    names, codes, ids = decoded(hypotheses)
    prints = zip(names, ids, hypotheses.polarity, strict=True)
    keys = np.unique([' '.join(map(str, it)) for it in prints], return_inverse=True)[1]
    kept, certain = resolve(hypotheses, keys)
    if not settings.report_undecoded:
        kept = kept & hypotheses.certain if contested else certain
    some = hypotheses.select(kept)
    columns = (some.frames, some.covariance, ids[kept], codes[kept], some.confidence)
    targets = targets_from_frames(*columns, names[kept], some.print_growth, some.polarity)
    return sorted_targets(
        target if is_certain else undecoded(target, 'contested' if is_sure else 'uncertain')
        for target, is_certain, is_sure in zip(
            targets, certain[kept].tolist(), some.certain.tolist(), strict=True
        )
    )
