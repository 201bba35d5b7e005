"""Units of length that coordinates may have, and how many decimals are shown of them."""

import math
from collections.abc import Iterable

METRES = {
    'm': 1.0,
    'dm': 0.1,
    'cm': 1e-2,
    'mm': 1e-3,
    'um': 1e-6,
    'µm': 1e-6,
    'in': 0.0254,
    'ft': 0.3048,
}
"""Their names, and how many metres they are."""

_SMALLEST, _LARGEST = 0.01, 2000.0  # m, of objects that are photographed for coordinates
_HELD = 1e-6  # of the largest standard deviation: of what a datum holds, and rounding
_ALIKE = 1.2  # ratio of two sizes of one object


def unlikely(size: float, unit: str) -> str | None:
    """Return a remark on an object of a size in a unit that hardly exists, with one that may be.

    >>> unlikely(1.9, 'mm')
    'unit is mm, which makes the object 1.9 mm large: is it m?'
    """
    if unit not in METRES or _SMALLEST <= size * METRES[unit] <= _LARGEST:
        return None
    likely = [it for it in ('mm', 'm') if _SMALLEST <= size * METRES[it] <= _LARGEST]
    asked = f': is it {" or ".join(likely)}?' if likely else ''
    return f'unit is {unit}, which makes the object {size:.3g} {unit} large{asked}'


def other_unit(given: float, measured: float, unit: str) -> str:
    """Return a remark on given coordinates that seem to be in another unit than measured ones.

    Both are the size of the same object; it is empty where these agree or no unit explains them.

    >>> other_unit(0.9, 901.2, 'mm')
    'given coordinates spread over 0.9, measured ones over 901 mm: are those in m?'
    """
    sizes = {it: given * METRES[it] for it in METRES if unit in METRES}
    if not sizes or not measured > 0 or _alike(sizes[unit], measured * METRES[unit]):
        return ''
    likely = [it for it, size in sizes.items() if _alike(size, measured * METRES[unit])]
    spread = f'given coordinates spread over {given:.3g}, measured ones over {measured:.3g} {unit}'
    return f'{spread}: are those in {likely[0]}?' if likely else ''


def _alike(one: float, other: float) -> bool:
    return 1 / _ALIKE < one / other < _ALIKE


def decimals(sigmas: Iterable[float]) -> int:
    """Return how many decimals show the smallest standard deviation with two digits.

    Examples
    --------
    >>> decimals([0.12, 3.4]), decimals([200.0])
    (2, 0)
    """
    every = list(sigmas)
    above = [it for it in every if it > _HELD * max(every)]
    return min(max(1 - math.floor(math.log10(min(above))), 0), 12) if above else 6
