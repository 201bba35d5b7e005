"""Images from and to sensor_msgs/Image, without a copy where there need not be one."""

from __future__ import annotations

import array
from dataclasses import dataclass

import cv2
import numpy as np
from sensor_msgs.msg import Image
from std_msgs.msg import Header


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


def gray_image(message: Image) -> np.ndarray:
    """Return the gray image of a message.

    Parameters
    ----------
    message : sensor_msgs.msg.Image
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
    pixels = np.ndarray(
        (message.height, message.width, encoding.channels),
        np.uint8,
        message.data,
        strides=(message.step, encoding.channels, 1),
    )
    if encoding.to_gray is None:
        return pixels[:, :, 0]
    return cv2.cvtColor(pixels, encoding.to_gray)


def image_message(image: np.ndarray, header: Header) -> Image:
    """Return the message of an image.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width) or (height, width, 3)
        Gray, sent as mono8, or blue, green, red, sent as bgr8.
    header : std_msgs.msg.Header
        Of the image.
    """
    height, width = image.shape[:2]
    encoding = 'mono8' if image.ndim == 2 else 'bgr8'
    # An ndarray assigned to `data` is checked value by value; an array of bytes is taken as it is.
    data = array.array('B', bytes(image.size))
    np.frombuffer(data, np.uint8).reshape(image.shape)[:] = image
    return Image(
        header=header,
        height=height,
        width=width,
        encoding=encoding,
        step=width * ENCODINGS[encoding].channels,
        data=data,
    )
