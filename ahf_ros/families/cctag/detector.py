"""Identification of CCTags by the profile of their rings.

Blur makes narrow rings gray, so that the outermost circle has half the contrast of a dot: the
logarithm of the image is doubled, and dots are found as all dots are. Any of the circles may be
found. A glance at the mean profile along the radius drops what does not look like rings. About
what is left, the rings of several IDs are brought onto the image, and the best ones are reported.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import ClassVar

import numpy as np

from ahf_ros.base.blas import one_blas_thread
from ahf_ros.base.target import UNDECODED, Target, sorted_targets
from ahf_ros.families.cctag.alignment import align
from ahf_ros.families.cctag.full_size import fit_rings, is_sharp
from ahf_ros.families.cctag.glance import LARGEST, Circles, likely_rings
from ahf_ros.families.cctag.joint import contested, jointly
from ahf_ros.families.cctag.light import EDGES, Lights, shares_alike
from ahf_ros.families.cctag.prior import Prior
from ahf_ros.families.cctag.rays import is_drawing, of_drawing
from ahf_ros.families.cctag.reading import identify, in_light, likely_lights, show_the_same
from ahf_ros.families.cctag.rings import Aligned
from ahf_ros.families.claims import owners
from ahf_ros.families.contract import moved_targets
from ahf_ros.families.pyramid_detector import PyramidDetector
from ahf_ros.prints import CCTAG_NAMES
from ahf_ros.prints.cctag import CctagPrint, circle_family
from ahf_ros.vision import frame
from ahf_ros.vision.candidates import find_peaks, votes_along
from ahf_ros.vision.circle_fit import ENOUGH
from ahf_ros.vision.dot_search import voted_dots, whole_dots
from ahf_ros.vision.dots import Dots
from ahf_ros.vision.ellipse_targets import ellipse_fields, frames_of, stayed, targets_from_frames
from ahf_ros.vision.image import as_gray, check_image
from ahf_ros.vision.large_targets import targets_of_octaves
from ahf_ros.vision.log_edges import LogEdges, edges_in_bands
from ahf_ros.vision.pyramid import ImagePyramid, Octave, octaves

_COLOURS = 1, -1  # of circles that are looked for
_BEYOND = 1.1  # times a bound of the radius, by how much circles may be beyond it
_INNERMOST = 0.25  # of the radii of circles that are looked for
_COMMON_CENTRE = 8.0, 20.0  # radii of targets whose rings vote together, px
_FACING = 11.5  # distance up to which they vote, px
_FAINT = 3.0  # of their contrast, which narrow rings have little of
_MOST_FAINT = 0.1  # share of pixels on such edges; of more, the strongest are taken
_TELLING = 0.98  # confidence of targets that tell of others
_CLEAR_OF_RIVALS = 19.0  # odds of the place of an ID against all others
_SURE = 0.999  # confidence of targets that neither rivals nor another family put in doubt
_PROBABLE = 0.5  # confidence of targets that tell of edges together
_POSSIBLE = 0.01  # probability of a target, from which it is read again
_ALIKE = 0.25  # share of what rays show, the same on all in light without edges
_IN_A_ROW = 32  # likely frames without a target, which hardly any others precede
_CERTAIN = 0.75  # confidence from which a target is reported
_SURE_OF_TARGET = 0.9  # probability of a target, from which it is reported without its ID
_LARGE = 6.0  # narrow rings, px, whose edges are measured one by one where they are sharp
_OF_RAYS = 160.0  # semi-minor axis, px, up to which rays have places enough for soft edges
_PLAUSIBLE = 0.6  # share of rays that agree, of a target that is measured again
_SAME_PLACE = 0.5  # distance of two readings of one target, radii
_OVERLAPPING = 0.7  # distance up to which targets overlap, sums of their radii


@dataclass(frozen=True, slots=True)
class CctagDetector(PyramidDetector):
    """Identify the CCTags of one family or of several."""

    name: ClassVar[str] = 'cctag'
    contrast: ClassVar[int] = 2  # for circles that blur makes gray

    @property
    def design(self) -> tuple[CctagPrint, ...]:
        """Printed designs of the families."""
        return self.settings.codes(CctagPrint)

    @one_blas_thread()
    def search(self, pyramid: ImagePyramid) -> list[Target]:
        """Identify the targets of one image; see `Searching`."""
        found = self.in_any_contrast(_unclipped(pyramid), self._of_pyramid)
        return sorted_targets(self.reported(found, 1.0, _CERTAIN))

    def _of_pyramid(self, pyramid: ImagePyramid) -> list[Target]:
        """Return what a pyramid shows, some of it twice."""
        radii = self.settings.radii
        kinds = list(product(self.settings.polarities, self.design))
        looks = _looks(list(octaves(pyramid, *radii)), kinds, Prior(expected=self.expected))

        def identify(octave: Octave) -> list[Target]:
            return self._identify(octave.pyramid.gray, looks[octave.level])

        return targets_of_octaves(pyramid, radii, identify, self.refine)

    @one_blas_thread()
    def refine(self, image: np.ndarray, targets: Sequence[Target]) -> list[Target]:
        """Return targets with the places that their rings have in an image; see `Refiner`.

        Targets that are not decoded, and those whose rings are not found near to where they should
        be, stay as they are.
        """
        check_image(image)
        gray = as_gray(image).astype(np.float32, copy=False)
        if is_drawing(gray):
            gray = of_drawing(gray)
        refined = list(targets)
        for family in self.design:
            known = [it for it in targets if it.id != UNDECODED and it.family == family.name]
            placed = _placed_by_edges(gray, known, family)
            refined = [placed.get(it, it) for it in refined]
            known = [it for it in known if it not in placed and it.semi_minor <= _OF_RAYS]
            if not known:
                continue
            start = frames_of(known)
            usual = Prior()
            edges = np.array(
                [(it.edge_shift or 0.0, usual.blur, usual.sharpening) for it in known]
            )
            ids = np.array([it.id for it in known])
            of = align(gray, start, ids, edges, family)
            light, of, _ = in_light(gray, of, family)
            good = stayed(of.frames, start) & (of.rays >= _PLAUSIBLE)
            of = of.replaced(good, jointly(gray, light, of.select(good), family))
            places = ellipse_fields(of.frames, of.covariance, of.edge_shift)
            refined = moved_targets(refined, known, places, good)
        return refined

    def _identify(self, gray: np.ndarray, looks: Sequence[_Look]) -> list[Target]:
        """Return the targets of an octave, in its pixels."""
        found = []
        for look in looks:
            if not len(look.frames):
                continue
            rings, light = _identified(gray, look)
            rings = _single(_together(rings))
            if not self._shown(rings).any():  # rivals and pixels make none sure without others
                continue
            rings = _owned(light, rings, look.polarity, look.family)
            rings = contested(gray, light, rings, look.polarity, look.family)
            found += self._targets(_single(rings), look)
        return found

    def _shown(self, rings: Aligned) -> np.ndarray:
        """Return which readings are sure enough to be reported, (k,)."""
        unread = self.settings.report_undecoded & (rings.of_target >= _SURE_OF_TARGET)
        return unread | (rings.confidence >= _CERTAIN)

    def _targets(self, rings: Aligned, look: _Look) -> list[Target]:
        """Return the targets of the readings that are sure enough, with their likeliest IDs."""
        rings = rings.select(self._shown(rings))
        return targets_from_frames(
            *(rings.frames, rings.covariance, rings.ids, rings.ids, rings.confidence),
            *(look.family.name, rings.edge_shift, look.polarity),
        )


@dataclass(frozen=True, slots=True)
class _Look:
    """What looks like targets of one colour and family in an octave."""

    polarity: int
    family: CctagPrint
    frames: np.ndarray  # (k, 3, 3), the likeliest first
    lights: Lights  # about those of the first that may be targets, of one edge at the most
    prior: Prior  # before any target is read


def _looks(
    of_octaves: Sequence[Octave], kinds: Sequence[tuple[int, CctagPrint]], prior: Prior
) -> dict[int, list[_Look]]:
    """Return what looks like targets of some colours and families, by the levels of octaves."""
    if not of_octaves:
        return {}
    circles = []
    for number, (octave, of) in enumerate(zip(of_octaves, _circles(of_octaves), strict=True)):
        for dots, largest in ((of, LARGEST), *_common_centres(octave)):
            circles.append(Circles.at(octave.pyramid.gray, dots, number, largest))
    every = Circles.joined(circles)
    if not len(every.frames):
        return {octave.level: [] for octave in of_octaves}
    frames = likely_rings(every, [it.radii for it in of_octaves], kinds)
    return {
        octave.level: [
            _Look(*kind, some, light, prior)
            for kind, some, light in zip(
                kinds, own, _first_lights(octave.pyramid.gray, own), strict=True
            )
        ]
        for octave, own in zip(of_octaves, frames, strict=True)
    }


def _first_lights(gray: np.ndarray, frames: Sequence[np.ndarray]) -> list[Lights]:
    """Return light of one edge about the first frames of all kinds in an image.

    Frames that do not show the same all around have none, nor those that no edge of light could
    make do so.
    """
    first = [it[:_IN_A_ROW] for it in frames]
    # Kinds often share frames.
    every, back = np.unique(np.concatenate(first).reshape(-1, 9), axis=0, return_inverse=True)
    every = every.reshape(-1, 3, 3)
    some = np.flatnonzero(shares_alike(gray, every) >= _ALIKE)
    lights = Lights.about(gray, every[some], 1)
    same = show_the_same(gray, lights)
    lights, row = lights.select(same), np.full(len(every), -1)
    row[some[same]] = np.arange(len(lights.frames))
    rows = np.split(row[back.ravel()], np.cumsum([*map(len, first[:-1])]))
    return [lights.select(of[of >= 0]) for of in rows]


def _identified(gray: np.ndarray, look: _Look) -> tuple[Aligned, np.ndarray]:
    """Return the readings of targets of one colour, and the image of light that they are of.

    A first reading knows one edge of light. Where it shows likely targets, all are read with more,
    and doubtful ones with what certain ones show.
    """
    polarity, family = look.polarity, look.family
    rings, count = _first_readings(gray, look)
    frames = look.frames[:count]
    possible = _best(rings, look.prior)
    if not len(possible.ids):
        return possible, gray
    light, again, lights = in_light(gray, possible, family)
    placed = again.of_target >= _SURE_OF_TARGET
    if not placed.any():
        return possible, gray
    camera = look.prior.of_camera(again.select(placed))
    # Where one edge of light leaves no doubt, others are not looked for.
    sure = (possible.confidence >= _SURE) & (again.of_target >= _SURE)
    told = replace(again, margin=possible.margin).select(sure)
    lights = lights.select(placed & ~sure)
    known = lights.select(show_the_same(light, lights))
    others = _free(frames, told.frames) & _alone(frames, lights.frames)
    lights = Lights.joined([known, likely_lights(light, frames[others])])
    again = identify(light, lights, polarity, family, camera)
    rings = _best(_renewed(rings, Aligned.joined([told, again])), camera)
    sure = rings.of_target >= _SURE_OF_TARGET
    prior = look.prior.after(rings.select(sure & (rings.confidence >= _PROBABLE)))
    if prior == camera:
        return rings, light
    rings = _best(rings, prior)
    certain = rings.confidence >= _TELLING
    doubtful = rings.frames[~certain]
    others = lights.select(_free(lights.frames, rings.frames[certain]))
    lights = Lights.joined([others, likely_lights(light, doubtful)])
    again = _readings(light, lights, polarity, family, prior)
    rings = _best(_renewed(rings, again), prior)
    return rings, light


def _first_readings(gray: np.ndarray, look: _Look) -> tuple[Aligned, int]:
    """Return readings in light of one edge at the most, and how many frames were looked at.

    Those that are most like rings come first, and with them the targets. Where none of so many in
    a row may be one, the others are texture.
    """
    kind = look.polarity, look.family, look.prior, 1
    found, count = [identify(gray, look.lights, *kind)], _IN_A_ROW
    while (found[-1].of_target >= _POSSIBLE).any() and count < len(look.frames):
        some = look.frames[count : count + _IN_A_ROW]
        found.append(identify(gray, likely_lights(gray, some, 1), *kind))
        count += _IN_A_ROW
    return Aligned.joined(found), count


def _readings(
    gray: np.ndarray, lights: Lights, polarity: int, family: CctagPrint, prior: Prior
) -> Aligned:
    """Return readings of targets in their lights, and of doubtful ones in light of less edges."""
    found = identify(gray, lights, polarity, family, prior)
    for most in range(EDGES - 1, 0, -1):
        certain = found.frames[found.confidence >= _TELLING]
        more = lights.select((lights.counts > most) & _free(lights.frames, certain))
        less = likely_lights(gray, more.frames, most)
        found = Aligned.joined([found, identify(gray, less, polarity, family, prior, most)])
    return found


def _renewed(rings: Aligned, again: Aligned) -> Aligned:
    """Return readings; what is read again is read with more knowledge than before."""
    return Aligned.joined([rings.select(_alone(rings.frames, again.frames)), again])


def _best(rings: Aligned, prior: Prior) -> Aligned:
    """Return the likeliest reading of each place, whose rivals are also those of other IDs."""
    rings = rings.select(rings.of_target >= _POSSIBLE)
    cost = prior.cost(rings, frame.mean_radii(rings.frames))
    rings = rings.select(np.argsort(cost, kind='stable'))
    near, size = _near(rings.frames, rings.frames), frame.mean_radii(rings.frames)
    kept, margin = np.flatnonzero(owners(len(size), near.T.__getitem__)), rings.margin.copy()
    for index in kept.tolist():
        cost = prior.cost(rings, size[index])
        others = cost[near[:, index] & (rings.ids != rings.ids[index])] - cost[index]
        margin[index] = min(margin[index], others.min(initial=np.inf))
    return replace(rings, margin=margin).select(kept)


def _near(frames: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return whether targets (k, 3, 3) are at the places of others (n, 3, 3), shape (k, n)."""
    return _away(frames, others) < _SAME_PLACE * frame.mean_radii(others)


