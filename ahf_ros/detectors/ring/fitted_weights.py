"""The weights that were fitted to data, all in `fitted_weights.json` beside this file.

Each set says which command made it, from which seeds and at which commit. `benchmarks.confidence`
fits them anew and writes the file.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ahf_ros.features.logistic import read_weights

PATH = Path(__file__).with_suffix('.json')
"""The data file."""


def fitted_weights(purpose: str, *names: str) -> tuple[np.ndarray, ...]:
    """Return arrays of one set of the file, each ndarray of float64, shape (n,).

    Parameters
    ----------
    purpose : str
        Name of the set.
    *names : str
        Names of the arrays.
    """
    return read_weights(PATH, purpose, *names)
