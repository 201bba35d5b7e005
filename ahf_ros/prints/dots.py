"""Rings of dots: a disc, small dots round it that are the code, and a border about them.

After Knyaz & Sibiryakov, ISPRS Commission V, 1998. Dot s stands at s 360/n degrees
counter-clockwise from any start as seen on the printed target. A word and its mirror image are
one code, as are its rotations, so that a target may be read from behind. The smallest of all of
them is canonical.
"""

from dataclasses import dataclass
from math import pi, sin
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ahf_ros.base.opening import reader
from ahf_ros.prints.cyclic import CyclicPrint, mirrored_words, smallest_rotation
from ahf_ros.prints.data_file import pinhole_in, read_data_file
from ahf_ros.prints.kept import kept_while_unchanged
from ahf_ros.prints.prints import Disc, Proportions, Ring, Shape

DOTS_DESIGN = Path(__file__).with_name('dots.json')
"""The design of rings of dots that this package prints."""

_MARGIN = 1.0  # about the border, in radii of the disc


@dataclass(frozen=True, slots=True, eq=False)
class DotRingPrint(CyclicPrint):
    """The code words of one kind of ring of dots, and the proportions of its print.

    Lengths are in radii of the disc: the radius of the circle on which the small dots stand, their
    own radius, the inner and outer radius of the border, and the radius of the hole in the disc.
    """

    direction: ClassVar[str] = 'either'

    dot_circle: float
    dot_radius: float
    ground_radius: float
    border_radius: float
    pinhole: float = 0.0

    @property
    def proportions(self) -> Proportions:
        """What all targets have in common."""
        return Proportions(
            reach=self.border_radius,
            radius=1.0,
            quiet_zone=self.border_radius + _MARGIN,
            radii={
                'dot': 1.0,
                'dot_circle': self.dot_circle,
                'small_dot': self.dot_radius,
                'ground': self.ground_radius,
                'border': self.border_radius,
            },
            pinhole=self.pinhole,
        )

    def ink(self, word: int, pinhole: float = 0.0) -> tuple[Shape, ...]:
        """Return disc, small dots and border of a word."""
        dots = [Disc(self.dot_radius, 0.0, x, y) for x, y in self.places(word).tolist()]
        return (Disc(1.0, pinhole), *dots, Ring(self.ground_radius, self.border_radius))

    def canonical(self, words: Any) -> np.ndarray:
        """Return the smallest of all words that are the same code, ndarray of int64."""
        return smallest_bracelet(words, self.bits)

    def orbits(self, numbers: np.ndarray) -> np.ndarray:
        """Return all rotations and reflections of the word of each ID, shape (n, k)."""
        turned = CyclicPrint.orbits(self, numbers).astype(np.int64)
        both = np.concatenate([turned, mirrored_words(turned, self.bits)], axis=1)
        return both.astype(np.uint64)

    def places(self, word: int, turn: float = 0.0) -> np.ndarray:
        """Return the centres of the small dots of a word, shape (n, 2), in radii of the disc.

        `turn` is the direction of the place of dot 0, rad.
        """
        which = np.flatnonzero(word >> np.arange(self.bits) & 1)
        angles = turn + 2 * pi * which / self.bits
        return self.dot_circle * np.stack([np.cos(angles), np.sin(angles)], axis=1)


@kept_while_unchanged
@reader('a data file of rings of dots')
def dot_family(path: str = '') -> DotRingPrint:
    """Return the family of rings of dots in a data file; our own where empty.

    The file is JSON or YAML, see docs/dots.md. A ValueError names line and field of what is not
    accepted.

    Examples
    --------
    >>> family = dot_family()
    >>> family.words.size, family.number(0b1000000001)
    (76, 2)
    """
    lengths = ('dot_circle', 'dot_radius', 'ground_radius', 'border_radius')
    fields = read_data_file(path or DOTS_DESIGN).keys(
        ('family', 'bits', *lengths), ('pinhole', 'source')
    )
    circle, radius, ground, border = (
        fields[name].number('a length in radii of the disc', 1e-3) for name in lengths
    )
    bits = fields['bits'].integer(6, 20)
    if circle - radius <= 1:
        fields['dot_circle'].refuse(f'more than {1 + radius:g}, clear of the disc')
    if circle + radius >= ground:
        fields['ground_radius'].refuse(f'more than {circle + radius:g}, clear of the dots')
    if ground >= border:
        fields['border_radius'].refuse(f'more than {ground:g}, the ground_radius')
    widest = circle * sin(pi / bits)
    if radius >= widest:
        fields['dot_radius'].refuse(f'less than {widest:.3g}, so that the dots do not overlap')
    words = np.arange(1, (1 << bits) - 1)  # neither the empty ring nor the full one
    words = words[words == smallest_bracelet(words, bits)]
    words.setflags(write=False)
    return DotRingPrint(
        name=fields['family'].text(),
        bits=bits,
        words=words,
        numbers=np.arange(1, words.size + 1),
        dot_circle=circle,
        dot_radius=radius,
        ground_radius=ground,
        border_radius=border,
        pinhole=pinhole_in(fields),
    )


def smallest_bracelet(words: Any, bits: int) -> np.ndarray:
    """Return the smallest of all rotations and reflections of words, ndarray of int64."""
    words = np.asarray(words, dtype=np.int64)
    return np.minimum(
        smallest_rotation(words, bits), smallest_rotation(mirrored_words(words, bits), bits)
    )
