"""A pinhole camera in front of a wall, and its sensor.

The unit of length on the wall is what the camera sees as one pixel at the principal point when
the wall is not tilted. On the wall, x points right and y down, as that camera sees it.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np

_NEWTON_STEPS = 20  # at most; the strongest accepted distortion takes 6


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """A camera looking at the wall z = 0.

    Attributes
    ----------
    width, height : int
        Size of the image, px.
    intrinsics : ndarray of float64, shape (3, 3)
        K, for pixel (0, 0) at the centre of the first pixel.
    distortion : float
        k1 of Brown's radial distortion: the ray (x, y) appears at (x, y) (1 + k1 (x^2 + y^2)).
    pose : ndarray of float64, shape (3, 3)
        Homography from the wall (x, y, 1) to rays (x, y, 1). Its scale is such that the third
        row gives the depth.
    """

    width: int
    height: int
    intrinsics: np.ndarray
    distortion: float
    pose: np.ndarray

    def project(self, points: np.ndarray) -> np.ndarray:
        """Return the pixels, shape (n, 2), of points on the wall, shape (n, 2)."""
        rays = _transform(self.pose, points)
        seen = rays * (1 + self.distortion * (rays**2).sum(axis=1, keepdims=True))
        return seen * np.diag(self.intrinsics)[:2] + self.intrinsics[:2, 2]

    def wall(self, pixels: np.ndarray) -> np.ndarray:
        """Return the points on the wall, shape (n, 2), that pixels show, shape (n, 2)."""
        x, y = self.rays(pixels[:, 0], pixels[:, 1])
        return _transform(np.linalg.inv(self.pose), np.stack((x, y), axis=1))

    def rays(self, columns: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return x and y of the rays (x, y, 1) of pixels, whose shapes broadcast together.

        Without distortion each has the shape of its argument, otherwise the common shape.
        """
        x = (columns - self.intrinsics[0, 2]) / self.intrinsics[0, 0]
        y = (rows - self.intrinsics[1, 2]) / self.intrinsics[1, 1]
        if not self.distortion:
            return x, y
        seen = np.sqrt(x**2 + y**2)
        radius = seen.copy()
        for _ in range(_NEWTON_STEPS):
            excess = radius * (1 + self.distortion * radius**2) - seen
            step = excess / (1 + 3 * self.distortion * radius**2)
            radius -= step
            if np.abs(step).max() < 1e-14:
                break
        scale = np.divide(radius, seen, out=np.ones_like(seen), where=seen > 0)
        return x * scale, y * scale

    def jacobian(self, point: np.ndarray) -> np.ndarray:
        """Return d(pixel) / d(wall) at a point on the wall, shape (2, 2)."""
        ray = self.pose @ np.array([*point, 1.0])
        x, y = ray[:2] / ray[2]
        pinhole = (self.pose[:2, :2] - np.outer((x, y), self.pose[2, :2])) / ray[2]
        return self._pixels_by_ray(x, y) @ pinhole

    def _pixels_by_ray(self, x: float, y: float) -> np.ndarray:
        """Return d(pixel) / d(ray) at the ray (x, y, 1), shape (2, 2)."""
        radial = np.eye(2) * (1 + self.distortion * (x * x + y * y))
        radial += 2 * self.distortion * np.outer((x, y), (x, y))
        return np.diag(np.diag(self.intrinsics)[:2]) @ radial

    @property
    def _normal(self) -> np.ndarray:
        """Unit normal of the wall as the camera sees it."""
        axes = self.pose[:, :2] / np.linalg.norm(self.pose[:, :2], axis=0)
        return np.cross(axes[:, 0], axes[:, 1])

    def view_angle(self, points: np.ndarray) -> np.ndarray:
        """Return the angles between the rays to points on the wall and its normal, rad."""
        rays = np.column_stack((points, np.ones(len(points)))) @ self.pose.T
        return np.arccos(np.abs(rays @ self._normal) / np.linalg.norm(rays, axis=1))

    @property
    def tilt(self) -> float:
        """Angle between the optical axis and the wall's normal, degrees."""
        return math.degrees(math.acos(min(abs(self._normal[2]), 1.0)))

    def vignetting(self, pixels: np.ndarray) -> np.ndarray:
        """Return the vignetting of pixels, shape (n, 2): cos^4 of the field angle."""
        seen = (pixels - self.intrinsics[:2, 2]) / self.intrinsics[0, 0]
        return (1 + (seen**2).sum(axis=1)) ** -2

    def circle(self, centre: np.ndarray, radius: float) -> tuple[float, float, float]:
        """Return the semi-axes, px, and the angle of the image of a circle on the wall.

        The angle is that of `Target`. The ellipse is exact for a pinhole camera; lens distortion
        is taken as affine across the circle.
        """
        ray = self.pose @ np.array([*centre, 1.0])
        x, y = ray[:2] / ray[2]
        to_ray = np.array([[1, 0, -x], [0, 1, -y], [0, 0, 1]]) @ self.pose
        from_circle = np.array([[radius, 0, centre[0]], [0, radius, centre[1]], [0, 0, 1]])
        back = np.linalg.inv(to_ray @ from_circle)
        conic = back.T @ np.diag([1.0, 1.0, -1.0]) @ back
        middle = -np.linalg.solve(conic[:2, :2], conic[:2, 2])
        level = -(conic[2, 2] + conic[2, :2] @ middle)
        to_pixel = self._pixels_by_ray(x, y)
        spread = to_pixel @ np.linalg.inv(conic[:2, :2] / level) @ to_pixel.T
        squares, directions = np.linalg.eigh(spread)
        angle = math.atan2(directions[1, 1], directions[0, 1])
        if angle > math.pi / 2:
            angle -= math.pi
        elif angle <= -math.pi / 2:
            angle += math.pi
        return math.sqrt(squares[1]), math.sqrt(squares[0]), angle


