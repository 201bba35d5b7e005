"""Which families of targets images show, settled on the first of them.

All families are looked for in the first images, as received, until it is clear which are there:
mostly in one. From then on only those that were found are looked for, and all again in an image
that does not clearly show one of these. Each image that does has a part of it looked at by the
detector of some others, where its targets are painted over; what is there shows itself within some
tens of images, and none of them takes much longer. Where nothing has changed since all detectors
looked at all parts, as following the targets shows, such looks become rare.
"""

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Any

import cv2
import numpy as np

from ahf_ros.base.target import UNDECODED, Identification, Target, UndecodedTarget
from ahf_ros.base.target_check import checked_targets
from ahf_ros.families.contract import unstretched
from ahf_ros.families.evidence import Reading, evidence, is_clear, reading_of
from ahf_ros.families.explained import without_targets
from ahf_ros.families.undecoded import undecoded
from ahf_ros.identification.filtering.genetic import Values
from ahf_ros.identification.filtering.identifier import Identifier, Memory
from ahf_ros.identification.filtering.trials import DetectorFunction, Trials
from ahf_ros.vision.parts import Part
from ahf_ros.vision.stack import ImageStack

FIRST = 3
"""Images with targets in which all families are looked for, unless one makes it clear."""

_OF_ONE = 2.0  # decimal logarithm of the odds on a family: one target certain to 0.99
_OF_SEVERAL = 3.6  # ... of all together: six certain to 0.75, three to 0.94, or two to 0.984
_WORTH_A_LOOK = 1.3  # ... on another family in a part of an image: one certain to 0.95
_PER_IMAGE = 0.3  # words that texture shows by chance in an image, at the most
_OF_KNOWN = 1.99  # ... on families that other images have settled: one certain to 0.99

_IN_TURN = 8  # images, at least, over which the looks of all detectors at all parts are spread
_STILL = 30  # times as many, where nothing has changed since all these looks
_TOLD_BY_SEVERAL = {'ring', 'aruco', 'apriltag'}  # kinds of which a part may show too few
_READ_BY_NAME = {'aruco', 'apriltag'}  # also where all families have been looked for
_PART = 480  # side of a part of an image in which other families are looked for, px, at least
_PARTS = 3  # of an image in a row and in a column, at the most; neighbours share a third


def memory_of(families: Sequence[str]) -> Memory:
    """Return what earlier images leave that have settled these families, if there are any."""
    return Memory(families=tuple(families), shown=FIRST if families else 0, glanced=-1)


def evident(targets: Sequence[Target]) -> list[Target]:
    """Return the targets of families that they are evidence for, and undecoded ones.

    Where all families are looked for, words of some are read in nearly any texture, but few of one
    family: one that is certain is evidence, or three to 0.94, or six to 0.75. What is read in
    several places, as letters may be, counts once.
    """
    shown = {
        family
        for family, of in evidence(map(reading_of, targets)).items()
        if max(of) > _OF_ONE or sum(of) > _OF_SEVERAL
    }
    return [it for it in targets if it.id == UNDECODED or it.family in shown]


def marked(targets: Sequence[Target]) -> list[Target]:
    """Return targets, those of families that they are no evidence for undecoded."""
    settled = evident(targets)
    return [it if it in settled else undecoded(it, 'unsettled') for it in targets]


def evident_together(images: Sequence[Iterable[Reading]]) -> set[str]:
    """Return the families that images show together, though perhaps none of them alone.

    Of each image, all that was read in it counts, whether it was reported or not. Texture shows a
    word now and then: the more images there are, the more of them it takes, or the surer ones. An
    ID counts once, as the same texture may be in several images.

    Examples
    --------
    >>> single = [[('metashape12', number, 0.98)] for number in (15, 17, 22)]
    >>> evident_together(single), evident_together(single[:1])
    ({'metashape12'}, set())
    """
    by_chance = max(math.log10(_PER_IMAGE * len(images)), 0.0) if images else 0.0
    return {
        family
        for family, of in evidence(chain.from_iterable(images)).items()
        if sum(max(odds - by_chance, 0.0) for odds in of) > _OF_SEVERAL
    }


def still_shown(targets: Sequence[Target]) -> bool:
    """Return whether an image shows families that other images have settled.

    A doubtful word may be read in a target of another family.
    """
    return any(sum(of) > _OF_KNOWN for of in evidence(map(reading_of, targets)).values())


def _families(targets: Iterable[Target]) -> set[str]:
    return {target.family for target in targets if target.id != UNDECODED}


