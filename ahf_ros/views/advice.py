"""What may help where no target is identified: only what a second look at the image measures.

It is a look at the part of the image with the most dots, so that its time and memory are bounded,
and at the whole image reduced to as many pixels where that part says nothing. Dozens of rings of
an unknown family may be small, and spread among thousands of other dots: in the end, the bands of
more dots are looked at in the whole image.
Targets are looked for where the dots are few. Where they are many, as in texture, text and arrays
of spots, only the bands of the clearest ones are looked at.
"""

import os
import threading
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from math import ceil

import cv2
import numpy as np

from ahf_ros.base.doubt import repeated_remark
from ahf_ros.base.edge_shift import edge_shift_remark, median_edge_shift
from ahf_ros.base.target import UNDECODED, Target, repeated_targets
from ahf_ros.base.text import counted
from ahf_ros.families import Contesting, create_detector
from ahf_ros.families.contract import DetectorSettings
from ahf_ros.families.learning.rings import LearntFamily, learn_families
from ahf_ros.families.ring.bands import DotsOfOctave, bands_about, dots_in
from ahf_ros.identification.settling import evident, still_shown
from ahf_ros.prints import RING_NAMES, SQUARE_NAMES
from ahf_ros.prints.families import AUTO, prints_of
from ahf_ros.prints.ring import FAMILY_NAMES, RingPrint, words_of_print
from ahf_ros.prints.square import has_dictionary
from ahf_ros.vision.dot_search import whole_dots
from ahf_ros.vision.image import as_gray, check_image
from ahf_ros.vision.pyramid import MAXIMUM_RADIUS, image_pyramid

LOOKED_AT = 3
"""Images that are worth a second look, where nothing is identified in many."""

TOGETHER = 8
"""Images that are worth one together, where those say nothing."""

IN_A_ROW = 5
"""Images of a stream without a target, after which one of them gets a second look."""

_ENLARGED = 2  # times, where targets may be too small
_MAXIMUM_PIXELS = 2**20  # of what is looked at: a part of a larger image
_MAXIMUM_ENLARGED = 2**19  # the same, of what is enlarged
_PLACED = 2**22  # pixels of the image in which the part is chosen, at the most
_TILE = 64  # of that image, whose dots are counted, px
_CLEAREST = 64  # dots whose bands are looked at
_DOZENS = 256  # the same, in whole images
_WHOLE = 2**24  # pixels of a whole image, which is reduced to as many
_MOST = 1500  # dots of a part, beside which targets are looked for; texture has more
_FEW, _SPARSE = 120, 0.1  # dots, and share of edge pixels, up to which targets are looked for
_AMPLE = 1.25  # times the minimum radius, which even light needs
_SURE = 10.0  # log odds of the number of sectors
_BEYOND_DOUBT = 100.0  # the same, where a dozen targets or more show it
_MISPLACED = 1.5  # px, growth of ink that leaves a doubt of the radii of a band
_EXACT = 0.02  # dot radii, spread of the edges of bands that light does not blur


def advice(image: np.ndarray, settings: DetectorSettings, expected_targets: int = 0) -> list[str]:
    """Return lines on what a gray image shows in which nothing was identified; often none.

    `settings` say what was looked for; `expected_targets` is N, 0 if none was given.

    Examples
    --------
    >>> from ahf_ros import SceneSettings, render
    >>> scene = SceneSettings(width=320, height=240, targets=3, dot_radius=8, family='aicon14')
    >>> advice(render(scene).image, DetectorSettings(family='metashape12'))
    ['3 targets of aicon14: --family aicon14']
    """
    return _advice(image, _Part(image, settings), settings, expected_targets)


def advice_on_all(
    images: Iterable[tuple[str, np.ndarray]], settings: DetectorSettings, expected_targets: int = 0
) -> list[str]:
    """Return lines on gray images in which nothing was identified, each of which has a name.

    They are on the first of `LOOKED_AT` images that says something; else on the rings that up to
    `TOGETHER` images show together: a few in each of several may tell their family where those of
    one do not. Images of many dots, as of texture, do not count. No image is asked for twice. The
    other arguments are as for `advice`.
    """
    parts: list[_Part] = []
    for name, image in islice(images, TOGETHER):
        parts.append(_Part(image, settings))
        if len(parts) > LOOKED_AT:
            continue
        if lines := _advice(image, parts[-1], settings, expected_targets):
            return [f'{name}: {line}' for line in lines]
    dots = [of for part in parts if _are_few(of := part.dots(settings))]
    if len(parts) < 2 or not (learnt := _learnt(dots)):
        return []
    lines = list(filter(None, _of_bands(learnt, 1, settings, expected_targets)))
    return [f'{len(parts)} images together: {line}' for line in lines]


