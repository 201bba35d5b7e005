"""Results of small images, as `ahf identify --json` prints them."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros.base.target import FilterState, Identification, SearchTrace, Target, UndecodedTarget
from ahf_ros.files.image_files import write_image
from ahf_ros.files.target_json import to_json

SHAPE = 120, 160
COVARIANCE = (1e-4, 0.0, 0.0, 1e-4)


def target(number: int, confidence: float = 0.9999) -> Target:
    x, y = 20.0 + number % 7 * 18, 20.0 + number // 7 % 5 * 18
    return Target(number, 71, x, y, 4.0, 3.5, 0.2, confidence, COVARIANCE, 'metashape12')


def undecoded(reason: str, likely: int = -1, confidence: float = 0.0) -> UndecodedTarget:
    return UndecodedTarget(
        -1, 0, 140.0, 100.0, 4.0, 4.0, confidence=confidence, reason=reason, likely_id=likely
    )


def searched() -> dict[str, Any]:
    """Return what an identification through a filter has."""
    trace = SearchTrace(
        'evaluations', (3, 1, 2), (1.5, 3.1, 2.0), (0.4, 0.8, 0.1), (30.0,) * 3, (1.5,) * 3, (2, 3)
    )
    state = FilterState(True, 3.1, 0.8, 30.0, 1.5, 4, 2, 0.5)
    return {'filter': state, 'search': trace}


def record(image: Path | str, *targets: Target, **values: Any) -> dict[str, Any]:
    """Return the object of an image."""
    found = Identification(tuple(targets), **values)
    return to_json(found, str(image), SHAPE, 'metashape12', 'ring')


def save_image(path: Path) -> Path:
    """Write an image with a ramp, a dot and some noise."""
    rows, columns = np.indices(SHAPE)
    image = columns + 20 + np.random.default_rng(1).integers(0, 9, SHAPE)
    image[(rows - 38) ** 2 + (columns - 38) ** 2 < 16] = 5
    write_image(path, image.astype(np.uint8))
    return path


def save_lines(path: Path, *records: Any) -> Path:
    """Write records, and lines that are none, to a file."""
    lines = [it if isinstance(it, str) else json.dumps(it) for it in records]
    path.write_text('\n'.join(lines) + '\n')
    return path
