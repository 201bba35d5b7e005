"""Unevenness that is fixed to a sheet: noise that repeats itself after a long way."""

import numpy as np

_SIDE = 1024  # cells until noise repeats itself; a power of 2


class Grain:
    """Noise with the variance 1, equal within the cells of a grid."""

    def __init__(self, size: float, generator: np.random.Generator) -> None:
        """Draw noise for cells of a size, mm."""
        self._size = size
        self._values = generator.standard_normal((_SIDE, _SIDE), dtype=np.float32)

    def at(
        self, width: np.ndarray, height: np.ndarray, *, part: int = 0, coarser: float = 1.0
    ) -> np.ndarray:
        """Return the noise at places on a sheet, float32.

        Parts, 0 to 3, are not correlated with each other; cells may be larger by a factor.
        """
        scale = 1 / (self._size * coarser)
        offset = part * (_SIDE // 4) + _SIDE // 8
        columns = np.floor(width * scale).astype(np.int32) + offset
        rows = np.floor(height * scale).astype(np.int32) + offset
        return self._values[rows & (_SIDE - 1), columns & (_SIDE - 1)]
