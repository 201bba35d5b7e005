"""What may help where no target is identified: only what a second look at the image measures.

Targets of other families, targets that are too small, and bands of sectors of no known family
are looked for. That takes a few identifications, so nothing here is on the way to a result.
"""

from __future__ import annotations

import os
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from statistics import median

import cv2
import numpy as np

from ahf_ros.codes.families import AUTO, code_family, families_of, kind_of
from ahf_ros.codes.ring import Family
from ahf_ros.detectors import create_detector
from ahf_ros.detectors.contract import DetectorSettings
from ahf_ros.detectors.ring.learning import LearntFamily, find_bands, learn_families
from ahf_ros.edge_shift import edge_shift_remark, median_edge_shift
from ahf_ros.target import UNDECODED, Target
from ahf_ros.text import counted

LOOKED_AT = 3
"""Images that are worth a second look, where nothing is identified in many."""

IN_A_ROW = 5
"""Images of a stream without a target, after which one of them gets a second look."""

_ENLARGED = 2  # times, where targets may be too small
_MAXIMUM_PIXELS = 2**23  # of an image that is enlarged; the middle of a larger one is
_AMPLE = 1.25  # times the minimum radius, which even light needs
_SURE = 10.0  # log odds of the number of sectors
_MISPLACED = 1.5  # px, growth of ink that leaves a doubt of the radii of a band
_EXACT = 0.02  # dot radii, spread of the edges of bands that light does not blur
_ALIKE = 0.15  # dot radii, difference of bands that may be the same
_COLOURS = {1: 'dark', -1: 'bright'}


def advice(image: np.ndarray, settings: DetectorSettings, expected_targets: int = 0) -> list[str]:
    """Return lines on what an image shows in which nothing was identified; none if nothing is.

    `image` is a gray image, and `settings` say what was looked for in it, with N if it was known.

    Examples
    --------
    >>> from ahf_ros import SceneSettings, render
    >>> scene = SceneSettings(width=320, height=240, targets=3, dot_radius=8, family='aicon14')
    >>> advice(render(scene).image, DetectorSettings(family='metashape12'))
    ['3 targets of aicon14: --family aicon14']
    """
    return list(filter(None, _lines(image, settings, expected_targets)))


class Adviser:
    """Advice on a stream, once, after several images in a row in which nothing was identified.

    The second look is taken in a thread of the lowest priority, so that no image waits for it.
    `lines` has what it gave, until something is identified. It has the arguments of `advice`.
    """

    def __init__(self, settings: DetectorSettings, expected_targets: int = 0) -> None:
        self.lines: tuple[str, ...] = ()
        self._arguments = settings, expected_targets
        self._in_a_row = 0
        self._look: threading.Thread | None = None

    def see(self, image: np.ndarray, identified: int) -> None:
        """Take note of the next image, and of how many targets were identified in it."""
        self._in_a_row = 0 if identified else self._in_a_row + 1
        if identified:
            self.lines = ()
        elif self._in_a_row == IN_A_ROW and self._look is None:
            self._look = threading.Thread(target=self._advise, args=(image,), daemon=True)
            self._look.start()

    def wait(self) -> None:
        """Return when a look that was begun has ended."""
        if self._look:
            self._look.join()

    def _advise(self, image: np.ndarray) -> None:
        with suppress(OSError):  # where a thread has no priority of its own
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), 19)
        with suppress(ValueError):  # which the identification has said
            lines = tuple(advice(image, *self._arguments))
            if self._in_a_row:
                self.lines = lines