def _family(target: Target) -> str:
    """Return the family of a target, or the likely one where it is not decoded."""
    return target.likely_family if isinstance(target, UndecodedTarget) else target.family


def _parts(shape: tuple[int, int]) -> list[Part]:
    """Return parts of an image, which overlap."""
    height, width = shape
    return [
        (left, top, right, bottom)
        for top, bottom in _spans(height)
        for left, right in _spans(width)
    ]


def _reduced(image: np.ndarray, part: Part) -> np.ndarray:
    """Return an image in half the size of one of its parts.

    It shows targets that are wider than what parts share, a third of a part.
    """
    height, width = image.shape
    scale = min((part[2] - part[0]) / width, (part[3] - part[1]) / height) / 2
    return cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)


def _spans(side: int) -> list[tuple[int, int]]:
    """Return the bounds of the parts of a side, px."""
    length = max(_PART, math.ceil(3 * side / (2 * _PARTS + 1)))
    if side <= length:
        return [(0, side)]
    count = math.ceil(1 + 3 * (side - length) / (2 * length))
    starts = np.linspace(0, side - length, count, dtype=int).tolist()
    return [(start, start + length) for start in starts]


def _beside(
    seen: Iterable[Target], found: Sequence[Target], families: Collection[str]
) -> Iterator[UndecodedTarget]:
    """Yield what was seen of other families than those that are read, and where none is found."""
    for it in seen:
        if isinstance(it, UndecodedTarget) and it.is_unsettled:
            near = any(math.hypot(it.x - of.x, it.y - of.y) < of.semi_major for of in found)
            if it.likely_family not in families and not near:
                yield it


def families_line(families: Iterable[str]) -> str:
    """Return what is said of the families that are there."""
    return f'families: {", ".join(families)}'


def settled_families(memory: Memory, before: Sequence[str]) -> str:
    """Return a line if an image has settled the families, or changed them from `before`."""
    if not memory.families or memory.families == before:
        return ''
    return families_line(memory.families)


