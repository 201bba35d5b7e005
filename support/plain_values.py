"""What tests of several kernels compare with, value by value."""

import math

import numpy as np


def below(away: float) -> float:
    """Return the share of a normal distribution below so many deviations."""
    return (1 + math.erf(away / math.sqrt(2))) / 2


def at(image: np.ndarray, x: float, y: float) -> float:
    """Return the gray value between pixels, of the nearest one beyond the border."""
    height, width = image.shape
    x, y = min(max(x, 0), width - 1), min(max(y, 0), height - 1)
    left, top = min(int(x), max(width - 2, 0)), min(int(y), max(height - 2, 0))
    part = image[top : top + 2, left : left + 2].astype(float)
    across, down = x - left, y - top
    rows = [(1 - across) * row[0] + across * row[-1] for row in part]
    return (1 - down) * rows[0] + down * rows[-1]


def value(gray: np.ndarray, frame: np.ndarray, x: float, y: float) -> float:
    """Return the gray value between pixels at a place of a frame."""
    across, down, scale = frame @ [x, y, 1]
    return at(gray, across / scale, down / scale)
