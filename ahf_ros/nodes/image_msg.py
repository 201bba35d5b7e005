"""Images to sensor_msgs/Image."""

from __future__ import annotations

import array

import numpy as np
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from ahf_ros.interchange.image_messages import ENCODINGS


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
        step=width * ENCODINGS[encoding].size,
        data=data,
    )