class _Part:
    """The part of an image that gets a second look; its dots are looked for once."""

    def __init__(self, image: np.ndarray, settings: DetectorSettings) -> None:
        check_image(image)
        self.gray = _with_most_dots(as_gray(image), _MAXIMUM_PIXELS, settings)
        self.is_whole = self.gray.size == image.size
        self._dots: dict[tuple[object, ...], list[DotsOfOctave]] = {}

    def dots(self, settings: DetectorSettings | None = None) -> list[DotsOfOctave]:
        """Return the dots of the usual settings, or of other ones, that may have bands."""
        rings = (settings or DetectorSettings()).narrowed(RING_NAMES)
        kind = rings.radii, rings.polarities
        if kind not in self._dots:
            self._dots[kind] = dots_in(self.gray, rings)
        return self._dots[kind]


def _advice(
    image: np.ndarray, part: _Part, settings: DetectorSettings, expected: int
) -> list[str]:
    """Return what a part of an image says, or else the whole of it."""
    lines = list(filter(None, _lines(part, settings, expected)))
    if not lines and not part.is_whole:
        lines = list(filter(None, _of_whole(as_gray(image), settings, expected)))
    count = _count(part.dots())
    every = part.is_whole and count <= _CLEAREST  # have been looked at
    if not lines and not every and count <= _MOST:
        whole = part if part.is_whole else None
        lines = list(filter(None, _of_dozens(as_gray(image), whole, settings, expected)))
    return lines


class Adviser:
    """Advice on a stream, once, after several images in a row in which nothing was identified.

    The second look is taken in a thread of the lowest priority, so that no image waits for it.
    `lines` has what it gave, until something is identified. It has the arguments of `advice`.
    """

    def __init__(self, settings: DetectorSettings, expected_targets: int = 0) -> None:
        self.lines: list[str] = []
        self._arguments = settings, expected_targets
        self._in_a_row = 0
        self._look: threading.Thread | None = None

    def see(self, image: np.ndarray, identified: int) -> None:
        """Take note of the next image, and of how many targets were identified in it."""
        self._in_a_row = 0 if identified else self._in_a_row + 1
        if identified:
            self.lines = []
        elif self._in_a_row == IN_A_ROW and self._look is None:
            self._look = threading.Thread(target=self._advise, args=(image,), daemon=True)
            self._look.start()

    def _advise(self, image: np.ndarray) -> None:
        with suppress(OSError, AttributeError):  # where a thread has no priority of its own
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), 19)
        with suppress(ValueError):  # which the identification has said
            lines = advice(image, *self._arguments)
            self.lines = lines if self._in_a_row else []


def _lines(part: _Part, settings: DetectorSettings, expected: int) -> Iterator[str]:
    image, dots = part.gray, part.dots()
    few = _are_few(dots)
    read = _read(image, settings) if few else []
    if repeated := repeated_targets(read):
        yield repeated_remark(repeated)
        return
    if learnt := _learnt([dots]):
        yield from _of_bands(learnt, 1, settings, expected)
    if learnt or not few:
        return
    if mirrored := _of_mirrored(image, settings):
        yield mirrored
        return
    if settings.family == AUTO and (likely := _likely(read)):
        ((name, count),) = Counter(target.family for target in likely).most_common(1)
        target = counted(count, 'target')
        yield f'{target} may be of {name}, too few to be sure: --family {name}'
        return
    if others := list(_of_others(image, settings)):
        yield from others
        return
    if shared := list(_of_shared_prints(image, settings)):
        yield from shared
        return
    middle = _with_most_dots(image, _MAXIMUM_ENLARGED, settings)
    middle = cv2.resize(middle, None, fx=_ENLARGED, fy=_ENLARGED, interpolation=cv2.INTER_CUBIC)
    middle = np.maximum(middle, 0)  # which cubic interpolation falls below
    if learnt := _learnt([dots_in(middle, DetectorSettings())]):
        yield from _of_bands(learnt, _ENLARGED, settings, expected)
    elif small := _identified(middle, replace(settings, max_radius=_largest_told(settings))):
        radius = float(np.median([target.semi_major for target in small])) / _ENLARGED
        yield _of_size(len(small), radius, settings.narrowed({it.family for it in small}))


