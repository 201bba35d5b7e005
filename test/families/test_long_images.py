"""Strips of 40,000 px, as of line cameras, are identified from end to end."""

import numpy as np
import pytest

from ahf_ros import create_identifier
from support.scenes import rendering
from support.square_markers import needs_square_markers

LENGTH, WIDTH, RENDERED = 40_000, 100, 400

FAMILIES = [
    ('metashape12', 'ring', 9.0),
    ('metashape12', 'traditional', 9.0),
    ('gsi', 'gsi', 2.5),
    ('dots', 'dots', 9.0),
    ('dots', 'dots_published', 9.0),
    pytest.param('aruco_4x4_50', 'aruco', 9.0, marks=needs_square_markers),
    ('cctag3', 'cctag', 20.0),
]


@pytest.mark.parametrize(('family', 'detector', 'radius'), FAMILIES)
@pytest.mark.parametrize('upright', [False, True])
def test_targets_at_both_ends_are_found(
    family: str, detector: str, radius: float, upright: bool
) -> None:
    shown = rendering(
        width=RENDERED, height=WIDTH, targets=2, family=family, dot_radius=radius, tilt=0.0, seed=2
    )
    image = np.full((WIDTH, LENGTH), int(np.median(shown.image)), np.uint8)
    first, last = sorted(shown.targets, key=lambda it: it.x)
    middle = round((first.x + last.x) / 2)
    image[:, :middle] = shown.image[:, :middle]
    image[:, -(RENDERED - middle) :] = shown.image[:, middle:]
    moved = LENGTH - RENDERED
    places = {first.id: (first.x, first.y), last.id: (last.x + moved, last.y)}
    if upright:
        # A mirror would change IDs.
        image = np.ascontiguousarray(np.rot90(image))
        places = {number: (y, LENGTH - 1 - x) for number, (x, y) in places.items()}
    identifier = create_identifier(family=family, detector=detector, threads=1)
    found = {it.id: (it.x, it.y) for it in identifier.identify(image).targets}
    assert found.keys() == places.keys()
    for number, place in places.items():
        assert found[number] == pytest.approx(place, abs=1.0)
