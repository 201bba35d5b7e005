"""Several images of an unmoved scene as one identification: which belong together.

Images come one by one. A `Window` gathers them to stacks; `unmoved_parts` splits a stack where it
turns out that the scene moved, or that images cannot be combined.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from ahf_ros.filtering.identifier import Identifier
from ahf_ros.imaging.movement import displacement, find_edges
from ahf_ros.imaging.stack import ImageStack, unlike
from ahf_ros.session_settings import SLIDING, StackSettings
from ahf_ros.target import Identification

Item = TypeVar('Item')


@dataclass(frozen=True, slots=True)
class Gathered(Generic[Item]):
    """Images that are identified together.

    Attributes
    ----------
    items : tuple
        In the order in which they came.
    fresh : int
        How many of the last ones have not been answered before.
    reason : str
        Why there are fewer than a stack has; empty if there are not.
    """

    items: tuple[Item, ...]
    fresh: int
    reason: str = ''


class Window(Generic[Item]):
    """Gathers the images of a stream to stacks.

    Parameters
    ----------
    settings : StackSettings

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
        """Add an image and return the stacks that this completes or ends.

        Parameters
        ----------
        item
            The image, or what stands for it.
        kind : hashable
            Its size and encoding; another one begins a new stack.
        stamp : int
            Its time, ns; an earlier one than before begins a new stack.
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
        full = Gathered(tuple(self._items), self._fresh)
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
        return [Gathered(items, fresh, f'{len(items)} of {self._size} images: {why}')]


@dataclass(frozen=True, slots=True)
class Part:
    """Consecutive images of a stack that are identified together.

    Attributes
    ----------
    images : range
        Their indices in the stack.
    split : str
        Why the stack was split before the first of them; empty at its beginning.
    """

    images: range
    split: str = ''


def unmoved_parts(images: Sequence[np.ndarray], look_for_movement: bool = True) -> list[Part]:
    """Return the parts of a stack that can be combined and in which nothing moved.

    Parameters
    ----------
    images : sequence of ndarray of uint8, uint16, float32 or float64, shape (height, width)
        In the order in which they were taken.
    look_for_movement : bool
        False if only size and pixel type count.

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
            if moved := displacement(edges, images[index]):
                why = f'the scene moved by {moved} before image {index + 1} of the stack'
        if why:
            parts.append(Part(range(begin, index), split))
            begin, split, edges = index, why, None
    return [*parts, Part(range(begin, len(images)), split)]


def identify_parts(
    identifier: Identifier,
    images: Sequence[np.ndarray],
    settings: StackSettings,
    expected_targets: int | None = None,
    fresh: int | None = None,
) -> Iterator[tuple[Part, ImageStack, Identification]]:
    """Yield the parts of a stack with their images and identifications.

    Parameters
    ----------
    identifier : Identifier
    images : sequence of ndarray of uint8, uint16, float32 or float64, shape (height, width)
        In the order in which they were taken; one image is identified as it is.
    settings : StackSettings
    expected_targets : int, optional
        N, as for `Identifier.identify`.
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
    for part in unmoved_parts(images, settings.stack_movement):
        if part.images.stop > first_fresh:
            stack = ImageStack(tuple(images[index] for index in part.images))
            yield part, stack, identifier.identify(stack, expected_targets=expected_targets)
