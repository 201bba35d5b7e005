"""Search space of the filter.

The published search [1]_ tunes the two gains; Eq. (8) gives the attenuation and the median of D
the cut-off. The extended search, which finds more with the same number of filters, also
tunes

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

from ahf_ros.filtering.chromosome import Gene, Values
from ahf_ros.filtering.settings import PUBLISHED, TuningSettings
from ahf_ros.filtering.transfer import Transfer, median_distance, transfer

_CUTOFF_STEP, _EXPONENT_STEP = 0.5, 1.0  # octaves: 11 cut-offs and 4 exponents by default


FIRST = ((3.1, 0.85, -2.5, 0.0), (4.0, 0.18, -3.0, -2.0), (3.8, 0.85, -0.5, 0.0))
"""Values of the genes of filters that are far apart. Of thirty filters the first two helped `ring`
most often, the others `gsi` and `dots`; where none of them shows more targets than the image as
received, hardly any other filter does."""


def genes_of(settings: TuningSettings) -> tuple[Gene, ...]:
    """Return the genes of the gains and, if extended, of cut-off and exponent in octaves.

    Parameters
    ----------
    settings : TuningSettings
    """
    gains = (
        Gene(
            'gamma_high',
            settings.gamma_high_min,
            settings.gamma_high_max,
            settings.gamma_high_step,
        ),
        Gene('gamma_low', settings.gamma_low_min, settings.gamma_low_max, settings.gamma_low_step),
    )
    if settings.search == PUBLISHED:
        return gains
    cutoffs = math.log2(settings.cutoff_min), math.log2(settings.cutoff_max)
    exponent = math.ceil(math.log2(settings.exponent_min))
    return (
        *gains,
        Gene('cutoff', *cutoffs, _CUTOFF_STEP),
        Gene('exponent', exponent, 0.0, _EXPONENT_STEP),
    )


def with_combination(genes: tuple[Gene, ...], count: int) -> tuple[Gene, ...]:
    """Return the genes of an image, or of a stack with a number of combinations."""
    return genes if count == 1 else (*genes, Gene('combination', 0.0, count - 1.0, 1.0))


def first_filters(genes: tuple[Gene, ...], plain: Values | None) -> list[Values]:
    """Return the values of filters that are far apart, to try first.

    Parameters
    ----------
    genes : tuple of Gene
        Two or four, and the combination of a stack.
    plain : tuple of float or None
        Combination of a stack that is filtered; None for one image.
    """
    combination = plain or ()
    return [(*of[: len(genes) - len(combination)], *combination) for of in FIRST]


def tuned(shape: tuple[int, int], values: Values) -> Transfer:
    """Return the filter of an image for values of the genes.

    Parameters
    ----------
    shape : tuple of int
        Height and width of the image, px.
    values : tuple of float
        Values of two or four genes, see `genes_of`.
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
