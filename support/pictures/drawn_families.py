"""Families of rings drawn at random, and sheets of their targets."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros.prints.cyclic import smallest_rotation
from ahf_ros.prints.ring import conforming, ring_family
from ahf_ros.scenes.scene import Rendering, SceneSettings, render

RULES: tuple[dict[str, Any], ...] = (
    {},
    {'parity': 'even'},
    {'parity': 'even', 'opposite_pairs': 1},
    {'changes': 6},
)
"""Rules of words, one of which is drawn."""

LIGHTS = ('normal', 'stripe', 'lattice')
"""In which they are identified; they are learnt in the first one."""

TARGETS = 20
"""In an image that is identified."""


def random_family(file: Path, generator: np.random.Generator) -> dict[str, Any]:
    """Write the data file of a family, and return its rule."""
    rule = dict(RULES[generator.integers(len(RULES))])
    bits = int(generator.integers(6, 25))
    bits += bits % 2 if 'opposite_pairs' in rule else 0
    inner = generator.uniform(1.4, 2.6)
    words = generator.integers(1, (1 << bits) - 1, 20_000)
    words = np.unique(smallest_rotation(words[conforming(words, bits, **rule)], bits))
    described = {
        'family': 'mine',
        'bits': bits,
        'band': [round(inner, 3), round(inner + generator.uniform(0.45, 1.3), 3)],
        'words': generator.permutation(words)[:60].tolist(),
    }
    file.write_text(json.dumps(described))
    return rule


def sheet(file: Path, targets: int, light: str, seed: int, values: dict[str, Any]) -> Rendering:
    """Return the rendering of a sheet that is as large as its targets need."""
    for growth in range(12):
        try:
            return render(
                SceneSettings(
                    width=round(1600 * 1.15**growth),
                    height=round(1200 * 1.15**growth),
                    targets=min(targets, len(ring_family(str(file)).words)),
                    light=light,
                    family='mine',
                    family_file=str(file),
                    seed=seed,
                    **values,
                )
            )
        except ValueError as error:
            if not str(error).startswith('targets is'):
                raise
    raise ValueError(f'targets is {targets!r}, accepted are fewer for dots of this size')
