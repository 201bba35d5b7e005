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
    parts that stay in the cache. With k frames, m angles and n radii, the values have the shape
    (k, m, n).
    """
    values = np.empty((len(frames), len(angles), len(radii)), image.dtype)
    directions, radii = np.array([np.cos(angles), np.sin(angles)]), radii.astype(np.float32)
    affine = bool((frames[:, 2] == (0, 0, 1)).all())
    step = max(1, _REMAP_ROWS // len(angles))
    for start in range(0, len(frames), step):
        part = frames[start : start + step]
        along = (part[:, :, :2] @ directions).astype(np.float32)[..., None]
        centre = part[:, :, 2].astype(np.float32)[..., None, None]
        x, y, *scale = (along[:, row] * radii + centre[:, row] for row in range(3 - affine))
        for points in (x, y) if scale else ():
            points /= scale[0]
        shape = (len(part) * len(angles), len(radii))
        sampled = remapped(image, x.reshape(shape), y.reshape(shape))
        values[start : start + step] = sampled.reshape(x.shape)
    return values


def within(pixels: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return whether pixels, shape (..., 2), lie in an image of shape (height, width)."""
    x, y = pixels[..., 0], pixels[..., 1]
    return (x >= 0) & (y >= 0) & (x <= shape[1] - 1) & (y <= shape[0] - 1)
