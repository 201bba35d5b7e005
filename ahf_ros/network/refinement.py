"""The light adjustment, robust and without covariances, for the search of approximate values.

Residuals of these say how far they agree with what was observed.
What is usual of lenses is an observation, while nothing better is known of a camera.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ahf_ros.network import image_points
from ahf_ros.network.calibration import usual
from ahf_ros.network.camera import PARAMETERS, parameters_of
from ahf_ros.network.datum import movements
from ahf_ros.network.image_points import Layout
from ahf_ros.network.least_squares import Conditions, Knowledge, minimise
from ahf_ros.network.network import FloatArray, Network
from ahf_ros.network.solution import NetworkState

_AGREES = 5.0  # standard deviations, or robust ones, of an observation that agrees
NEEDED = (
    'no used observation has a pose and a point in front of it, expected photographs with three '
    'points and points with two rays'
)


def refine(
    network: Network, start: NetworkState, free: tuple[str, ...] = (), *, rounds: int = 30
) -> NetworkState:
    """Return approximate values bettered by a robust adjustment of the used observations.

    Bars and control points are not used, and the frame stays about where it was. The parameters
    in `free` are estimated for every camera that is not fixed, those of lenses about as usual.
    Photographs with fewer than three and points with fewer than two used observations keep their
    values. Afterwards those observations are used, of all with a pose and a point, that agree with
    the values to five standard deviations, or five robust ones where the residuals are larger.

    Raises `ValueError` if nothing is left that could be adjusted.
    """
    layout = image_points.lay_out(network, start, start.used, free_parameters(network, free))
    if not len(layout.xy):
        raise ValueError('start: nothing to refine; ' + NEEDED)
    refined, _ = minimise(layout, start, usual_lens(network, layout), 'cauchy', rounds)
    return replace(refined, used=agreeing(network, refined, layout))


def free_parameters(network: Network, names: tuple[str, ...]) -> NDArray[np.bool_]:
    """Return the mask (cameras, parameters) of named parameters of cameras that are not fixed."""
    unknown = set(names) - set(PARAMETERS)
    if unknown:
        raise ValueError(f'free: {sorted(unknown)} is no parameter, expected {list(PARAMETERS)}')
    mask = np.array([name in names for name in PARAMETERS])
    exists = [[name != '' for name in parameters_of(view)] for view in network.cameras]
    fixed = np.array([view.fixed for view in network.cameras])
    return mask & np.array(exists) & ~fixed[:, None]


def agreeing(network: Network, state: NetworkState, adjusted: Layout) -> NDArray[np.bool_]:
    """Return which observations (m,), adjusted or not, agree with the values."""
    everything = np.ones(len(network.observations.xy), dtype=bool)
    every = image_points.lay_out(
        network, state, everything, adjusted.free, backward=adjusted.backward
    )
    lengths = image_points.whitened_lengths(every, state)
    among = np.isin(every.observations, adjusted.observations)
    spread = max(1.0, image_points.robust_spread(lengths[among]))
    used = np.zeros(len(network.observations.xy), dtype=bool)
    used[every.observations[lengths < _AGREES * spread]] = True
    return used


def usual_lens(network: Network, layout: Layout) -> Knowledge:
    """Return conditions that hold the frame, and keep free parameters of lenses about as usual.

    So few photographs never make a lens that does not exist.
    """
    columns, middles, sigmas = usual(network, layout)

    def conditions(state: NetworkState) -> Conditions:
        rows = np.zeros((7 + len(columns), layout.unknowns))
        rows[:7, : 3 * len(layout.points)] = movements(state.points[layout.points]).T
        rows[7 + np.arange(len(columns)), columns] = 1
        gaps = middles - state.calibrations[layout.free][columns - 3 * len(layout.points)]
        return Conditions(
            rows, np.concatenate([np.zeros(7), gaps]), np.concatenate([np.zeros(7), sigmas**2])
        )

    return conditions


def lengths_of(network: Network, start: NetworkState) -> FloatArray:
    """Return residuals (m,) in standard deviations, NaN where pose or point are not known.

    Points behind a camera that has a pose have infinite ones.
    """
    observed = network.observations
    known = np.isfinite(start.positions[observed.photograph, 0])
    known &= np.isfinite(start.points[observed.point, 0])
    lengths = np.full(len(observed.xy), np.nan)
    lengths[known] = np.inf
    every = np.ones(len(known), dtype=bool)
    layout = image_points.lay_out(network, start, every, free_parameters(network, ()))
    if len(layout.xy):
        lengths[layout.observations] = image_points.whitened_lengths(layout, start)
    return lengths


def spread_of(lengths: FloatArray) -> float:
    """Return the robust spread of residuals in standard deviations, at least one."""
    known = lengths[~np.isnan(lengths)]
    return max(1.0, image_points.robust_spread(known)) if len(known) else np.inf
