"""Observations by photograph, and under which angles targets are seen."""

from dataclasses import dataclass

import numpy as np

from ahf_ros.network.camera import undistort
from ahf_ros.network.network import FloatArray, IntArray, Network
from ahf_ros.network.solution import NetworkState
from ahf_ros.network.triangulation import largest_angle

NOWHERE = 1e3
"""Coordinate in focal lengths, far outside every image."""


@dataclass(frozen=True)
class View:
    """What one photograph shows: points by index in ascending order, px, and rows in the network.

    `sigma` (n,) is the standard deviation of a coordinate in px, the mean of both.
    """

    camera: int
    points: IntArray
    xy: FloatArray
    sigma: FloatArray
    rows: IntArray
    equidistant: bool = False

    def normalised(self, calibrations: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return places (n, 2) in the plane z = 1, and their standard deviations (n,).

        Where the lens has no place, that is one that agrees with nothing.
        """
        calibration = calibrations[self.camera]
        places = undistort(calibration, self.xy, equidistant=self.equidistant)
        places = np.nan_to_num(places, nan=NOWHERE)
        return places, self.sigma / calibration[0]


def views_of(network: Network) -> list[View]:
    """Return what each photograph shows; of targets seen twice in one, the first place."""
    observed = network.observations
    sigma = np.sqrt(np.trace(observed.covariance, axis1=1, axis2=2) / 2)
    made = []
    for photograph, camera in enumerate(network.camera_of):
        rows = np.flatnonzero(observed.photograph == photograph)
        points, first = np.unique(observed.point[rows], return_index=True)
        rows = rows[first]
        fisheye = network.cameras[camera].equidistant
        made.append(View(int(camera), points, observed.xy[rows], sigma[rows], rows, fisheye))
    return made


def largest_angles(network: Network, start: NetworkState) -> FloatArray:
    """Return the largest angle between two used rays of each target, rad; NaN below two rays."""
    angles = np.full(len(network.targets), np.nan)
    observed = network.observations
    for target in range(len(network.targets)):
        photographs = observed.photograph[(observed.point == target) & start.used]
        directions = start.positions[photographs] - start.points[target]
        directions = directions[np.isfinite(directions).all(axis=1)]
        if len(directions) > 1:
            directions /= np.linalg.norm(directions, axis=1, keepdims=True)
            angles[target] = largest_angle(directions)
    return angles
