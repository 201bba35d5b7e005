"""Search space of the filter.

The published search [1]_ tunes the two gains; Eq. (8) gives the attenuation and the median of D
the cut-off. The extended search, which finds more with the same number of filters
(`benchmarks/strategies.py`), also tunes

- the cut-off. Eq. (4) depends on cut-off and attenuation through c / D0^2 only, so one of them is
  enough. A small D0 is a wide blur, which removes slow changes of light.
- the contrast of the output, g^p with an exponent p up to 1. With p near 0 the 8-bit image shows
  ln g. Because g^p = exp(p s), the exponent is a factor of both gains: the four numbers of
  `ahf_ros.filtering.transfer.Transfer` describe every filter of the space.

Of a stack of images, the combination that is filtered is one more gene, the last one.

References
----------
.. [1] Shang & Liu, Remote Sens. 2023, 15, 3151.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ahf_ros.filtering.chromosome import Gene, Values
from ahf_ros.filtering.transfer import Transfer, median_distance, transfer
from ahf_ros.settings.parameter import check_parameters, parameter

PUBLISHED, EXTENDED = 'published', 'extended'

_CUTOFF_STEP, _EXPONENT_STEP = 0.5, 1.0  # octaves: 11 cut-offs and 4 exponents by default


@dataclass(frozen=True, slots=True)
class TuningSettings:
    """Ranges of the filters that a search tries."""

    search: str = parameter(
        EXTENDED,
        'published: tunes the gains, as in the paper; extended: also tunes cut-off and output '
        'contrast.',
        choices=(EXTENDED, PUBLISHED),
    )
    gamma_high_min: float = parameter(
        1.0, 'Minimum gain of the high frequencies.', minimum=0.1, maximum=20.0
    )
    gamma_high_max: float = parameter(
        4.0, 'Maximum gain of the high frequencies.', minimum=0.1, maximum=20.0
    )
    gamma_high_step: float = parameter(
        0.1, 'Step of the gain of the high frequencies.', minimum=0.001, maximum=20.0
    )
    gamma_low_min: float = parameter(
        0.0, 'Minimum gain of the low frequencies.', minimum=0.0, maximum=20.0
    )
    gamma_low_max: float = parameter(
        1.0,
        'Maximum gain of the low frequencies, at most gamma_high_min.',
        minimum=0.0,
        maximum=20.0,
    )
    gamma_low_step: float = parameter(
        0.01, 'Step of the gain of the low frequencies.', minimum=0.001, maximum=20.0
    )
    cutoff_min: float = parameter(
        0.0625,
        'Minimum cut-off of an extended search, as a fraction of the published one, the median.',
        minimum=0.02,
        maximum=4.0,
    )
    cutoff_max: float = parameter(
        2.0,
        'Maximum cut-off of an extended search, likewise.',
        minimum=0.02,
        maximum=4.0,
    )
    exponent_min: float = parameter(
        0.125,
        'Minimum exponent of the output in an extended search; near 0 shows the logarithm.',
        minimum=0.01,
        maximum=1.0,
    )

    def __post_init__(self) -> None:
        """Check every parameter, and the ranges against each other."""
        check_parameters(self)
        self._check_order('gamma_high_min', 'gamma_high_max')
        self._check_order('gamma_low_min', 'gamma_low_max')
        self._check_order('gamma_low_max', 'gamma_high_min')
        self._check_order('cutoff_min', 'cutoff_max')

    @property
    def genes(self) -> tuple[Gene, ...]:
        """The gains and, if extended, cut-off and exponent in octaves."""
        gains = (
            Gene('gamma_high', self.gamma_high_min, self.gamma_high_max, self.gamma_high_step),
            Gene('gamma_low', self.gamma_low_min, self.gamma_low_max, self.gamma_low_step),
        )
        if self.search == PUBLISHED:
            return gains
        cutoffs = math.log2(self.cutoff_min), math.log2(self.cutoff_max)
        exponent = math.ceil(math.log2(self.exponent_min))
        return (
            *gains,
            Gene('cutoff', *cutoffs, _CUTOFF_STEP),
            Gene('exponent', exponent, 0.0, _EXPONENT_STEP),
        )

    def _check_order(self, lower: str, upper: str) -> None:
        value, maximum = getattr(self, lower), getattr(self, upper)
        if value > maximum:
            raise ValueError(
                f'{lower} is {value!r}, accepted is a number of at most {upper}, {maximum!r}'
            )


def with_combination(genes: tuple[Gene, ...], count: int) -> tuple[Gene, ...]:
    """Return the genes of an image, or those of a stack with a number of combinations."""
    return genes if count == 1 else (*genes, Gene('combination', 0.0, count - 1.0, 1.0))


def tuned(shape: tuple[int, int], values: Values) -> Transfer:
    """Return the filter of an image for values of the genes.

    Parameters
    ----------
    shape : tuple of int
        Height and width of the image, px.
    values : tuple of float
        Values of two or four genes, see `TuningSettings.genes`.
    """
    if len(values) == 2:
        return transfer(shape, *values)
    gamma_high, gamma_low, cutoff, exponent = values
    factor = 2.0**exponent
    return transfer(
        shape,
        factor * gamma_high,
        factor * gamma_low,
        cutoff=median_distance(*shape) * 2.0**cutoff,
        attenuation=gamma_high - gamma_low,
    )