def _of_whole(gray: np.ndarray, settings: DetectorSettings, expected: int) -> Iterator[str]:
    """Yield what a reduced image shows: large targets are far from each other."""
    times = ceil((gray.size / _MAXIMUM_PIXELS) ** 0.5)
    reduced = cv2.resize(gray, None, fx=1 / times, fy=1 / times, interpolation=cv2.INTER_AREA)
    dots = dots_in(reduced, DetectorSettings())
    if learnt := _learnt([dots]):
        yield from _of_bands(learnt, 1 / times, settings, expected)
    elif _are_few(dots):
        yield next(_of_others(reduced, settings), '')  # of edges it tells little


def _of_dozens(
    gray: np.ndarray, part: _Part | None, settings: DetectorSettings, expected: int
) -> Iterator[str]:
    """Yield what the rings of a whole image show, where they leave no doubt."""
    times = max(1, ceil((gray.size / _WHOLE) ** 0.5))
    if times > 1:
        gray = cv2.resize(gray, None, fx=1 / times, fy=1 / times, interpolation=cv2.INTER_AREA)
    dots = part.dots() if part else dots_in(gray, DetectorSettings())
    learnt = _learnt([dots], _DOZENS)
    if learnt and learnt.lead > _BEYOND_DOUBT:
        yield from _of_bands(learnt, 1 / times, settings, expected)


def _of_others(image: np.ndarray, settings: DetectorSettings) -> Iterator[str]:
    """Yield how many targets of a family that was not looked for an image shows, of any size."""
    usual = replace(settings, family=AUTO, polarity='auto', min_radius=0.0, max_radius=1e4)
    others = set(usual.families) - set(settings.families)
    found = evident(_identified(image, usual)) if others else []
    if found := [it for it in found if it.family in others]:
        ((name, count),) = Counter(target.family for target in found).most_common(1)
        yield f'{counted(count, "target")} of {name}: --family {name}'
        yield edge_shift_remark(median_edge_shift(found))


def _of_mirrored(image: np.ndarray, settings: DetectorSettings) -> str:
    """Return how many square markers are mirrored, which makes others of them or none."""
    squares = [it for it in settings.families if it in SQUARE_NAMES and has_dictionary(it)]
    if not squares:
        return ''
    flipped = np.ascontiguousarray(image[:, ::-1])
    found = evident(_identified(flipped, settings.narrowed(squares)))
    for name, count in Counter(target.family for target in found).most_common(1):
        return f'{counted(count, "target")} of {name} mirrored: flip the images, or print anew'
    return ''


def _likely(read: Sequence[Target]) -> list[Target]:
    """Return the targets of families that may be there, also where one alone is no evidence."""
    families = {it.family for it in read if it.id != UNDECODED}
    likely = {name for name in families if still_shown([it for it in read if it.family == name])}
    return [it for it in read if it.family in likely]


def _largest_told(settings: DetectorSettings) -> float:
    """Return the radius up to which dots of an enlarged image are worth a line, px."""
    if settings.max_radius < DetectorSettings().max_radius:
        return DetectorSettings().max_radius
    return _ENLARGED * max(settings.narrowed([name]).radii[0] for name in settings.families)


def _of_shared_prints(image: np.ndarray, settings: DetectorSettings) -> Iterator[str]:
    """Yield what targets are that several of the families have, too few to tell which it is."""
    rings = [of.design for of in settings.prints.values() if of.kind == 'ring']
    codes = {code.name: code for code in rings if isinstance(code, RingPrint)}
    widest = [code.name for code in codes.values() if code.has_all_words]
    if not 0 < len(widest) < len(codes):
        return
    found = _likely(_identified(image, settings.narrowed(widest)))
    every = tuple(codes.values())
    shown = Counter(tuple(words_of_print(codes[it.family], it.code, every)) for it in found)
    for of_print, count in shown.most_common(1):
        names = sorted(code.name for code in of_print)
        if len(names) > 1:
            yield f'{counted(count, "target")} of {" or ".join(names)}: --family says which'


def _are_few(dots: list[DotsOfOctave]) -> bool:
    """Return whether an image has so few dots and edges that targets may be looked for."""
    marked = [octave.pyramid.edges[0] for octave, _ in dots]
    many = any(len(edges.x) > _SPARSE * edges.marked.size for edges in marked)
    return not many and _count(dots) <= _FEW


def _count(dots: list[DotsOfOctave]) -> int:
    return sum(len(of.frames) for _, each in dots for of in each)