class SettlingIdentifier(Identifier):
    """Identifies targets of all families in the first images, and then of those that were there.

    Parameters
    ----------
    detector, *arguments, draft, **options
        As for `Identifier`, with a detector of all families.
    kinds : mapping of str to str
        The names of the families, and the kind of each.
    groups : sequence of sequence of str
        The families that one detector reads, for each detector.
    narrowed : callable
        From some of them to an identifier that has their detector.
    """

    def __init__(
        self,
        detector: DetectorFunction,
        *arguments: Any,
        draft: DetectorFunction | None = None,
        kinds: Mapping[str, str],
        groups: Sequence[Sequence[str]],
        narrowed: Callable[[tuple[str, ...]], Identifier],
        **options: Any,
    ) -> None:
        drafted = draft and (lambda image: marked(draft(image)))
        super().__init__(
            lambda image: marked(detector(image)), *arguments, draft=drafted, **options
        )
        self._detector_beside = unstretched(detector)
        self._kinds = kinds
        self._groups = [tuple(it) for it in groups]
        self._narrowed = narrowed
        self._made: dict[tuple[str, ...], Identifier] = {}
        self._looked: Trials | None = None

    def _of_stack(self, stack: ImageStack, expected: int | None) -> Identification:
        """Identify the targets of a stack; see `Identifier.identify`."""
        started = self._clock()
        known, found = self.memory.families, None
        if self.memory.shown >= FIRST:
            found = self._read(stack, known, expected)
        settled = found is not None and still_shown(found.targets)
        seen = self._glance(stack, found) if found and settled else self._look(stack)
        families = self._ordered({*known, *_families(seen)})
        if not families:
            found = super()._of_stack(stack, expected)
            families = self._ordered(_families(found.targets))
        elif found is None or families != known:
            found = self._read(stack, families, expected)
        if seen or not settled:
            unsettled = tuple(_beside(seen, found.targets, families))
            found = replace(found, looked_for=self._looked_for, unsettled=unsettled)
        clear = is_clear([*found, *found.unsettled])
        shown = self.memory.shown + (FIRST if clear else found.count > 0)
        self.memory = replace(self.memory, families=families, shown=min(shown, FIRST))
        self._looked = None
        state = replace(found.filter, duration=self._clock() - started)
        return replace(found, filter=state)

    def _look(self, stack: ImageStack) -> list[Target]:
        """Return what an image shows as received, or the first combination that shows a target."""
        self._looked = trials = super()._trials(stack)
        for plain in trials.plain:
            if trials.count(plain):
                return trials.targets[plain]
        return trials.targets[trials.plain[0]]

    def _glance(self, stack: ImageStack, found: Identification) -> list[Target]:
        """Return what an image shows beside its targets, if a look at a part shows something.

        Each image gets another look, by one detector at one part, those of a batch one by all at
        the whole; where there are few looks, as at small images, some images get none, and where
        nothing has changed, most.
        """
        turn, still = self.memory.glanced, self.memory.seen.still if self.memory.seen else 0
        self.memory = replace(self.memory, glanced=turn + 1)

        def left(part: Part | None = None) -> np.ndarray:
            image = stack.combined(found.combination or stack.names[0])
            known = [it for it in found.targets if it.id != UNDECODED]
            return without_targets(image, known, found.prints, part)

        if turn < 0:
            return self._others(self._seen(left()))
        parts = _parts(stack.shape)
        views: list[Callable[[], np.ndarray]] = [partial(left, it) for it in parts]
        if len(parts) > 1:
            views.append(lambda: _reduced(left(), parts[0]))
        looks = [(view, group) for view in views for group in self._groups]
        if len(parts) > 1:  # where few may not tell which of several families it is
            looks += [(left, of) for of in self._groups if self._kinds[of[0]] in _TOLD_BY_SEVERAL]
        every = math.ceil(_IN_TURN / len(looks)) if turn > 0 else 1
        if still >= every * len(looks):
            every *= _STILL
        if turn % every:
            return []
        view, group = looks[turn // every % len(looks)]
        shown = view()
        if not self._worth_a_look(self._of(group, shown)):
            return []
        seen = self._seen(shown)
        if len(parts) > 1:
            seen = self._of(self._worth_a_look(seen), left())
        return self._others(seen)

    def _others(self, seen: Iterable[Target]) -> list[Target]:
        """Return what was seen of families that no image has settled."""
        return [it for it in seen if reading_of(it)[0] not in (*self.memory.families, '')]

    def _worth_a_look(self, seen: Iterable[Target]) -> list[str]:
        """Return the families of all groups of which something was seen."""
        odds = evidence(map(reading_of, seen))
        likely = {name for name, of in odds.items() if sum(of) > _WORTH_A_LOOK}
        return [name for group in self._groups if likely & {*group} for name in group]

    def _seen(self, image: np.ndarray) -> list[Target]:
        """Return what an image shows of all families in clear contrast."""
        if image.min() == image.max():
            return []
        self._interrupt()
        return list(checked_targets(marked(self._detector_beside(image)), self._name))

    def _of(self, families: Sequence[str], image: np.ndarray) -> list[Target]:
        """Return what an image shows of some families."""
        if not families or image.min() == image.max():
            return []
        return marked(self._reader(tuple(families)).seen(ImageStack((image,))))

    def _trials(self, stack: ImageStack) -> Trials:
        """Return what is known of an image or stack that was looked at."""
        return self._looked or super()._trials(stack)

    def _read(
        self, stack: ImageStack, families: tuple[str, ...], expected: int | None
    ) -> Identification:
        """Return what an image shows of some families, and remember it."""
        reader = self._reader(families)
        # What was seen of other families does not tell where these are.
        same = families == self.memory.families
        reader.memory = self.memory if same else replace(self.memory, seen=None)
        trials = reader._trials(stack)
        for values, seen in self._read_already(families):
            trials.know(values, seen)
        found = reader._identified(stack, trials, expected)
        self.memory, self.last_search = reader.memory, reader.last_search
        return found

    def _read_already(
        self, families: tuple[str, ...]
    ) -> Iterator[tuple[Values | None, list[Target]]]:
        """Yield what a look has read of families beyond doubt, as they are read by their names.

        The odds of square markers depend on how many dictionaries are looked for.
        """
        if self._contested or {self._kinds[name] for name in families} & _READ_BY_NAME:
            return
        for values, seen in self._looked.found.items() if self._looked else ():
            own = [it for it in seen if _family(it) in families]
            if _families(own) == {*families} and is_clear(own):
                yield values, own

    def _reader(self, families: tuple[str, ...]) -> Identifier:
        """Return what identifies targets of some families, the same one each time."""
        if families not in self._made:
            self._made[families] = self._narrowed(families)
        return self._made[families]

    def _ordered(self, families: set[str]) -> tuple[str, ...]:
        """Return families in one order, whatever images they come from."""
        return tuple(name for name in self._kinds if name in families)
