"""The lens of a camera that looks along z, with x to the right and y down."""

from dataclasses import dataclass

import numpy as np

_NEWTON_STEPS = 20  # at most; usual distortion takes 3
_CONVERGED = 1e-12  # in a ray (x, y, 1)


@dataclass(frozen=True, slots=True)
class Lens:
    """A pinhole with radial and tangential distortion, as of Brown and of OpenCV.

    Attributes
    ----------
    focal : float
        Focal length, px.
    principal : tuple of float
        Principal point (x, y), px; (0, 0) is the centre of the first pixel.
    k1, p1, p2 : float
        Radial and tangential distortion, dimensionless.
    """

    focal: float
    principal: tuple[float, float]
    k1: float
    p1: float
    p2: float

    @property
    def intrinsics(self) -> np.ndarray:
        """K of the camera, shape (3, 3)."""
        x, y = self.principal
        return np.array([[self.focal, 0, x], [0, self.focal, y], [0, 0, 1.0]])

    def project(self, points: np.ndarray) -> np.ndarray:
        """Return the pixels, shape (..., 2), of points (x, y, z) before the camera."""
        x, y = self._distorted(*np.moveaxis(points[..., :2] / points[..., 2:], -1, 0))
        return np.stack((x, y), axis=-1) * self.focal + np.array(self.principal)

    def rays(self, columns: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return x and y of the rays (x, y, 1) of pixels, by Newton's method.

        Columns and rows are arrays of one shape.
        """
        seen_x = (columns - self.principal[0]) / self.focal
        seen_y = (rows - self.principal[1]) / self.focal
        x, y = seen_x, seen_y
        if not (self.k1 or self.p1 or self.p2):
            return x, y
        for _ in range(_NEWTON_STEPS):
            excess_x, excess_y = self._distorted(x, y)
            excess_x -= seen_x
            excess_y -= seen_y
            radial = 1 + self.k1 * (x * x + y * y)
            xx = radial + 2 * self.k1 * x * x + 2 * self.p1 * y + 6 * self.p2 * x
            yy = radial + 2 * self.k1 * y * y + 6 * self.p1 * y + 2 * self.p2 * x
            xy = 2 * (self.k1 * x * y + self.p1 * x + self.p2 * y)
            scale = 1 / (xx * yy - xy * xy)
            step_x = (yy * excess_x - xy * excess_y) * scale
            step_y = (xx * excess_y - xy * excess_x) * scale
            x, y = x - step_x, y - step_y
            if max(np.abs(step_x).max(), np.abs(step_y).max()) < _CONVERGED:
                break
        return x, y

    def _distorted(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return where rays (x, y, 1) appear."""
        squared = x * x + y * y
        radial, product = 1 + self.k1 * squared, 2 * x * y
        return (
            x * radial + (self.p1 * product + self.p2 * (squared + 2 * x * x)),
            y * radial + (self.p2 * product + self.p1 * (squared + 2 * y * y)),
        )
