"""Units of length that files with coordinates may have."""

UNITS = {'m': 1.0, 'cm': 0.01, 'mm': 0.001, 'um': 1e-6, 'in': 0.0254, 'ft': 0.3048}
"""Their names, and how many metres they are."""