def _alone(frames: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return whether targets, (k, 3, 3), are at the place of no other, (n, 3, 3), shape (k,)."""
    return np.logical_not(_near(frames, others).any(axis=1))


def _free(frames: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return whether targets, (k, 3, 3), overlap no other, (n, 3, 3), shape (k,)."""
    reach = _OVERLAPPING * (frame.mean_radii(frames)[:, None] + frame.mean_radii(others))
    return np.logical_not((_away(frames, others) < reach).any(axis=1))


def _away(frames: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return the distances of targets (k, 3, 3) from others (n, 3, 3), px, shape (k, n)."""
    return np.hypot(*(frames[:, None, :2, 2] - others[None, :, :2, 2]).transpose(2, 0, 1))


def _together(rings: Aligned) -> Aligned:
    """Return the readings, in doubt where most of what may be targets of an image is not read.

    Print and camera are the same for all. Where few readings are likely to be right, they may be
    unlike what is expected, so that others are wrong.
    """
    right = float(rings.confidence.sum())
    doubt = max(float(np.log((len(rings.ids) - right + 1) / (right + 1))), 0.0)
    return replace(rings, unusual=rings.unusual + doubt)


def _single(rings: Aligned) -> Aligned:
    """Return the readings less those of IDs that are read in doubt in too many other places.

    An ID is there once. Texture repeats itself: any of the places may be the right one.
    """
    odds = rings.confidence / np.maximum(1 - rings.confidence, 1e-9)
    rivals = (rings.ids[:, None] == rings.ids) & ~_near(rings.frames, rings.frames)
    of_rivals = rivals @ np.where(rings.confidence < _SURE, odds, 0.0)
    single = (odds / (1 + odds) >= _CERTAIN) & (odds >= _CLEAR_OF_RIVALS * of_rivals)
    return rings.select(single | (rings.confidence < _CERTAIN))


def _owned(gray: np.ndarray, rings: Aligned, polarity: int, family: CctagPrint) -> Aligned:
    """Return the readings; what other families make of doubtful targets are rivals, too.

    The more targets of an image are of the family, the likelier are the others.
    """
    likely = np.flatnonzero(rings.of_target >= _CERTAIN)
    doubtful = likely[rings.confidence[likely] < _SURE]
    own, usual, against = rings.select(doubtful), Prior(), np.full(len(rings.ids), np.inf)
    size = frame.mean_radii(own.frames)
    cost = usual.cost(own, size)
    for name in CCTAG_NAMES:
        if name == family.name:
            continue
        lights = likely_lights(gray, own.frames)
        others = identify(gray, lights, polarity, circle_family(name), usual)
        others = others.select(others.of_target >= _CERTAIN)
        near = _near(own.frames, others.frames)
        for row, index in enumerate(doubtful.tolist()):
            of_rivals = usual.cost(others.select(near[row]), size[[row]]) - cost[row]
            against[index] = min(against[index], of_rivals.min(initial=np.inf))
    beaten = (against < 0).sum()
    of_family = np.log((len(likely) - beaten + 1) / (beaten + 1))
    return replace(rings, margin=np.minimum(rings.margin, against + of_family))


def _placed_by_edges(
    gray: np.ndarray, targets: Sequence[Target], family: CctagPrint
) -> dict[Target, Target]:
    """Return the large ones of targets whose edges are sharp, in the places of these."""
    large = [it for it in targets if it.semi_minor * family.narrow >= _LARGE]
    large = [it for it in large if is_sharp(gray, it, family)]
    placed: dict[Target, Target] = {}
    for number, polarity in sorted({(it.id, it.polarity) for it in large}):
        some = [it for it in large if (it.id, it.polarity) == (number, polarity)]
        start = frames_of(some)
        fit = fit_rings(gray, start, number, np.full(len(some), polarity), family)
        good = (fit.share >= ENOUGH) & stayed(fit.frames, start)
        places = ellipse_fields(fit.frames, fit.covariance, fit.growth)
        placed |= {
            it: replace(it, **of) for it, of, ok in zip(some, places, good, strict=True) if ok
        }
    return placed


def _circles(of_octaves: Sequence[Octave]) -> list[Dots]:
    """Return dots that may be circles of targets of any colour, in px of each octave."""
    first, last = of_octaves[0], of_octaves[-1]
    pyramid, low = first.pyramid, first.radii[0]
    high = last.radii[1] * 2 ** (last.level - first.level)
    voted = voted_dots(pyramid, low * _INNERMOST, high, _COLOURS)
    major = frame.ellipse_axes(voted.frames)[0]
    found = []
    for octave in of_octaves:
        least, largest = octave.radii[0] * _INNERMOST, octave.radii[1]
        whole = whole_dots(octave.pyramid, least, largest, _COLOURS)
        level = octave.level - first.level
        own = major / 2**level
        of_size = voted.select((own * _BEYOND >= least) & (own <= largest * _BEYOND))
        reduced = replace(of_size, frames=frame.enlarged(of_size.frames, -level))
        found.append(Dots.joined([whole, reduced]))
    return found


def _common_centres(octave: Octave) -> list[tuple[Dots, float]]:
    """Return circles about the points that the edges of many circles face.

    Narrow rings are too close for a dot to be told from the next, and blur takes their contrast.
    What they share is the centre. The colour is unknown. The number is how many times larger the
    outermost circles may be.
    """
    low, high = max(octave.radii[0], _COMMON_CENTRE[0]), min(octave.radii[1], _COMMON_CENTRE[1])
    if octave.level or low >= high:
        return []
    log = octave.pyramid.logs[0]
    edges = LogEdges.joined([it.curved(2 * _FACING) for it in edges_in_bands(log, _FAINT)])
    most = int(_MOST_FAINT * log.size)
    if len(edges.x) > most:
        weakest = np.partition(edges.strength, -most)[-most]
        edges = edges.select(edges.strength >= weakest)
    steps = np.arange(1, _FACING)
    steps = np.concatenate([-steps, steps])
    margin = int(high) + 2
    tall, wide = (side + 2 * margin for side in edges.marked.shape)
    at = edges.x + (margin + 0.5), edges.y + (margin + 0.5)
    votes = votes_along(at, (edges.unit_x, edges.unit_y), steps, (tall, wide))
    peaks = find_peaks(votes, 2 * np.pi * low, int(low / 2))
    x, y = (of - margin for of in (peaks.x, peaks.y))
    size = np.full(len(x), low)
    frames = frame.affine_frames(x, y, size, size, np.zeros(len(x)))
    centres = Dots(frames, np.zeros(len(x), int), np.ones(len(x)))
    return [(centres, high / low)]


def _unclipped(pyramid: ImagePyramid) -> ImagePyramid:
    """Return a pyramid whose gray values are not clipped."""
    if not is_drawing(pyramid.image):
        return pyramid
    halves = tuple(of_drawing(half) for half in pyramid.halves)
    return replace(pyramid, image=of_drawing(pyramid.gray), halves=halves)
