"""Code words of different ring families whose targets have the same print.

A word all of whose runs are a multiple of some angle may be a word of other numbers of sectors,
too: 000111000111 of 12 bit is 0000111100001111 of 16. Nothing in an image of the target shows
which one is meant.
"""

from __future__ import annotations

from functools import lru_cache

from ahf_ros.codes.cyclic import rotated_words, smallest_rotation
from ahf_ros.codes.ring import FAMILY_NAMES, family, sector_count


@lru_cache(maxsize=100_000)
def words_of_print(name: str, word: int) -> dict[str, int]:
    """Return the canonical words of all families whose targets have the print of a word.

    Parameters
    ----------
    name : str
        One of `ahf_ros.codes.ring.FAMILY_NAMES`.
    word : int
        Canonical word of this family.

    Returns
    -------
    dict of str to int
        By the name of the family; `name` is included.

    Examples
    --------
    >>> words_of_print('metashape12', 455)
    {'metashape12': 455, 'metashape16': 3855, 'metashape20': 31775}
    >>> words_of_print('metashape12', 71)
    {'metashape12': 71}
    """
    code = family(name)
    bits, fewest = fewest_sectors(word, code.bits)
    words = {name: word}
    for other in FAMILY_NAMES:
        count = sector_count(other)
        if other == name or count % bits or family(other).band != code.band:
            continue
        wide = (1 << count // bits) - 1
        spread = sum(wide << bit * (count // bits) for bit in range(bits) if fewest >> bit & 1)
        if family(other).number(spread) is not None:
            words[other] = int(smallest_rotation(spread, count))
    return {other: words[other] for other in FAMILY_NAMES if other in words}


def fewest_sectors(word: int, bits: int) -> tuple[int, int]:
    """Return the print of a word with as few sectors as show it: their number, and the word.

    Examples
    --------
    >>> fewest_sectors(0b000111000111, 12)
    (4, 5)
    """
    for count in range(1, bits):
        width, rest = divmod(bits, count)
        if rest:
            continue
        wide = (1 << width) - 1
        for turn in range(width):
            turned = rotated_words(word, turn, bits)
            blocks = [turned >> bit * width & wide for bit in range(count)]
            if all(block in (0, wide) for block in blocks):
                return count, sum((block > 0) << bit for bit, block in enumerate(blocks))
    return bits, word