@dataclass(frozen=True, slots=True)
class Sensor:
    """Conversion of light into grey values, which are light to the power of 1 / gamma."""

    full_well: float  # photoelectrons at saturation; 0 for an image without noise
    read_noise: float  # standard deviation, electrons
    gamma: float

    def grey_values(self, light: np.ndarray, generator: np.random.Generator) -> np.ndarray:
        """Return the 8-bit grey values of light, where 1 saturates; overwrites `light`.

        Photon noise is normally distributed with the variance of the Poisson distribution.
        A lens that is sharper than a pixel leaves light that is slightly negative.
        """
        if self.full_well:
            deviation = np.sqrt(
                np.maximum(light, 0) / np.float32(self.full_well)
                + np.float32((self.read_noise / self.full_well) ** 2)
            )
            deviation *= generator.standard_normal(light.shape, dtype=np.float32)
            light += deviation
        np.clip(light, 0, 1, out=light)
        return np.rint(cv2.pow(light, 1 / self.gamma) * np.float32(255)).astype(np.uint8)


def tilted_camera(
    width: int,
    height: int,
    focal_length: float,
    tilt: float,
    distortion: float,
    generator: np.random.Generator,
) -> Camera:
    """Return a camera that looks at the wall's origin, tilted about a random axis.

    The focal length in px is also the distance from the wall's origin, in units of the wall; the
    tilt is in rad. The generator draws the direction of the tilt and the principal point, which is
    at most 1 % of the width off the middle of the image.
    """
    direction = generator.uniform(0, 2 * math.pi)
    offset = generator.uniform(-0.01, 0.01, 2) * width
    axis = np.array([math.cos(direction), math.sin(direction), 0.0])
    rotation, _ = cv2.Rodrigues(axis * tilt)
    pose = np.column_stack((rotation[:, 0], rotation[:, 1], (0.0, 0.0, focal_length)))
    principal = (np.array([width, height]) - 1) / 2 + offset
    intrinsics = np.array(
        [[focal_length, 0, principal[0]], [0, focal_length, principal[1]], [0, 0, 1.0]]
    )
    return Camera(
        width=width, height=height, intrinsics=intrinsics, distortion=distortion, pose=pose
    )


def _transform(homography: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return points, shape (n, 2), transformed by a homography."""
    transformed = points @ homography[:, :2].T + homography[:, 2]
    return transformed[:, :2] / transformed[:, 2:]