def _lines(image: np.ndarray, settings: DetectorSettings, expected: int) -> Iterator[str]:
    if learnt := _learnt(image):
        yield from _of_bands(learnt, 1, settings, expected)
        return
    usual = replace(settings, family=AUTO, polarity='auto', min_radius=0.0, max_radius=1e4)
    found = [it for it in _identified(image, usual) if it.family not in settings.families]
    if found:
        ((name, count),) = Counter(target.family for target in found).most_common(1)
        yield f'{counted(count, "target")} of {name}: --family {name}'
        yield edge_shift_remark(median_edge_shift(found))
        return
    middle = _enlarged_middle(image)
    if learnt := _learnt(middle):
        yield from _of_bands(learnt, _ENLARGED, settings, expected)
    elif small := _identified(middle, replace(settings, max_radius=1e4)):
        radius = median(target.semi_major for target in small) / _ENLARGED
        yield from _of_size(len(small), radius, settings)


def _learnt(image: np.ndarray) -> LearntFamily | None:
    """Return the family of most dots with a band, if its number of sectors is sure."""
    families = learn_families(find_bands([image], DetectorSettings()))
    return families[0] if families and families[0].lead > _SURE else None


def _of_bands(
    found: LearntFamily, scale: int, settings: DetectorSettings, expected: int
) -> Iterator[str]:
    """Yield what dots with bands say, seen in an image that was enlarged by a scale."""
    polarity = int(np.sign(np.median(found.bands.polarity)))
    count = len(found.words)
    own = families_of(settings.family_file).values() if settings.family_file else ()
    known = found.known([code for code in own if isinstance(code, Family)])
    size = list(_of_size(count, float(np.median(found.bands.size)) / scale, settings))
    edges = edge_shift_remark(found.growth * polarity / scale)
    exact = scale == 1 and np.median(found.bands.spread) < _EXACT
    dots = f'{count} dots with a band of {found.bits} sectors'
    if known and not set(known) & set(settings.families):
        yield f'{dots}: --family {" or ".join(known)}'
    elif polarity not in settings.polarities:
        yield f'{dots} are {_COLOURS[polarity]}, polarity is {settings.polarity}'
    elif not known and exact and abs(found.growth) < _MISPLACED:
        yield f'{dots} that no known family has: `ahf learn-family` describes it'
    elif _like_wanted(found, settings) and not (size or edges or expected):
        yield (
            f'{count} dots with a band are hard to read: with --expected-targets N, AHF searches '
            'for a filter'
        )
    yield from size
    yield edges


def _like_wanted(found: LearntFamily, settings: DetectorSettings) -> bool:
    """Return whether bands have the radii of a family that was looked for."""
    names = [it for it in settings.families if kind_of(it, settings.family_file) == 'ring']
    wanted = [code_family(name, settings.family_file) for name in names]
    return any(
        np.abs(np.subtract(code.band, found.band)).max() < _ALIKE
        for code in wanted
        if isinstance(code, Family)
    )


def _of_size(count: int, radius: float, settings: DetectorSettings) -> Iterator[str]:
    """Yield what the radius of some dots says, px."""
    minimum, maximum = settings.radii
    ample = _AMPLE * minimum
    if settings.min_radius and radius < minimum:
        yield f'{count} dots have a radius of {radius:.1f} px, min_radius is {minimum:g}'
    elif radius < minimum:
        yield f'{count} dots of {radius:.1f} px are too small: {ample:.2g} px are needed'
    elif radius > maximum:
        yield f'{count} dots have a radius of {radius:.1f} px, max_radius is {maximum:g}'


def _identified(image: np.ndarray, settings: DetectorSettings) -> list[Target]:
    """Return the targets that the usual detector of some families identifies."""
    detector = create_detector(settings=replace(settings, report_undecoded=False))
    return [target for target in detector(image) if target.id != UNDECODED]


def _enlarged_middle(image: np.ndarray) -> np.ndarray:
    """Return the middle of an image, enlarged."""
    height, width = image.shape
    share = min(1.0, (_MAXIMUM_PIXELS / image.size) ** 0.5)
    top, left = (round((1 - share) / 2 * side) for side in (height, width))
    part = image[top : height - top, left : width - left]
    return cv2.resize(part, None, fx=_ENLARGED, fy=_ENLARGED, interpolation=cv2.INTER_CUBIC)
