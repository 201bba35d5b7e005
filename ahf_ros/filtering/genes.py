"""What of the filter a search tunes.

The published search [1]_ tunes the two gains and leaves the rest to Eq. (8) and the median of D.
The extended one, which finds more with as many filters (`benchmarks/strategies.py`), also tunes

- the cut-off. Cut-off and attenuation enter Eq. (4) as c / D0^2 alone, so that one of them is
  enough: a small D0 is a wide blur, which evens out light that changes slowly.
- the contrast of the output, g^p with an exponent p up to 1. For p near 0 the 8-bit image shows
  ln g. As g^p = exp(p s), the exponent is a factor of both gains: there is no filter that the
  four numbers of `ahf_ros.filtering.transfer.Transfer` do not describe.

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

_CUTOFF_STEP, _EXPONENT_STEP = 0.5, 1.0  # octaves


@dataclass(frozen=True, slots=True)
class TuningSettings:
    """Which filters are tried."""

    search: str = parameter(
        EXTENDED,
        'published: the gains are searched for, as in the paper; extended: also cut-off and '
        'output contrast.',
        choices=(EXTENDED, PUBLISHED),
    )
    gamma_high_min: float = parameter(
        1.0, 'Smallest gain of the high frequencies.', minimum=0.1, maximum=20.0
    )
    gamma_high_max: float = parameter(
        4.0, 'Largest gain of the high frequencies.', minimum=0.1, maximum=20.0
    )
    gamma_high_step: float = parameter(
        0.1, 'Step of the gain of the high frequencies.', minimum=0.001, maximum=20.0
    )
    gamma_low_min: float = parameter(
        0.0, 'Smallest gain of the low frequencies.', minimum=0.0, maximum=20.0
    )
    gamma_low_max: float = parameter(
        1.0,
        'Largest gain of the low frequencies, at most gamma_high_min.',
        minimum=0.0,
        maximum=20.0,
    )
    gamma_low_step: float = parameter(
        0.01, 'Step of the gain of the low frequencies.', minimum=0.001, maximum=20.0
    )
    cutoff_min: float = parameter(
        0.0625,
        'Smallest cut-off of an extended search, as a share of the published one, the median.',
        minimum=0.02,
        maximum=4.0,
    )
    cutoff_max: float = parameter(
        2.0, 'Largest cut-off of an extended search.', minimum=0.02, maximum=4.0
    )
    exponent_min: float = parameter(
        0.125,
        'Smallest exponent of the output in an extended search; near 0 its logarithm is shown.',
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
        """What is searched for: the gains, then octaves of the cut-off and of the exponent."""
        gains = (
            Gene('gamma_high', self.gamma_high_min, self.gamma_high_max, self.gamma_high_step),
            Gene('gamma_low', self.gamma_low_min, self.gamma_low_max, self.gamma_low_step),
        )
        if self.search == PUBLISHED:
            return gains
        cutoffs = math.log2(self.cutoff_min), math.log2(self.cutoff_max)
        lowest = math.ceil(math.log2(self.exponent_min))
        return (
            *gains,
            Gene('cutoff', *cutoffs, _CUTOFF_STEP),
            Gene('exponent', lowest, 0.0, _EXPONENT_STEP),
        )

    def _check_order(self, lower: str, upper: str) -> None:
        lowest, highest = getattr(self, lower), getattr(self, upper)
        if lowest > highest:
            raise ValueError(
                f'{lower} is {lowest!r}, accepted is a number of at most {upper}, {highest!r}'
            )


def tuned(shape: tuple[int, int], values: Values) -> Transfer:
    """Return the filter of an image that values of the genes stand for.

    Parameters
    ----------
    shape : tuple of int
        Height and width of the image, px.
    values : tuple of float
        Of two genes or of four, see `TuningSettings.genes`.
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
