"""Gray values of an image at points and on circles."""

from __future__ import annotations

import numpy as np

from ahf_ros.vision.resampling import remapped

_REMAP_ROWS = 16384  # cv2.remap takes maps of at most 32767 rows


def sample(image: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Return the bilinearly interpolated values of an image at pixels, shape (..., 2).

    The image is of uint8, uint16, int16 or float32, as are the values, shape (...). Beyond the
    border the nearest pixel counts.
    """
    columns = pixels.shape[-2]
    maps = np.ascontiguousarray(pixels, np.float32).reshape(-1, columns, 2)
    values = np.empty(maps.shape[:2], image.dtype)
    for start in range(0, len(maps), _REMAP_ROWS):
        rows = slice(start, start + _REMAP_ROWS)
        values[rows] = remapped(image, maps[rows], None)
    return values.reshape(pixels.shape[:-1])


def sample_circles(
    image: np.ndarray, frames: np.ndarray, angles: np.ndarray, radii: np.ndarray
) -> np.ndarray:
    """Return the values of an image on concentric circles of targets.

    It does what `sample` does for the projected `frame.circle_points`, in single precision and in
    parts that stay in the cache. Radii of shape (n,) are the same for all k frames, those of shape
    (k, n) are others for each; with m angles, the values have the shape (k, m, n).
    """
    values = np.empty((len(frames), len(angles), radii.shape[-1]), image.dtype)
    step = max(1, _REMAP_ROWS // len(angles))
    for start in range(0, len(frames), step):
        part = slice(start, start + step)
        across, down = circle_places(
            frames[part], angles, radii if radii.ndim < 2 else radii[part]
        )
        shape = (across.shape[0] * across.shape[1], -1)
        sampled = remapped(image, across.reshape(shape), down.reshape(shape))
        values[part] = sampled.reshape(across.shape)
    return values


def circle_places(
    frames: np.ndarray, angles: np.ndarray, radii: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y of points on concentric circles of targets, float32, (k, m, n) each.

    The arguments are those of `sample_circles`.
    """
    directions = np.array([np.cos(angles), np.sin(angles)])
    along = (frames[:, :, :2] @ directions).astype(np.float32)[..., None]
    centre = frames[:, :, 2].astype(np.float32)[..., None, None]
    radii = radii.astype(np.float32)[..., None, :]
    affine = bool((frames[:, 2] == (0, 0, 1)).all())
    rows = [along[:, row] * radii for row in range(2 if affine else 3)]
    for row, points in enumerate(rows):
        points += centre[:, row]
    x, y, *scale = rows
    for points in (x, y) if scale else ():
        points /= scale[0]
    return x, y


def within(pixels: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return whether pixels, shape (..., 2), lie in an image of shape (height, width)."""
    x, y = pixels[..., 0], pixels[..., 1]
    return (x >= 0) & (y >= 0) & (x <= shape[1] - 1) & (y <= shape[0] - 1)
