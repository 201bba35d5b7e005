"""Sheets that are bent, photographed by the second maker of pictures."""

from typing import Any

import numpy as np

from ahf_ros.scenes.bent.settings import BentSettings

DOT_SHARES = {'gsi': 0.5, 'dots': 0.7}
"""Radius of the dot over that of a ring target of about the same size."""

_PATTERNS = ('stripe', 'fine_stripe', 'lattice', 'dense_lattice')
LIGHTS = ('normal 0.3', *(f'{name} {ambient}' for ambient in (0.3, 0.12) for name in _PATTERNS))
"""Patterns and their ambient light."""

WIDTH, HEIGHT = 1920, 1280
"""Of the pictures, px."""

_RANGES: dict[str, tuple[float, float]] = {
    'motion': (0.5, 2.0),
    'confusion': (0.2, 1.0),
    'gloss': (0.02, 0.06),
    'roughness': (0.2, 0.6),
    'grain': (0.0, 0.1),
    'ragged': (0.0, 0.04),
    'texture': (0.01, 0.04),
    'distortion': (-0.2, 0.1),
    'tangential_1': (-0.005, 0.005),
    'tangential_2': (-0.005, 0.005),
    'vignetting': (0.1, 0.6),
    'black': (0.03, 0.1),
    'exposure': (150.0, 230.0),
    'full_well': (4000.0, 15000.0),
}
"""What is drawn for each seed."""


def settings(
    family: str, polarity: str, light: str, radius: float, seed: int, targets: int
) -> BentSettings:
    """Return the picture of a polarity, a light of `LIGHTS`, a radius in px and a seed."""
    generator = np.random.default_rng(seed)
    drawn: dict[str, Any] = {name: float(generator.uniform(*of)) for name, of in _RANGES.items()}
    pattern, ambient = light.split()
    share = DOT_SHARES.get(family, 1.0)
    return BentSettings(
        width=WIDTH,
        height=HEIGHT,
        targets=targets,
        family=family,
        polarity=polarity,
        dot_radius=radius * share,
        printed_radius=BentSettings().printed_radius * share,
        light=pattern,
        ambient=float(ambient),
        seed=seed,
        **drawn,
    )
