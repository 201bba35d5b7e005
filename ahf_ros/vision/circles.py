"""Where the circles of targets have edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.vision.profiles import OutlinePoints


@dataclass(frozen=True, slots=True)
class Circles:
    """Points on the circles of k targets where edges are expected.

    The points of a circle are equally far apart and follow each other; circles come in the order
    of their radii. The first point is on the outline of the target or its dot, and has its
    polarity. A group of circles shares a scale relative to the dot that is known about as well as
    a print is; group 0 is the dot, which has the scale of the frame.
    """

    angles: np.ndarray  # float64, (m,), in the frame, rad
    radii: np.ndarray  # float64, (m,), dot radii
    group: np.ndarray  # int, (m,)
    polarity: np.ndarray  # int, (k, m), 1 where the outside is brighter, -1 darker, 0 for no edge

    @property
    def spacing(self) -> np.ndarray:
        """Distances from each point to the next on its circle, dot radii."""
        return 2 * np.pi * self.radii / (self.radii[:, None] == self.radii).sum(axis=1)


def dot_circles(polarity: np.ndarray, rays: int) -> Circles:
    """Return the edges of dots, `rays` points each; polarity (k,) is 1 for dark dots, else -1."""
    angles = 2 * np.pi * np.arange(rays) / rays
    of_points = np.repeat(np.asarray(polarity)[:, None], rays, axis=1)
    return Circles(angles, np.ones(rays), np.zeros(rays, int), of_points)


def edge_points(frames: np.ndarray, circles: Circles) -> OutlinePoints:
    """Return where the circles of targets with frames (k, 3, 3) have edges in the image."""
    radii = circles.radii
    radial = np.stack([np.cos(circles.angles), np.sin(circles.angles)])
    tangential = np.stack([-radial[1], radial[0]])
    images = frames[:, :, :2] @ (radii * radial) + frames[:, :, 2:]
    depth = images[:, 2:]
    points = images[:, :2] / depth
    outwards, along = (
        (moved[:, :2] - points * moved[:, 2:]) / depth
        for moved in (frames[:, :, :2] @ radial, frames[:, :, :2] @ tangential)
    )
    stretch = np.hypot(along[:, 0], along[:, 1])
    area = outwards[:, 0] * along[:, 1] - outwards[:, 1] * along[:, 0]
    return OutlinePoints(
        points=points.transpose(0, 2, 1),
        normals=np.stack([along[:, 1], -along[:, 0]], axis=2) / stretch[..., None],
        polarity=circles.polarity,
        scale=area / stretch,
        spacing=circles.spacing * stretch,
        curvature=area / (radii * stretch**3),
    )
