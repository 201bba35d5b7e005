"""Images from files, and to files."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

SUFFIXES = ('.bmp', '.jpeg', '.jpg', '.png', '.tif', '.tiff')
"""Endings of the image files that are tested; others are tried."""


def read_image(path: str | Path) -> np.ndarray:
    """Return the image in a file as gray values.

    Colour turns to gray, transparency is left out. An orientation that a camera noted in the file
    is not applied: the pixels are those of the sensor.

    Parameters
    ----------
    path : str or Path
        An 8- or 16-bit PNG, JPEG, TIFF or BMP file, or another that OpenCV reads.

    Returns
    -------
    ndarray of uint8, uint16, float32 or float64, shape (height, width)

    Raises
    ------
    ValueError
        If the file is missing, a folder, empty, not readable or not an image; the message names
        it.
    """
    encoded = np.frombuffer(_read(Path(path)), np.uint8)
    if not encoded.size:
        raise ValueError(f'{path} is an empty file, accepted is an image')
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        image = cv2.imdecode(encoded, flags)
    except cv2.error as error:
        raise ValueError(f'{path} cannot be decoded: {error.err}') from error
    if image is None:
        raise ValueError(f'{path} is not an image, or damaged; accepted is {", ".join(SUFFIXES)}')
    return image


def write_image(path: str | Path, image: np.ndarray) -> None:
    """Write an image; the ending of the name chooses the format.

    Parameters
    ----------
    path : str or Path
        The file, replaced where it exists. Its folder is made where it does not exist.
    image : ndarray of uint8 or uint16, shape (height, width) or (height, width, 3)
        Gray values, or colours in the order blue, green, red.

    Raises
    ------
    ValueError
        If the format is unknown or the file cannot be written; the message names it.
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(f'{path} has an unknown format, accepted is {", ".join(SUFFIXES)}')
    _, encoded = cv2.imencode(path.suffix, image)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(encoded.tobytes())
    except OSError as error:
        raise ValueError(f'{path} cannot be written: {error.strerror}') from error


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise ValueError(f'{path} cannot be read: {error.strerror}') from error
