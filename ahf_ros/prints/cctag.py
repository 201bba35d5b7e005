"""CCTags: concentric circles whose widths are the code (Calvet et al., CVPR 2016, 562-570).

From the outside to the middle, black and white rings follow each other, each of which is narrow or
wide. Read in that order, the highest bit first and 1 where a ring is wide, they are the ID. What
is left in the middle is white. The tables of radii that the authors print follow this rule.
"""

from dataclasses import dataclass

import numpy as np

from ahf_ros.prints.prints import Disc, Print, Proportions, Shape

_QUIET_ZONE = 1.5  # in radii of the outermost circle, which is the dot
_WIDTHS = {'cctag3': (5, 0.10, 0.15), 'cctag4': (7, 0.08, 0.12)}


@dataclass(frozen=True, slots=True)
class CctagPrint(Print):
    """The CCTags of one number of black rings.

    `bits` is the number of rings, black and white, that are read; `narrow` and `wide` are their
    widths in radii of the outermost circle.
    """

    name: str
    bits: int
    narrow: float
    wide: float

    @property
    def numbers(self) -> np.ndarray:
        """All IDs, ndarray of int64, ascending."""
        return np.arange(1 << self.bits)

    @property
    def proportions(self) -> Proportions:
        """What all targets have in common."""
        return Proportions(reach=1.0, radius=1.0, quiet_zone=_QUIET_ZONE, radii={'dot': 1.0})

    def word(self, number: int) -> int:
        """Return the code word of an ID, which is the same; raise a ValueError if none is."""
        if not 0 <= number < 1 << self.bits:
            raise ValueError(
                f'number is {number}, accepted is an ID of {self.name} from 0 to '
                f'{(1 << self.bits) - 1}'
            )
        return number

    def ink(self, word: int, pinhole: float = 0.0) -> tuple[Shape, ...]:
        """Return the black rings of a word, from the outside inwards."""
        radii = self.radii(np.array([word]))[0].tolist()
        return tuple(Disc(*ends) for ends in zip(radii[::2], radii[1::2], strict=True))

    def radii(self, numbers: np.ndarray) -> np.ndarray:
        """Return the radii of the circles of IDs (k,), from 1 inwards, shape (k, bits + 1)."""
        wide = np.asarray(numbers)[:, None] >> np.arange(self.bits)[::-1] & 1
        widths = np.where(wide, self.wide, self.narrow)
        return 1 - np.concatenate([np.zeros((len(widths), 1)), widths.cumsum(axis=1)], axis=1)


def circle_family(name: str) -> CctagPrint:
    """Return the family of a name of `CCTAG_NAMES`.

    Examples
    --------
    >>> circle_family('cctag3').radii([4]).round(2).tolist()
    [[1.0, 0.9, 0.8, 0.65, 0.55, 0.45]]
    """
    return CctagPrint(name, *_WIDTHS[name])
