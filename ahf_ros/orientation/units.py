"""Units of length that coordinates may have."""

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
