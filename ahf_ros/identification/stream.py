"""A sequence of images identified in order: as stacks, with reasons for what is refused.

Images come one by one. A `Stream` identifies the images of one camera. Its `Window` gathers them
to stacks; `unmoved_parts` splits a stack where it turns out that the scene moved, or that images
cannot be combined.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum, auto
from typing import Any, Generic, TypeVar

import numpy as np

from ahf_ros.base.target import Identification, Target, count_codes
from ahf_ros.base.text import printable, reason_of
from ahf_ros.families.contract import Detector, Unavailable
from ahf_ros.files.image_files import NotedImage
from ahf_ros.files.image_messages import decode_compressed, decode_image, nanoseconds
from ahf_ros.files.target_messages import DROPPED, FAILED, REJECTED
from ahf_ros.identification.filtering.identifier import Identifier, Memory
from ahf_ros.identification.session import create_identifier
from ahf_ros.identification.session_settings import SLIDING, IdentificationSettings, StackSettings
from ahf_ros.vision.image import check_image
from ahf_ros.vision.movement import Displacement, displacement, find_edges, targets_moved
from ahf_ros.vision.stack import ImageStack, unlike

Item = TypeVar('Item')

_MAXIMUM_REASON = 2000  # characters


@dataclass(frozen=True, slots=True, eq=False)
class Frame(Generic[Item]):
    """A decoded image of a stream."""

    item: Item  # what stands for the image in its answer, such as its header or its path
    image: np.ndarray  # of uint8, uint16, float32 or float64, shape (height, width)
    kind: Hashable  # its size and encoding; another one begins a new stack
    stamp: int  # its time, ns; an earlier one than before begins a new stack
    damage: str = ''  # what is missing in it, empty where it is whole


def message_frame(message: Any) -> Frame[Any]:
    """Return the image of a message of ROS or rosbags, Image or CompressedImage, with its header.

    An image that is not accepted raises a ValueError.
    """
    compressed = hasattr(message, 'format')
    noted = decode_compressed(message) if compressed else NotedImage(decode_image(message))
    image = noted.image
    height, width = image.shape
    coding = message.format if compressed else message.encoding
    return Frame(
        item=message.header,
        image=image,
        kind=f'{width} x {height} px, {coding}',
        stamp=nanoseconds(message.header),
        damage=noted.damage,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Answer(Generic[Item]):
    """The identification of an image, or of consecutive images of a stack.

    Attributes
    ----------
    items : tuple
        What stands for the images, in order.
    fresh : int
        How many of the last ones are answered for the first time.
    stack : ImageStack
        The images.
    identification : Identification
    note : str
        What else there is to say, such as that an image is damaged; printable.
    settled : tuple of str
        The families that the images so far have settled, see `Memory`.
    """

    items: tuple[Item, ...]
    fresh: int
    stack: ImageStack
    identification: Identification
    note: str = ''
    settled: tuple[str, ...] = ()

    @property
    def image(self) -> np.ndarray:
        """The image or combination of images in which the targets were identified."""
        return self.stack.combined(self.identification.combination)


class Kind(Enum):
    """What a `Remark` is about."""

    INCOMPLETE = auto()
    """A stack has fewer images than were asked for."""
    SPLIT = auto()
    """The images of a stack cannot be identified together."""
    REFUSED = auto()
    """An image is not accepted."""
    FAILED = auto()
    """An image or a stack that is accepted could not be identified."""
    DROPPED = auto()
    """An image or a stack is given up without a look at it."""
    DAMAGED = auto()
    """An image is not whole; what is left of it is identified."""


STATUS = {Kind.REFUSED: REJECTED, Kind.FAILED: FAILED, Kind.DROPPED: DROPPED}
"""What answers say of images that a remark of a kind is about instead of an identification."""


@dataclass(frozen=True, slots=True)
class Remark:
    """What there is to say about an image or a stack; the error is what it is refused for."""

    kind: Kind
    text: str  # printable
    error: Exception | None = field(default=None, compare=False)
    items: tuple[Any, ...] = field(default=(), compare=False)  # images that get no other answer


class Stream(Generic[Item]):
    """Identifies the images of one camera in their order.

    Each image begins with the filter that worked for the one before.

    Parameters
    ----------
    settings : IdentificationSettings
    stacking : StackSettings
        Which images are identified together.
    detector : Detector
    timed : bool
        Whether identifications have their duration; without it equal images have equal results.
    interrupt : callable, optional
        As for `Identifier`.

    Examples
    --------
    >>> from ahf_ros import SceneSettings, create_detector, render
    >>> settings = IdentificationSettings(expected_targets=3)
    >>> stream = Stream(settings, StackSettings(), create_detector(family='metashape12'))
    >>> image = render(SceneSettings(width=320, height=240, targets=3, dot_radius=8)).image
    >>> for name, pixels in {'good': image, 'bad': image[:0]}.items():
    ...     for said in stream.add(lambda: Frame(name, pixels, 'mono8', 0), name):
    ...         print(said.text if isinstance(said, Remark) else said.identification.count)
    3
    image is 320 x 0 px, accepted is at least 16 x 16 px
    """

    def __init__(
        self,
        settings: IdentificationSettings,
        stacking: StackSettings,
        detector: Detector,
        *,
        timed: bool = True,
        interrupt: Callable[[], None] | None = None,
    ) -> None:
        self._stacking = stacking
        self._timed = timed
        self._window: Window[Frame[Item]] = Window(stacking)
        self._identifier = create_identifier(
            detector=detector, settings=settings, interrupt=interrupt
        )

    @property
    def memory(self) -> Memory:
        """What the images so far leave to the next one."""
        return self._identifier.memory

    @property
    def waiting(self) -> int:
        """Number of images that wait for the rest of their stack."""
        return self._window.fresh

    @property
    def searched(self) -> float:
        """Time of the last identification in which it searched for a filter, s."""
        search = self._identifier.last_search
        return search.duration if search else 0.0

    def forget(self) -> tuple[Item, ...]:
        """Begin a new stack without an answer to what waits, and return what stands for it."""
        ended = self._window.end('')
        return tuple(frame.item for gathered in ended for frame in _fresh(gathered))

    def reset(self) -> None:
        """Forget what worked for earlier images."""
        self._identifier.reset()

    def identify(self, frame: Frame[Item], expected_targets: int | None = None) -> Answer[Item]:
        """Identify the targets of an image that is in no stack, as `Identifier.identify` does."""
        stack = ImageStack((frame.image,))
        found = self._identifier.identify(stack, expected_targets=expected_targets)
        return self._answer((frame,), 1, stack, found)

    def resume(self, memory: Memory, read: Callable[[], Frame[Item]]) -> None:
        """Go on as if an image had just been answered and had left this memory.

        `read` is as for `add`; it is called if the image may belong to an unfinished stack.
        """
        self._identifier.memory = memory
        if self._stacking.stack > 1:
            list(self._gathered(read, None))

    def add(
        self, read: Callable[[], Frame[Item]], item: Item | None = None
    ) -> Iterator[Answer[Item] | Remark]:
        """Add an image, and yield what there is to say and the answers to what is complete.

        `read` returns the image; what it raises is why the image is refused, and `item` stands for
        the image then. The error of a remark is `Unavailable` if the detector cannot be used,
        which is not the fault of the image: another run may find the detector.
        """
        for gathered in self._gathered(read, item):
            if isinstance(gathered, Remark):
                yield gathered
            else:
                yield from self._answers(gathered)

    def end(self, why: str) -> Iterator[Answer[Item] | Remark]:
        """End the stack, and yield its answers as `add` does."""
        for gathered in self._window.end(why):
            yield from self._answers(gathered)

    def _gathered(
        self, read: Callable[[], Frame[Item]], item: Item | None
    ) -> Iterator[Gathered[Frame[Item]] | Remark]:
        """Add an image to the window and yield the stacks that this completes."""
        try:
            frame = read()
            if self._stacking.stack > 1:
                check_image(frame.image)
        except Exception as error:
            yield why_refused(error, items=() if item is None else (item,))
            return
        if frame.damage:
            yield Remark(Kind.DAMAGED, damaged(frame))
        yield from self._window.add(frame, frame.kind, frame.stamp)

    def _answers(self, gathered: Gathered[Frame[Item]]) -> Iterator[Answer[Item] | Remark]:
        """Identify the targets of a stack."""
        incomplete = f'a stack of {gathered.reason}' if gathered.reason else ''
        if incomplete:
            yield Remark(Kind.INCOMPLETE, incomplete)
        frames = gathered.items
        first_fresh = done = len(frames) - gathered.fresh
        try:
            for part, stack, found in identify_parts(
                self._identifier,
                [frame.image for frame in frames],
                self._stacking,
                fresh=gathered.fresh,
            ):
                split = f'a stack is split: {part.split}' if part.split else ''
                if split:
                    yield Remark(Kind.SPLIT, split)
                start, done = part.images.start, part.images.stop
                fresh = done - max(start, first_fresh)
                yield self._answer(frames[start:done], fresh, stack, found, incomplete, split)
        except Exception as error:
            yield why_failed(error, frames[done:])

    def _answer(
        self,
        frames: tuple[Frame[Item], ...],
        fresh: int,
        stack: ImageStack,
        found: Identification,
        *said: str,
    ) -> Answer[Item]:
        if not self._timed:
            found = replace(found, filter=replace(found.filter, duration=0.0))
        notes = *said, *(damaged(frame) for frame in frames if frame.damage)
        return Answer(
            items=tuple(frame.item for frame in frames),
            fresh=fresh,
            stack=stack,
            identification=found,
            note='; '.join(filter(None, notes)),
            settled=self.memory.families,
        )


def damaged(frame: Frame[Any]) -> str:
    """Return in words that an image is not whole."""
    return f'the image is damaged: {frame.damage}'


def refusal(error: Exception) -> Remark:
    """Return why an image is refused; raise `Unavailable`: another run may find the detector."""
    if isinstance(error, Unavailable):
        raise error
    return why_refused(error)


def why_refused(
    error: Exception, kind: Kind = Kind.REFUSED, items: tuple[Any, ...] = ()
) -> Remark:
    """Return in printable words why images are refused that raise an error, whichever."""
    expected = isinstance(error, ValueError)
    text = printable(str(error), _MAXIMUM_REASON) if expected else reason_of(error)
    return Remark(kind=kind, text=text, error=error, items=items)


def why_failed(error: Exception, frames: Sequence[Frame[Any]]) -> Remark:
    """Return why images are not identified: one of them is refused, or else something failed."""
    kind = Kind.FAILED
    for frame in frames:
        try:
            check_image(frame.image)
        except ValueError:
            kind = Kind.REFUSED
    return why_refused(error, kind, tuple(frame.item for frame in frames))


@dataclass(frozen=True, slots=True)
class Gathered(Generic[Item]):
    """Images that are identified together, in the order in which they came."""

    items: tuple[Item, ...]
    fresh: int  # how many of the last ones have not been answered before
    reason: str = ''  # why there are fewer than a stack has; empty if there are not


class Window(Generic[Item]):
    """Gathers the images of a stream to stacks.

    Examples
    --------
    >>> window = Window(StackSettings(stack=2))
    >>> [stack.items for name in 'abcd' for stack in window.add(name, 'mono8', 0)]
    [('a', 'b'), ('c', 'd')]
    """

    def __init__(self, settings: StackSettings) -> None:
        self._size = settings.stack
        self._sliding = settings.stack_window == SLIDING
        self._items: list[Item] = []
        self._fresh = 0
        self._last: tuple[Hashable, int] = (None, 0)

    @property
    def fresh(self) -> int:
        """Number of images that wait for an answer."""
        return self._fresh

    def add(self, item: Item, kind: Hashable, stamp: int) -> list[Gathered[Item]]:
        """Add an image, or what stands for it, and return the stacks that this completes or ends.

        Another kind (size and encoding) or an earlier stamp (ns) than before begins a new stack.
        """
        ended: list[Gathered[Item]] = []
        before, time = self._last
        if self._items and self._size > 1:
            if kind != before:
                ended = self.end(f'the next image is {kind}, these are {before}')
            elif stamp < time:
                ended = self.end(
                    f'the stamp of the next image is {(time - stamp) / 1e9:.9g} s earlier'
                )
        self._last = kind, stamp
        self._items = [*self._items, item][-self._size :]
        self._fresh += 1
        if len(self._items) < self._size:
            return ended
        full = Gathered(items=tuple(self._items), fresh=self._fresh)
        self._fresh = 0
        if not self._sliding:
            self._items = []
        return [*ended, full]

    def end(self, why: str) -> list[Gathered[Item]]:
        """Begin a new stack, and return what there is of the old one, if it was not answered."""
        items, fresh = tuple(self._items), self._fresh
        self._items, self._fresh = [], 0
        if not fresh:
            return []
        reason = f'{len(items)} of {self._size} images: {why}'
        return [Gathered(items=items, fresh=fresh, reason=reason)]


def _fresh(gathered: Gathered[Item]) -> tuple[Item, ...]:
    """Return the images of a stack that have not been answered before."""
    return gathered.items[len(gathered.items) - gathered.fresh :]


@dataclass(frozen=True, slots=True)
class Part:
    """Consecutive images of a stack that are identified together."""

    images: range  # their indices in the stack
    split: str = ''  # why the stack was split before the first of them; empty at its beginning


Confirmed = Callable[[Displacement, Sequence[np.ndarray]], bool]
"""Whether a scene moved as it seems to have, between the first and the last of some images."""


def unmoved_parts(
    images: Sequence[np.ndarray],
    look_for_movement: bool = True,
    confirmed: Confirmed = lambda moved, images: True,
) -> list[Part]:
    """Return the parts of a stack that can be combined and in which nothing moved.

    `images` are of shape (height, width) and of type uint8, uint16, float32 or float64, in the
    order in which they were taken. Without `look_for_movement` only size and type count.

    Examples
    --------
    >>> images = [np.zeros((20, 30), np.uint8), np.zeros((20, 40), np.uint8)]
    >>> [part.images for part in unmoved_parts(images)]
    [range(0, 1), range(1, 2)]
    """
    parts: list[Part] = []
    begin, split = 0, ''
    edges = None
    for index in range(1, len(images)):
        why = unlike(images[begin], images[index])
        if why:
            why = f'image {index + 1} of the stack {why}'
        elif look_for_movement:
            edges = edges or find_edges(images[begin])
            moved = displacement(edges, images[index])
            if moved and confirmed(moved, images[begin : index + 1]):
                why = f'the scene moved by {moved} before image {index + 1} of the stack'
        if why:
            parts.append(Part(range(begin, index), split))
            begin, split, edges = index, why, None
    return [*parts, Part(range(begin, len(images)), split)]


def _witnessed(identifier: Identifier) -> Confirmed:
    """Return how the targets of images confirm a movement.

    Where too few of them tell, the images have moved unless together they show a number of targets
    that is nearer to N.
    """
    known: dict[int, list[Target]] = {}

    def seen(image: np.ndarray) -> list[Target]:
        if id(image) not in known:
            known[id(image)] = identifier.seen(ImageStack((image,)))
        return known[id(image)]

    def confirmed(moved: Displacement, images: Sequence[np.ndarray]) -> bool:
        before, after = seen(images[0]), seen(images[-1])
        told = targets_moved(moved, before, after)
        if told is not None or not identifier.expected:
            return told is not False
        apart = max(abs(identifier.expected - count_codes(it)) for it in (before, after))
        together = identifier.seen(ImageStack(tuple(images)))
        return abs(identifier.expected - count_codes(together)) >= apart

    return confirmed


def identify_parts(
    identifier: Identifier,
    images: Sequence[np.ndarray],
    settings: StackSettings,
    fresh: int | None = None,
) -> Iterator[tuple[Part, ImageStack, Identification]]:
    """Yield the parts of a stack with their images and identifications.

    Parameters
    ----------
    identifier : Identifier
    images : sequence of ndarray of uint8, uint16, float32 or float64, shape (height, width)
        In the order in which they were taken; one image is identified as it is.
    settings : StackSettings
    fresh : int, optional
        How many of the last images were not identified before; parts without them are left out.
        All where None.

    Raises
    ------
    ValueError
        As `Identifier.identify` does.

    Examples
    --------
    >>> from ahf_ros import SceneSettings, create_identifier, render
    >>> scene = SceneSettings(width=320, height=240, targets=3, dot_radius=8, phases=2)
    >>> images = [render(scene, phase).image for phase in range(2)]
    >>> found = identify_parts(create_identifier(), images, StackSettings(stack=2))
    >>> [(part.images, found.count) for part, _, found in found]
    [(range(0, 2), 3)]
    """
    first_fresh = 0 if fresh is None else len(images) - fresh
    for part in unmoved_parts(images, settings.stack_movement, _witnessed(identifier)):
        if part.images.stop > first_fresh:
            stack = ImageStack(tuple(images[index] for index in part.images))
            yield part, stack, identifier.identify(stack)
