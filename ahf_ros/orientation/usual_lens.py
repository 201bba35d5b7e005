"""What is usual of lenses, as observations, while nothing better is known of a camera."""

from __future__ import annotations

import numpy as np

from ahf_ros.orientation.camera import PARAMETERS, known_calibration
from ahf_ros.orientation.datum import movements
from ahf_ros.orientation.least_squares import Conditions, Knowledge
from ahf_ros.orientation.network import FloatArray, IntArray, Network
from ahf_ros.orientation.normals import Layout
from ahf_ros.orientation.solution import Start

USUAL = {'k1': 0.2, 'k2': 0.2, 'k3': 0.2, 'p1': 0.003, 'p2': 0.003}
"""Standard deviations of what lenses have, about zero."""

FOCAL_LENGTH = 0.05
"""Relative standard deviation of a focal length that is given: makers round it."""

OFF_CENTRE = 0.02
"""Standard deviation of a principal point about the centre, in widths of the image."""


def usual_lens(network: Network, layout: Layout) -> Knowledge:
    """Return conditions that hold the frame, and keep free parameters of lenses about as usual.

    So few photographs never make a lens that does not exist.
    """
    columns, middles, sigmas = _expected(network, layout)

    def conditions(state: Start) -> Conditions:
        rows = np.zeros((7 + len(columns), layout.unknowns))
        rows[:7, : 3 * len(layout.points)] = movements(state.points[layout.points]).T
        rows[7 + np.arange(len(columns)), columns] = 1
        gaps = middles - state.calibrations[layout.free][columns - 3 * len(layout.points)]
        return Conditions(
            rows, np.concatenate([np.zeros(7), gaps]), np.concatenate([np.zeros(7), sigmas**2])
        )

    return conditions


def _expected(network: Network, layout: Layout) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return columns, expected values and standard deviations of free parameters of lenses.

    What is given of a camera is expected of it.
    """
    expected = []
    for camera, column in zip(network.cameras, layout.columns, strict=True):
        middle = known_calibration(camera)
        off = OFF_CENTRE * max(camera.width, camera.height)
        sigmas = USUAL | {'f': FOCAL_LENGTH * middle[0], 'cx': off, 'cy': off}
        expected += [
            (column[place], middle[place], sigmas[name])
            for place, name in enumerate(PARAMETERS)
            if column[place] >= 0 and np.isfinite(sigmas.get(name, np.nan))
        ]
    columns, middles, deviations = np.array(expected).reshape(-1, 3).T
    return columns.astype(int), middles, deviations
