"""Parts of an image, and which are worth one search together."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations
from typing import TypeAlias

Part: TypeAlias = tuple[int, int, int, int]
"""A part of an image: its edges left, top, right and bottom, px."""


def area(part: Part) -> int:
    """Return the number of pixels of a part."""
    return (part[2] - part[0]) * (part[3] - part[1])


def joined(parts: Iterable[Part], each: int) -> list[Part]:
    """Return parts, two as one where the part about both is no more work.

    The work is that of the pixels, and `each` pixels more for a part, whatever its size is.

    Examples
    --------
    >>> joined([(0, 0, 10, 10), (20, 0, 30, 10), (0, 90, 10, 99)], 100)
    [(0, 0, 30, 10), (0, 90, 10, 99)]
    """
    found = list(parts)
    while True:
        for first, second in combinations(range(len(found)), 2):
            one, other = found[first], found[second]
            left, top, right, bottom = one
            both = (
                min(left, other[0]),
                min(top, other[1]),
                max(right, other[2]),
                max(bottom, other[3]),
            )
            if area(both) <= area(one) + area(other) + each:
                found[first] = both
                del found[second]
                break
        else:
            return found
