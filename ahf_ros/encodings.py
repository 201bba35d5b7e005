"""Image messages without a copy where there need not be one, from ROS or from a bag."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np


@dataclass(frozen=True, slots=True)
class Encoding:
    """How the bytes of a pixel are meant.

    Attributes
    ----------
    channels : int
        Bytes per pixel.
    to_gray : int or None
        Code of `cv2.cvtColor` for the conversion to gray; None where the pixel is gray.
    """

    channels: int
    to_gray: int | None = None


ENCODINGS = {
    'mono8': Encoding(1),
    'bgr8': Encoding(3, cv2.COLOR_BGR2GRAY),
    'rgb8': Encoding(3, cv2.COLOR_RGB2GRAY),
}
"""The accepted encodings, named as in sensor_msgs/image_encodings.hpp."""


def decode_image(message: Any) -> np.ndarray:
    """Return the gray image of a message.

    Parameters
    ----------
    message : sensor_msgs/Image
        Of one of `ENCODINGS`; rows may be padded (`step`).

    Returns
    -------
    ndarray of uint8, shape (height, width)
        A view of the data of a gray message, not a copy.

    Raises
    ------
    ValueError
        If the encoding is not accepted, the image is empty, `step` is shorter than a row or
        `data` is shorter than `step` times `height`; the message names the field.
    """
    encoding = ENCODINGS.get(message.encoding)
    if encoding is None:
        raise ValueError(
            f'encoding is {message.encoding!r}, accepted is one of {", ".join(ENCODINGS)}'
        )
    for name, size in (('width', message.width), ('height', message.height)):
        if size == 0:
            raise ValueError(f'{name} is 0, accepted is an integer of at least 1')
    row = message.width * encoding.channels
    if message.step < row:
        raise ValueError(
            f'step is {message.step}, accepted is an integer of at least {row}: '
            f'a row of {message.width} px of {message.encoding}'
        )
    size = message.step * message.height
    if len(message.data) < size:
        raise ValueError(
            f'data is of {len(message.data)} bytes, accepted are at least {size}: '
            f'{message.height} rows of {message.step} bytes'
        )
    pixels: np.ndarray = np.ndarray(
        (message.height, message.width, encoding.channels),
        np.uint8,
        message.data,
        strides=(message.step, encoding.channels, 1),
    )
    if encoding.to_gray is None:
        return pixels[:, :, 0]
    return cv2.cvtColor(pixels, encoding.to_gray)


def decode_compressed(message: Any) -> np.ndarray:
    """Return the gray image of a compressed message.

    Parameters
    ----------
    message : sensor_msgs/CompressedImage
        JPEG, PNG of 8 or 16 bit, or another that OpenCV reads.

    Returns
    -------
    ndarray of uint8, uint16 or float32, shape (height, width)

    Raises
    ------
    ValueError
        If `data` is not an image.
    """
    encoded = np.frombuffer(message.data, np.uint8)
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
    image = cv2.imdecode(encoded, flags) if encoded.size else None
    if image is None:
        raise ValueError(
            f'data is {encoded.size} bytes of format {message.format!r} that are no image, '
            'accepted is JPEG or PNG'
        )
    return image
