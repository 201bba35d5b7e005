"""Image messages as gray images, from ROS or from a bag, copied only if necessary.

The encodings of sensor_msgs/image_encodings.hpp that hold an image are read. Values keep their
range: a 12-bit camera's or a float scanner's are not scaled before the logarithm.
"""

import struct
import zlib
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np

from ahf_ros.base.text import shown
from ahf_ros.files.image_files import NotedImage, decode_bytes
from ahf_ros.vision.image import check_size, without_gaps


@dataclass(frozen=True, slots=True)
class Encoding:
    """Meaning of the bytes of a pixel: `samples` numbers of the numpy type `kind`.

    `to_gray` is the code of `cv2.cvtColor` for the conversion to gray; where it is None, the
    sample with the index `gray` is the gray value.
    """

    kind: str
    samples: int = 1
    to_gray: int | None = None
    gray: int = 0

    @property
    def size(self) -> int:
        """Bytes per pixel in a row of the image."""
        return self.samples * np.dtype(self.kind).itemsize


_MAXIMUM_DATA = 2**33  # bytes of an image, as many as 2**28 px of the largest kind have

WITH_PLANES = 'nv12', 'nv21', 'nv24', 'i420'
"""Encodings with gray values first, and colours in planes behind them."""


def _encodings() -> dict[str, Encoding]:
    encodings = {'mono8': Encoding('u1'), 'mono16': Encoding('u2')}
    colours = {
        'rgb': (3, cv2.COLOR_RGB2GRAY),
        'bgr': (3, cv2.COLOR_BGR2GRAY),
        'rgba': (4, cv2.COLOR_RGBA2GRAY),
        'bgra': (4, cv2.COLOR_BGRA2GRAY),
    }
    # OpenCV names a pattern by its second row and column, ROS by its first.
    patterns = {
        'rggb': cv2.COLOR_BayerBG2GRAY,
        'bggr': cv2.COLOR_BayerRG2GRAY,
        'gbrg': cv2.COLOR_BayerGR2GRAY,
        'grbg': cv2.COLOR_BayerGB2GRAY,
    }
    for bits, kind in ((8, 'u1'), (16, 'u2')):
        for name, (samples, code) in colours.items():
            encodings[f'{name}{bits}'] = Encoding(kind, samples, code)
        for name, code in patterns.items():
            encodings[f'bayer_{name}{bits}'] = Encoding(kind, 1, code)
    # Unnamed channels are blue, green, red, as in cv_bridge; the first of two is gray.
    generic = {1: None, 2: None, 3: cv2.COLOR_BGR2GRAY, 4: cv2.COLOR_BGRA2GRAY}
    for name, kind in (('8U', 'u1'), ('16U', 'u2'), ('32F', 'f4'), ('64F', 'f8')):
        for samples, to_gray in generic.items():
            encodings[f'{name}C{samples}'] = Encoding(kind, samples, to_gray)
    encodings |= dict.fromkeys(('yuv422', 'uyvy'), Encoding('u1', 2, gray=1))
    encodings |= dict.fromkeys(('yuv422_yuy2', 'yuyv'), Encoding('u1', 2))
    encodings |= dict.fromkeys(WITH_PLANES, Encoding('u1'))
    return encodings


ENCODINGS = _encodings()
"""Accepted encodings by their names in sensor_msgs/image_encodings.hpp."""


def decode_image(message: Any) -> np.ndarray:
    """Return the gray image of a sensor_msgs/Image, of shape (height, width).

    It has one of `ENCODINGS`, in either byte order; rows may be padded (`step`). Colours are
    weighted as in ITU-R BT.601, whether the values are linear or not. The image has the values and
    the type that were sent, uint8, uint16, float32 or float64; for a gray message in the byte
    order of the machine, it is a view of its data. Values that are not finite, with which scanners
    mark missing pixels, are 0, unless the whole image is not finite.

    A ValueError names the field if the encoding is not accepted, the image is empty, `step` or
    `data` is too short, or `data` is too long.
    """
    encoding = ENCODINGS.get(message.encoding)
    if encoding is None:
        raise ValueError(
            f'encoding is {message.encoding!r}, accepted is one of {", ".join(ENCODINGS)}'
        )
    for name, size in (('width', message.width), ('height', message.height)):
        if size <= 0:
            raise ValueError(f'{name} is {size}, accepted is an integer of at least 1')
    row = message.width * encoding.size
    check_rows(message, 'step', row, f'a row of {message.width} px of {message.encoding}')
    size = message.height * message.step
    if len(message.data) > size and message.encoding not in WITH_PLANES:
        raise ValueError(
            f'data has {len(message.data)} bytes, accepted are {size}: '
            f'{message.height} rows of {message.step} bytes'
        )
    return without_gaps(_gray(_samples(message, encoding), encoding))


