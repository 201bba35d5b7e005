"""What a print is: code words and IDs, and the ink of each word as shapes with lengths.

Lengths are in radii of the dot, with x to the right and y upwards as printed. The origin is the
centre of the target. The corner or edge where the reading of a word begins lies on the x axis.
The printer draws the outlines of the shapes, and rendered scenes have their ink.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np


@dataclass(frozen=True, slots=True)
class Disc:
    """A disc, with a hole in its middle unless the radius `hole` is 0."""

    radius: float
    hole: float = 0.0
    x: float = 0.0
    y: float = 0.0


@dataclass(frozen=True, slots=True)
class Ring:
    """A closed ring about the centre of the target."""

    inner: float
    outer: float


@dataclass(frozen=True, slots=True)
class Sectors:
    """Sectors of a ring, counter-clockwise from the x axis; `inked` says which have ink."""

    inner: float
    outer: float
    inked: tuple[bool, ...]


@dataclass(frozen=True, slots=True)
class Cells:
    """A square of cells, in rows from the top; `inked` says which have ink."""

    half_side: float
    inked: tuple[tuple[bool, ...], ...]


Shape = Disc | Ring | Sectors | Cells
"""A part of the ink. No two of a print overlap."""


@dataclass(frozen=True, slots=True)
class Proportions:
    """What the targets of a family have in common; lengths are in radii of the dot.

    `reach` is the radius of the circle that holds all ink, `radius` that of the circle whose image
    is reported as the ellipse of the target, and `quiet_zone` that of the area that is left free.
    `radii` has the lengths of the design by their names. `pinhole` is the radius of the hole in
    the dot, 0 for none, and `polarity` the colour of the ink, 'dark' or 'bright'.
    """

    reach: float
    radius: float
    quiet_zone: float
    radii: dict[str, float]
    pinhole: float = 0.0
    polarity: str = 'dark'

    def chosen(self, polarity: str, pinhole: float) -> Proportions:
        """Return those of a print whose colour and hole are chosen.

        They are the family's where the colour is 'auto' and the hole negative.
        """
        return replace(
            self,
            polarity=self.polarity if polarity == 'auto' else polarity,
            pinhole=self.pinhole if pinhole < 0 else pinhole,
        )


class Print(ABC):
    """The print of a family, without an image: what every room that knows targets reads.

    Attributes
    ----------
    name : str
        Name of the family.
    numbers : ndarray of int64, shape (n,)
        Its IDs, in the order of its code words.
    polarity : str
        Colour that the ink of targets may have, 'dark', 'bright' or 'both'.
    has_pinhole : bool
        Whether the dot may have a hole.
    """

    __slots__ = ()

    name: str
    polarity: str = 'both'
    has_pinhole: ClassVar[bool] = False

    if TYPE_CHECKING:  # a field of some prints, for which a property here would be the default

        @property
        def numbers(self) -> np.ndarray:
            """All IDs."""

    @property
    def all_ids(self) -> list[int]:
        """All IDs, ascending."""
        return [int(number) for number in np.sort(self.numbers)]

    @abstractmethod
    def word(self, number: int) -> int:
        """Return the code word of an ID; raise a ValueError if there is none."""

    @property
    @abstractmethod
    def proportions(self) -> Proportions:
        """What all targets have in common."""

    @abstractmethod
    def ink(self, word: int, pinhole: float = 0.0) -> tuple[Shape, ...]:
        """Return the ink of a word; the radius of the hole counts where there may be one."""

    @property
    def reading(self) -> dict[str, int | str]:
        """How words are read: `bits`, `first_bit` and `direction`; empty if none are read."""
        return {}

    def mirrored(self, word: int) -> int | None:
        """Return the ID that a word has in a mirror, None if none can be read there.

        It is the same ID for a symmetric target.
        """
        return None

    def orbits(self, numbers: np.ndarray) -> np.ndarray:
        """Return all words that are the code of each ID, ndarray of uint64, shape (n, k)."""
        words = [self.word(number) for number in numbers.tolist()]
        return np.array(words, np.uint64)[:, None]
