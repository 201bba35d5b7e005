"""Images in files, and images that are encoded as in files."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from ahf_ros.deprecation import deprecated_arguments
from ahf_ros.imaging.image import check_size
from ahf_ros.interchange.files import read_bytes, write_whole
from ahf_ros.interchange.image_headers import UPRIGHT, read_header, without_orientation

SUFFIXES = ('.bmp', '.jpeg', '.jpg', '.png', '.tif', '.tiff')
"""Endings of the image files that are tested; others are tried."""


@deprecated_arguments(names={'turned': 'upright'})
def read_image(path: str | Path, *, upright: bool = False) -> np.ndarray:
    """Return the image in a file as gray values.

    Colour is converted to gray and transparency is ignored. The orientation that a camera notes
    in the file is not applied unless that is asked for: the pixels are those of the sensor.
    `read_noted_image` names it.

    Parameters
    ----------
    path : str or Path
        A PNG, JPEG, TIFF or BMP file, or another that OpenCV reads.
    upright : bool
        Whether to turn the image upright, as its orientation says.

    Returns
    -------
    ndarray of uint8, uint16, float32 or float64, shape (height, width)

    Raises
    ------
    ValueError
        If the file is missing, a folder, empty, unreadable or not an image; the message names it.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(f'{folder}/ramp.png', np.arange(400, dtype=np.uint16).reshape(20, 20))
    ...     image = read_image(f'{folder}/ramp.png')
    >>> image.shape, image.dtype, int(image[-1, -1])
    ((20, 20), dtype('uint16'), 399)
    """
    return read_noted_image(path, upright=upright)[0]


def read_noted_image(path: str | Path, *, upright: bool = False) -> tuple[np.ndarray, str]:
    """Return the image in a file as `read_image` does, and what there is to say about it.

    Parameters
    ----------
    path, upright
        As for `read_image`.

    Returns
    -------
    image : ndarray
    note : str
        A line for people if the file notes an orientation; empty if not.

    Raises
    ------
    ValueError
        As `read_image` does.
    """
    image, orientation = _decoded(read_bytes(path), str(path))
    if orientation == UPRIGHT:
        return image, ''
    if upright:
        image = as_oriented(image, orientation)
        done, of = 'is applied', 'the upright image'
    else:
        done, of = 'is not applied', 'the pixels'
    return image, f'{path}: orientation {orientation} {done}; coordinates are those of {of}'


def as_oriented(image: np.ndarray, orientation: int) -> np.ndarray:
    """Return an image turned upright.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        As it is stored.
    orientation : int
        As in Exif (CIPA DC-008, table 4), 1 to 8; others are `UPRIGHT`.

    Examples
    --------
    >>> as_oriented(np.array([[1, 2], [3, 4]]), 6)
    array([[3, 1],
           [4, 2]])
    """
    if orientation in (5, 6, 7, 8):
        image = image.T
    if orientation in (3, 4, 7, 8):
        image = image[::-1]
    if orientation in (2, 3, 6, 7):
        image = image[:, ::-1]
    return np.ascontiguousarray(image)


def decode_bytes(encoded: bytes, name: str) -> np.ndarray:
    """Return the gray values of an encoded image, as `read_image` does.

    Parameters
    ----------
    encoded : bytes, or another object with a buffer
        Content of an image file.
    name : str
        What errors call it.

    Raises
    ------
    ValueError
        If `encoded` is empty, not an image, or too large by its header.
    """
    return _decoded(bytes(encoded), name)[0]


def _decoded(content: bytes, name: str) -> tuple[np.ndarray, int]:
    """Return the gray values of an encoded image as they are stored, and its orientation."""
    if not content:
        raise ValueError(f'{name} is empty, accepted is an image')
    header = read_header(content)
    check_size(header.width, header.height, name)
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        image = cv2.imdecode(np.frombuffer(without_orientation(content, header), np.uint8), flags)
    except cv2.error as error:  # for instance if the header says that the image is too large
        raise ValueError(f'{name} cannot be decoded: {error.err}') from error
    if image is None:
        raise ValueError(
            f'{name} is not an image, or is damaged; accepted is one of {", ".join(SUFFIXES)}'
        )
    return image, header.orientation


def write_image(path: str | Path, image: np.ndarray) -> None:
    """Write an image in the format that the ending of the file name chooses.

    Parameters
    ----------
    path : str or Path
        The file; an existing one is replaced, a missing folder is created.
    image : ndarray of uint8 or uint16, shape (height, width) or (height, width, 3)
        Gray values, or colours in the order blue, green, red.

    Raises
    ------
    ValueError
        If the format is unknown or the file cannot be written; the message names the file.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(Path(folder, 'black.png'), np.zeros((20, 30), np.uint8))
    ...     print(*(file.name for file in Path(folder).iterdir()))
    black.png
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(f'{path} has an unknown format, accepted is one of {", ".join(SUFFIXES)}')
    _, encoded = cv2.imencode(path.suffix, image)
    write_whole(path, encoded.tobytes())
