"""The rigid transform between two sets of points whose covariances are both known.

It minimises r' W r of r = f - R x - t, with W as the inverse of the covariance of r, which is
C_f + R C_x R'. The start is the transform with equal weights (Umeyama, IEEE Trans. PAMI 1991, 13,
376); Gauss-Newton steps on SE(3) follow, t -> t + a and R -> exp(b) R [1]_.

References
----------
.. [1] Förstner & Wrobel, Photogrammetric Computer Vision, Springer 2016, 10.5.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from ahf_ros.clouds.registration.scan import block_diagonal
from ahf_ros.network.network import FloatArray
from ahf_ros.network.similarity import similarity_between
from ahf_ros.network.transform import Transform

_ROUNDS = 50
_CONVERGED = 1e-12  # decrease of the sum of weighted squares that a step promises, relative


@dataclass(frozen=True)
class Fit:
    """A transform of points, and how well it fits.

    `residuals` (n, 3) are r, along the axes of the fixed frame; `cost` is r' W r. `gain`, (6, 3n),
    is the change of t and b with r.
    """

    transform: Transform
    residuals: FloatArray
    cost: float
    gain: FloatArray

    @property
    def redundancy(self) -> int:
        """Number of coordinates beyond those that determine the transform."""
        return self.residuals.size - 6

    @property
    def plausible(self) -> bool:
        """Whether the residuals are as small as the covariances say, but for chance."""
        return self.cost <= chi_square_limit(self.redundancy)


def fit(
    points: FloatArray, covariances: FloatArray, aim: FloatArray, aim_covariance: FloatArray
) -> Fit:
    """Return the best transform of points (n, 3) with covariances (n, 3, 3) to others.

    The latter are `aim`, (n, 3), with the covariance (3n, 3n) of all of them. Raises LinAlgError
    where the points do not determine it.
    """
    start = similarity_between(points, aim, scale=False)
    transform = Transform(start.rotation, start.translation)
    for _ in range(_ROUNDS):
        weights = np.linalg.inv(aim_covariance + block_diagonal(transform.turned(covariances)))
        design = transform.changes(points).reshape(-1, 6)
        residuals = (aim - transform.moved(points)).ravel()
        covariance = np.linalg.inv(design.T @ weights @ design)
        gain = covariance @ design.T @ weights
        step = gain @ residuals
        transform = transform.stepped(step)
        cost = float(residuals @ weights @ residuals)
        if step @ np.linalg.solve(covariance, step) <= _CONVERGED * (1 + cost):
            break
    residuals = (aim - transform.moved(points)).ravel()
    return Fit(
        replace(transform, covariance=covariance),
        residuals.reshape(-1, 3),
        float(residuals @ weights @ residuals),
        gain,
    )


def chi_square_limit(redundancy: int) -> float:
    """Return what a chi-square variable exceeds once in ten thousand times.

    Wilson & Hilferty, Proc. Natl. Acad. Sci. 1931, 17, 684: 3 % too large for three degrees of
    freedom, less for more.
    """
    normal = 3.719  # of a standard normal variable
    part = 2 / (9 * max(redundancy, 1))
    return max(redundancy, 1) * (1 - part + normal * math.sqrt(part)) ** 3
