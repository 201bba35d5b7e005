"""Images to sensor_msgs/Image."""

from __future__ import annotations

import array

import numpy as np
from sensor_msgs.msg import Image
from std_msgs.msg import Header


def image_message(image: np.ndarray, header: Header) -> Image:
    """Return the message of an image, uint8.

    Gray, shape (height, width), is sent as mono8; blue, green, red, (height, width, 3), as bgr8.
    """
    height, width = image.shape[:2]
    encoding, channels = ('mono8', 1) if image.ndim == 2 else ('bgr8', 3)
    # An ndarray assigned to `data` is checked value by value; an array of bytes is taken as it is.
    data = array.array('B', bytes(image.size))
    np.frombuffer(data, np.uint8).reshape(image.shape)[:] = image
    return Image(
        header=header,
        height=height,
        width=width,
        encoding=encoding,
        step=width * channels,
        data=data,
    )