def check_rows(message: Any, step: str, minimum: int, row: str) -> None:
    """Raise a ValueError unless an Image or PointCloud2 has the bytes of all its rows.

    The field `step` holds the distance of two rows; a `row`, as the error calls it, takes at least
    `minimum` bytes.
    """
    value = getattr(message, step)
    if value < minimum:
        raise ValueError(f'{step} is {value}, accepted is an integer of at least {minimum}: {row}')
    size = message.height * value
    if len(message.data) < size:
        raise ValueError(
            f'data has {len(message.data)} bytes, accepted are at least {size}: '
            f'{message.height} rows of {value} bytes'
        )


def _samples(message: Any, encoding: Encoding) -> np.ndarray:
    """Return the samples of an image in the byte order of the machine, aligned."""
    kind = np.dtype(encoding.kind)
    sent = kind.newbyteorder('>' if message.is_bigendian else '<')
    samples = np.ndarray(
        (message.height, message.width, encoding.samples),
        sent,
        message.data,
        strides=(message.step, encoding.size, kind.itemsize),
    )
    return np.require(samples.astype(kind, copy=False), requirements='A')


def _gray(samples: np.ndarray, encoding: Encoding) -> np.ndarray:
    if encoding.to_gray is None:
        return samples[:, :, encoding.gray]
    if samples.dtype == np.float64:  # not accepted by cv2.cvtColor
        weights = np.array([0.114, 0.587, 0.299])
        with np.errstate(invalid='ignore', over='ignore'):  # of missing pixels
            return samples[:, :, :3] @ weights
    return cv2.cvtColor(np.ascontiguousarray(samples), encoding.to_gray)


def decode_compressed(message: Any) -> NotedImage:
    """Return the gray image of a sensor_msgs/CompressedImage, and whether it is damaged.

    It holds a file that OpenCV reads, such as a JPEG, or a PNG of 8 or 16 bit, or an Image as
    zstd_image_transport packs it; if not, a ValueError is raised.
    """
    if message.format == 'zstd':
        return NotedImage(decode_image(_unpacked(bytes(message.data))))
    return decode_bytes(message.data, f'data of format {message.format!r}')


def _unpacked(packed: bytes) -> Any:
    """Return the Image in data of zstd_image_transport, which are not of zstd, but of zlib."""
    layout = struct.Struct('<2IB2I')
    if len(packed) < layout.size:
        raise ValueError(f'data has {len(packed)} bytes, accepted are at least {layout.size}')
    height, width, is_bigendian, step, length = layout.unpack_from(packed)
    start, size = layout.size + length, height * step
    name = packed[layout.size : start].decode('ascii', 'replace')
    check_size(width, height, f'data of encoding {shown(name)}')
    if size > _MAXIMUM_DATA:
        raise ValueError(f'step is {step}, accepted are at most {_MAXIMUM_DATA} bytes in all')
    try:
        data = zlib.decompressobj(wbits=32 + zlib.MAX_WBITS).decompress(packed[start:], size + 1)
    except zlib.error as error:
        raise ValueError(f'data of format zstd cannot be decoded: {error}') from error
    return SimpleNamespace(
        height=height, width=width, encoding=name, is_bigendian=is_bigendian, step=step, data=data
    )


def nanoseconds(header: Any) -> int:
    """Return the stamp of a header, ns."""
    return int(header.stamp.sec * 10**9 + header.stamp.nanosec)
