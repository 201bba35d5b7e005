"""Search space of the filter.

The published search [1]_ tunes the two gains; Eq. (8) gives the attenuation and the median of D
the cut-off. The extended search, which finds more with the same number of filters, also
tunes

- the cut-off. Eq. (4) depends on cut-off and attenuation through c / D0^2 only, so one of them is
  enough. A small D0 is a wide blur, which removes slow changes of light.
- the contrast of the output, g^p with an exponent p up to 1. With p near 0 the 8-bit image shows
  ln g. Because g^p = exp(p s), the exponent is a factor of both gains: the four numbers of
  `ahf_ros.identification.filtering.homomorphic.Transfer` describe every filter of the space.

Of a stack of images, the combination that is filtered is one more gene, the last one.

References
----------
.. [1] Shang & Liu, Remote Sens. 2023, 15, 3151.
"""

import math

from ahf_ros.identification.filtering.genetic import Gene, Values
from ahf_ros.identification.filtering.homomorphic import Transfer, median_distance, transfer
from ahf_ros.identification.filtering.settings import PUBLISHED, TuningSettings

FIRST = ((3.1, 0.85, -2.5, 0.0), (4.0, 0.18, -3.0, -2.0), (3.8, 0.85, -0.5, 0.0))
"""Values of the genes of filters that are far apart. Of thirty filters the first two helped `ring`
most often, the others `gsi` and `dots`; where none of them shows more targets than the image as
received, hardly any other filter does."""

BEGINNING = (
    (2.0, 0.7, 0.5, -3.0),
    (1.2, 0.9, -3.5, -3.0),
    (1.2, 0.3, -0.5, -2.0),
    (1.2, 0.3, 1.0, -1.0),
)
"""The same for detectors that need a filter. Of a hundred, through these `traditional` read most
targets under stripes and lattices in development, and they are far apart."""


def genes_of(settings: TuningSettings, combinations: int = 1) -> tuple[Gene, ...]:
    """Return the genes of the search space; cut-off and exponent are in octaves."""
    genes = [
        Gene(settings.gamma_high_min, settings.gamma_high_max, settings.gamma_high_step),
        Gene(settings.gamma_low_min, settings.gamma_low_max, settings.gamma_low_step),
    ]
    if settings.search != PUBLISHED:  # by default 11 cut-offs and 4 exponents
        cutoffs = math.log2(settings.cutoff_min), math.log2(settings.cutoff_max)
        genes.append(Gene(*cutoffs, step=0.5))
        genes.append(Gene(math.ceil(math.log2(settings.exponent_min)), 0.0, step=1.0))
    if combinations > 1:
        genes.append(Gene(0.0, combinations - 1.0, step=1.0))
    return tuple(genes)


def tuned(shape: tuple[int, int], values: Values) -> Transfer:
    """Return the filter of an image of a height and width for values of two or four genes."""
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
