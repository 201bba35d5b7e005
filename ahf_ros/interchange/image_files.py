"""Images in files, and images that are encoded as in files.

Size and orientation are read from the headers of PNG 1.2, JPEG (ITU-T T.81), TIFF 6.0, BigTIFF and
BMP with Exif 2.3, before anything is decoded: OpenCV alone takes 1.1 GB for a PNG file of 0.5 MB.
Pillow, one more dependency, opens neither TIFF files of float64 nor colour ones of float32, and
does not say where in a file the orientation is.
"""

from __future__ import annotations

import struct
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from ahf_ros.deprecation import deprecated_arguments
from ahf_ros.imaging.image import check_size
from ahf_ros.interchange.files import read_bytes, write_whole

SUFFIXES = ('.bmp', '.jpeg', '.jpg', '.png', '.tif', '.tiff')
"""Endings of the image files that are tested; others are tried."""

UPRIGHT = 1
"""Orientation of an image whose first row is the upper one and whose first column is the left."""

_PNG = b'\x89PNG\r\n\x1a\n'
_WIDTH, _HEIGHT, _ORIENTATION = 256, 257, 274  # tags of TIFF
_LAYOUTS = {1: 'B', 3: 'H', 4: 'L', 16: 'Q'}  # of integers, by the type of a TIFF field
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # JPEG markers with the size
_FIELDS = 4096  # of a directory, that are read at most
_DAMAGES = struct.error, ValueError, OverflowError  # of headers


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
    """Return an image as `read_image` does, and a line for people on the orientation in its file.

    The line is empty if the file notes none.
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
    """Return an image turned upright, from its orientation in Exif (CIPA DC-008, table 4).

    Orientations other than 1 to 8 are `UPRIGHT`.
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

    Errors call the image `name`. `encoded` may be any object with a buffer.
    """
    return _decoded(bytes(encoded), name)[0]


def _decoded(content: bytes, name: str) -> tuple[np.ndarray, int]:
    """Return the gray values of an encoded image as they are stored, and its orientation."""
    if not content:
        raise ValueError(f'{name} is empty, accepted is an image')
    header = read_header(content)
    check_size(header.width, header.height, name)
    stored = np.frombuffer(content, np.uint8)
    if header.orientation_at and header.orientation != UPRIGHT:
        # OpenCV applies the orientation of a TIFF file whatever its flags say.
        stored, (place, layout) = stored.copy(), header.orientation_at
        struct.pack_into(layout, stored, place, UPRIGHT)
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        image = cv2.imdecode(stored, flags)
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


@dataclass(frozen=True, slots=True)
class ImageHeader:
    """What an image file says of itself.

    A width or height of 0 px is not known. `orientation` is as in Exif, 1 to 8. `orientation_at`
    is its place in a TIFF file and its layout for `struct`.
    """

    width: int = 0
    height: int = 0
    orientation: int = UPRIGHT
    orientation_at: tuple[int, str] | None = None


def read_header(content: bytes) -> ImageHeader:
    """Return the header of an image file; of a format or file that is not known, an empty one."""
    with suppress(*_DAMAGES):
        if content.startswith(_PNG):
            return _png(content)
        if content.startswith(b'\xff\xd8'):
            return _jpeg(content)
        if content[:4] in (b'II*\0', b'MM\0*', b'II+\0', b'MM\0+'):
            return _tiff(content)
        if content.startswith(b'BM'):
            width, height = struct.unpack_from('<ii', content, 18)
            return ImageHeader(abs(width), abs(height))
    return ImageHeader()


def _png(content: bytes) -> ImageHeader:
    width, height = struct.unpack_from('>LL', content, 16)
    orientation = UPRIGHT
    place = len(_PNG)
    while place + 8 <= len(content):
        size, kind = struct.unpack_from('>L4s', content, place)
        if kind == b'eXIf':
            orientation = _exif(content[place + 8 : place + 8 + size])
        if kind in (b'eXIf', b'IDAT', b'IEND'):
            break
        place += 12 + size
    return ImageHeader(width, height, orientation)


def _jpeg(content: bytes) -> ImageHeader:
    orientation = UPRIGHT
    place = 2
    while place + 4 <= len(content) and content[place] == 0xFF:
        marker = content[place + 1]
        if marker == 0xFF:  # fills up
            place += 1
            continue
        (size,) = struct.unpack_from('>H', content, place + 2)
        if marker in _FRAMES:
            height, width = struct.unpack_from('>HH', content, place + 5)
            return ImageHeader(width, height, orientation)
        if marker == 0xE1 and content[place + 4 : place + 10] == b'Exif\0\0':
            orientation = _exif(content[place + 10 : place + 2 + size])
        place += 2 + size
    return ImageHeader(orientation=orientation)


def _exif(content: bytes) -> int:
    """Return the orientation in Exif data, which are a TIFF file without pixels."""
    with suppress(*_DAMAGES):
        return _tiff(content).orientation
    return UPRIGHT


def _tiff(content: bytes) -> ImageHeader:
    """Return what the fields with one integer in the first directory say."""
    order = '<' if content[:2] == b'II' else '>'
    big = content[2:4] in (b'+\0', b'\0+')
    offset_at, word, count_layout, field = (8, 'Q', 'Q', 'HHQ') if big else (4, 'L', 'H', 'HHL')
    (start,) = struct.unpack_from(order + word, content, offset_at)
    (count,) = struct.unpack_from(order + count_layout, content, start)
    place = start + struct.calcsize(order + count_layout)
    found: dict[int, tuple[int, tuple[int, str]]] = {}
    for _ in range(min(count, _FIELDS)):
        tag, kind, values = struct.unpack_from(order + field, content, place)
        place += struct.calcsize(order + field)
        if values == 1 and kind in _LAYOUTS:
            layout = order + _LAYOUTS[kind]
            found[tag] = struct.unpack_from(layout, content, place)[0], (place, layout)
        place += struct.calcsize(order + word)
    width, height = (found.get(tag, (0, None))[0] for tag in (_WIDTH, _HEIGHT))
    orientation, orientation_at = found.get(_ORIENTATION, (UPRIGHT, None))
    return ImageHeader(width, height, orientation, orientation_at)
