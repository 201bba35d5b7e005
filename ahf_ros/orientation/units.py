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