def _learnt(images: Iterable[list[DotsOfOctave]], most: int = _CLEAREST) -> LearntFamily | None:
    """Return the family of most dots with a band, if its number of sectors is sure."""
    families = learn_families(bands_about(images, most))
    return families[0] if families and families[0].lead > _SURE else None


def _of_bands(
    found: LearntFamily, scale: float, settings: DetectorSettings, expected: int
) -> Iterator[str]:
    """Yield what dots with bands say, seen in an image that was enlarged by a scale."""
    polarity, count = int(np.median(found.bands.polarity)), len(found.words)
    own = prints_of(settings.family_file).values() if settings.family_file else ()
    known = found.known([of.design for of in own if isinstance(of.design, RingPrint)])
    rings = settings.narrowed(known or FAMILY_NAMES)
    size = _of_size(count, float(np.median(found.bands.size)) / scale, rings)
    edges = edge_shift_remark(found.growth * polarity / scale)
    sure = np.median(found.bands.spread) < _EXACT or found.lead > _BEYOND_DOUBT
    exact = scale <= 1 and sure
    dots = f'{count} dots with a band of {found.bits} sectors'
    if known and not set(known) & set(settings.families):
        yield f'{dots}: --family {" or ".join(known)}'
    elif polarity not in settings.polarities:
        yield f'{dots} are {"dark" if polarity > 0 else "bright"}, polarity is {settings.polarity}'
    elif not known and exact and abs(found.growth) < _MISPLACED:
        yield f'{dots} that no known family has: `ahf learn-family` describes it'
    elif known and not (size or edges or expected):
        yield f'{dots} are hard to read: give --expected-targets, so that AHF searches'
    yield size
    yield edges


def _of_size(count: int, radius: float, settings: DetectorSettings) -> str:
    """Return what the radius of some dots says, px; nothing where it is accepted."""
    minimum, maximum = settings.radii
    if minimum <= radius <= maximum:
        return ''
    if radius < minimum and not settings.min_radius:
        return f'{count} dots of {radius:.1f} px are too small: {_AMPLE * minimum:.2g} px would do'
    name, bound = ('min', minimum) if radius < minimum else ('max', maximum)
    return f'{count} dots have a radius of {radius:.1f} px, {name}_radius is {bound:g}'


def _read(image: np.ndarray, settings: DetectorSettings) -> list[Target]:
    """Return the targets that are identified, also those that share an ID."""
    with suppress(ValueError):  # which the identification has said
        detector = create_detector(settings=settings)
        return (detector.contesting() if isinstance(detector, Contesting) else detector)(image)
    return []


def _identified(image: np.ndarray, settings: DetectorSettings) -> list[Target]:
    """Return the targets that the usual detector of some families identifies."""
    detector = create_detector(settings=replace(settings, report_undecoded=False))
    return [target for target in detector(image) if target.id != UNDECODED]


def _with_most_dots(image: np.ndarray, most: int, settings: DetectorSettings) -> np.ndarray:
    """Return the part of an image, of so many pixels at the most, that has the most whole dots."""
    if image.size <= most:
        return image
    times = max(1, ceil((image.size / _PLACED) ** 0.5))
    reduced = cv2.resize(image, None, fx=1 / times, fy=1 / times, interpolation=cv2.INTER_AREA)
    pyramid = image_pyramid(reduced, settings.max_radius / times)
    found = whole_dots(pyramid, 2.0, MAXIMUM_RADIUS, (1, -1)).frames[:, :2, 2]
    share = (most / image.size) ** 0.5
    height, width = (max(int(side * share), 1) for side in image.shape)
    tiles = np.zeros([side // _TILE + 1 for side in reduced.shape], np.float32)
    np.add.at(tiles, tuple((found[:, ::-1] // _TILE).astype(int).clip(0).T), 1)
    window = [max(round(side / times / _TILE), 1) for side in (width, height)]
    within = cv2.boxFilter(tiles, -1, window, normalize=False, borderType=cv2.BORDER_CONSTANT)
    middle = (np.array(np.unravel_index(within.argmax(), within.shape)) + 0.5) * _TILE * times
    if not within.any():
        middle = np.array(image.shape) / 2
    top, left = (
        int(np.clip(at - side / 2, 0, whole - side))
        for at, side, whole in zip(middle, (height, width), image.shape, strict=True)
    )
    return np.ascontiguousarray(image[top : top + height, left : left + width])
