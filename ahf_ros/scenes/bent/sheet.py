"""A sheet that is bent around a cylinder: its points, and where rays meet it.

Where the sheet is not bent its surface is z = 0 of its frame. x goes along the bend, y along the
axis of the cylinder, z away from the camera. With the curvature c, the surface is
c (x^2 + z^2) = 2 z, which is a plane for c = 0.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, eq=False)
class Sheet:
    """A bent sheet; lengths are in mm, in the coordinates of the camera.

    Attributes
    ----------
    middle : ndarray of float64, shape (3,)
        The middle of the sheet, where it touches the plane z = 0 of its frame.
    axes : ndarray of float64, shape (3, 3)
        x, y and z of its frame, in its rows.
    curvature : float
        1 / mm; positive where the sides bend away from the camera.
    half_size : tuple of float
        Half of its width and of its height.
    print_turn : float
        Angle by which its width is turned from x towards y, rad.
    """

    middle: np.ndarray
    axes: np.ndarray
    curvature: float
    half_size: tuple[float, float]
    print_turn: float

    def points(self, width: np.ndarray, height: np.ndarray) -> np.ndarray:
        """Return the points, shape (..., 3), at places on the sheet from its middle."""
        along, across = self._turned(width, height, self.print_turn)
        angle = self.curvature * along
        x = along * np.sinc(angle / np.pi)
        z = along * np.sinc(angle / (2 * np.pi)) * np.sin(angle / 2)
        return np.stack((x, across, z), axis=-1) @ self.axes + self.middle

    def places(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return where rays (x, y, 1) meet the side of the sheet that faces the camera.

        Returns
        -------
        width, height : ndarray of float64
            Places on the sheet from its middle; NaN where a ray misses the cylinder.
        distance : ndarray of float64
            z of the points that are met, in the coordinates of the camera.
        """
        start = -(self.axes @ self.middle)
        dx, dy, dz = (axis[0] * x + (axis[1] * y + axis[2]) for axis in self.axes)
        bent = self.curvature
        squared = bent * (dx * dx + dz * dz)
        half = bent * (start[0] * dx + start[2] * dz) - dz
        constant = bent * (start[0] ** 2 + start[2] ** 2) - 2 * start[2]
        with np.errstate(invalid='ignore'):
            distance = constant / (np.sqrt(half * half - squared * constant) - half)
        along = start[0] + distance * dx
        across = start[1] + distance * dy
        if bent:
            along = np.arctan2(bent * along, 1 - bent * (start[2] + distance * dz)) / bent
        return *self._turned(along, across, -self.print_turn), distance

    def normals(self, width: np.ndarray, height: np.ndarray) -> np.ndarray:
        """Return unit normals towards the camera, float32, shape (3, ...), at places."""
        along, _ = self._turned(width, height, self.print_turn)
        angle = (self.curvature * along).astype(np.float32)
        sine, cosine = np.sin(angle), np.cos(angle)
        x, _, z = self.axes.astype(np.float32)
        return np.stack([sine * a - cosine * b for a, b in zip(x, z, strict=True)])

    def holds(self, width: np.ndarray, height: np.ndarray) -> np.ndarray:
        """Return whether places are on the sheet; NaN is not."""
        inside: np.ndarray = np.abs(width) <= self.half_size[0]
        inside &= np.abs(height) <= self.half_size[1]
        return inside

    @staticmethod
    def _turned(x: np.ndarray, y: np.ndarray, turn: float) -> tuple[np.ndarray, np.ndarray]:
        cosine, sine = np.cos(turn), np.sin(turn)
        return x * cosine - y * sine, x * sine + y * cosine
