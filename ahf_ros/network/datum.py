"""The datum: which frame the coordinates, and so their covariances, refer to.

Image points alone leave seven movements of the whole network open: three translations, three
rotations and the scale. With the columns of G, (3 n, 7), as the coordinates' changes under them,
inner constraints G'W dx = 0 open no other and give the smallest trace of the covariance of the
points that W weighs [1]_. An S-transformation [2]_ brings a covariance from one datum to another.

References
----------
.. [1] Förstner & Wrobel, Photogrammetric Computer Vision, Springer 2016, 4.5.3.
.. [2] Baarda, S-transformations and criterion matrices, Netherlands Geodetic Commission 1973.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ahf_ros.network.camera import skew
from ahf_ros.network.network import FloatArray


@dataclass(frozen=True)
class Datum:
    """How the frame of the coordinates is chosen.

    - `inner`: constraints on all or the named targets; control points give the approximate frame
      and nothing else, scale bars give the scale.
    - `control`: control points and bars are observations; what they leave open is held by inner
      constraints.
    - `fixed`: the first of three named targets is the origin, the second lies on the x axis, the
      third in the plane z = 0; without names these are three that span a large triangle. Without
      bars, the distance of the first two stays as it was.
    - None: `control` if there are control points, else `inner`.
    """

    kind: Literal['inner', 'control', 'fixed'] | None = None
    targets: tuple[str, ...] = ()


def movements(points: FloatArray, scale: bool = True) -> FloatArray:
    """Return G, (3 n, 7) or without scale (3 n, 6): changes of points (n, 3) under each movement.

    Rotations and scale are about the centroid, in units of the points' root mean square distance
    from it, so that the columns are of one size.
    """
    centred = points - points.mean(axis=0)
    size = np.sqrt((centred**2).sum(axis=1).mean())
    centred = centred / (size if size > 0 else 1)
    columns = np.zeros((len(points), 3, 7))
    columns[:, :, :3] = np.eye(3)
    columns[:, :, 3:6] = skew(-centred)
    columns[:, :, 6] = centred
    return columns.reshape(-1, 7)[:, : 7 if scale else 6]


def s_transform(
    points: FloatArray,
    covariance: FloatArray,
    weights: FloatArray,
    *,
    reference: FloatArray | None = None,
    scale: bool = True,
) -> tuple[FloatArray, FloatArray]:
    """Return points (n, 3) and their covariance (3 n, 3 n) in the datum of weighted points.

    S = I - G (G'WG)^-1 G'W with weights (n,), zero for points that are no part of the datum, and
    without the scale where bars or control points determine it. Points are moved to the reference
    (n, 3), by a small movement; without one they stay and only their covariance changes.
    """
    about = points if reference is None else reference
    free = movements(about, scale)
    weighted = free * np.repeat(np.asarray(weights, dtype=float), 3)[:, None]
    normal = weighted.T @ free
    if np.linalg.matrix_rank(normal, hermitian=True) < free.shape[1]:
        count = int(np.count_nonzero(weights))
        raise ValueError(
            f'weights: the {count} weighted points define no datum, expected three or more that '
            'are not on a line'
        )
    projection = np.eye(len(free)) - free @ np.linalg.solve(normal, weighted.T)
    moved = about + (projection @ (points - about).reshape(-1)).reshape(-1, 3)
    return moved, projection @ covariance @ projection.T
