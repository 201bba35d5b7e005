"""The pose of a camera among known targets, from one image."""

from dataclasses import dataclass

from ahf_ros.network.network import FloatArray, Rejection
from ahf_ros.network.transform import Transform


@dataclass(frozen=True)
class Pose:
    """The pose of a camera in the frame of known targets, from one image.

    Attributes
    ----------
    camera : Transform
        From the frame of the camera (x right, y down, z forward) to that of the targets: its
        translation is the centre of projection. Covariances hold the a-priori weights, scaled by
        the square of `sigma0` where that is too large by chance.
    second : Transform or None
        Another pose that is not much less likely, as planes have one where perspective is weak.
    targets : tuple of str
        Names of the targets that agree.
    residuals : ndarray of float64, shape (n, 2)
        Measured minus computed of these, in focal lengths.
    rejected : tuple of Rejection
        What was left out, and why; the photograph has no name.
    sigma0 : float
        Square root of the variance of unit weight.
    redundancy : int
        Its degrees of freedom.
    """

    camera: Transform
    second: Transform | None
    targets: tuple[str, ...]
    residuals: FloatArray
    rejected: tuple[Rejection, ...]
    sigma0: float
    redundancy: int
