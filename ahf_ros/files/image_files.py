"""Images in files, and images that are encoded as in files."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePath

import cv2
import numpy as np

from ahf_ros.base.deprecation import deprecated_arguments
from ahf_ros.base.extras import missing
from ahf_ros.base.inputs import register_input
from ahf_ros.base.opening import Most, read_bytes, reader
from ahf_ros.base.writing import write_whole
from ahf_ros.files.headers import HEIC, UPRIGHT, read_header
from ahf_ros.files.heic import ENDINGS, decoded_heic
from ahf_ros.files.whole import decoded
from ahf_ros.vision.image import as_oriented, check_size, without_gaps

SUFFIXES = ('.bmp', '.jpeg', '.jpg', '.png', '.tif', '.tiff')
"""Endings of the image files that are tested; others are tried."""

_LAST_ORIENTATION = 8
_ACCEPTED = f'accepted is one of {", ".join(SUFFIXES)}'
_ADVICE = f'{_ACCEPTED}: convert it in full size to 16-bit TIFF or PNG, without lens corrections'


def image_suffixes() -> tuple[str, ...]:
    """Return the endings of the files that are taken for images: of HEIC where that is read."""
    return SUFFIXES if missing('heic') else (*SUFFIXES, *ENDINGS)


def find_image(image: str, source: Path, folders: Sequence[Path] = ()) -> Path:
    """Return the path of an image, which may have moved since it was identified.

    It may now be in `folders`, directly or in the folders that `image` names. A relative path may
    start at the folder of `source`, the file with the result, or at the one around it. A
    ValueError says so if the image is nowhere.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     Path(folder, 'b').mkdir()
    ...     Path(folder, 'b', 'a.png').touch()
    ...     find_image('/gone/b/a.png', Path('r.jsonl'), [Path(folder)]).parts[-2:]
    ('b', 'a.png')
    """
    path = PurePath(image)
    parts = path.parts[1:] if path.is_absolute() else path.parts
    tails = [PurePath(*parts[start:]) for start in range(len(parts))]
    places = [folder / tail for folder in folders for tail in tails]
    beside = source.absolute().parent
    places += [Path(path), beside / path, beside.parent / path]
    for place in places:
        if place.is_file():
            register_input(place)
            return place
    where = f' or in {", ".join(map(str, folders))}' if folders else '; --images says where it is'
    raise ValueError(f'{image} is not there{where}')


@dataclass(frozen=True, slots=True, eq=False)
class NotedImage:
    """An image from a file, of shape (height, width), and what there is to say about the file.

    `orientation` is as in Exif, 1 to 8. `note` is a line for people on it, empty where the pixels
    are upright. `damage` says what is missing, empty where the image is whole: decoders fill up
    the rest, so targets may be found in what is left.
    """

    image: np.ndarray
    orientation: int = UPRIGHT
    note: str = ''
    damage: str = ''


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
    return read_noted_image(path, upright=upright).image


@reader('an image')
def read_noted_image(path: str | Path, *, upright: bool = False) -> NotedImage:
    """Return an image as `read_image` does, with what there is to say about its file."""
    noted = _decoded(read_bytes(path, Most.IMAGE), str(path))
    if not UPRIGHT < noted.orientation <= _LAST_ORIENTATION:  # cameras write 0 for none
        return noted
    if upright:
        image = as_oriented(noted.image, noted.orientation)
        done, of = 'is applied', 'the upright image'
    else:
        image = noted.image
        done, of = 'is not applied', 'the pixels'
    note = f'{path}: orientation {noted.orientation} {done}; coordinates are those of {of}'
    return replace(noted, image=image, note='; '.join(filter(None, (noted.note, note))))


def decode_bytes(encoded: bytes, name: str) -> NotedImage:
    """Return an encoded image with the gray values that `read_image` returns.

    Errors call the image `name`. `encoded` may be any object with a buffer.
    """
    return _decoded(bytes(encoded), name)


def _decoded(content: bytes, name: str) -> NotedImage:
    """Return an encoded image as its pixels are stored."""
    if not content:
        raise ValueError(f'{name} is empty, accepted is an image')
    header = read_header(content)
    if header.kind == HEIC and not missing('heic'):
        pixels, note = decoded_heic(content, name)
        return NotedImage(pixels, note=note)
    if header.raw:
        raise ValueError(f'{name} is a raw image, {_ADVICE}')
    check_size(header.width, header.height, name)
    stored = np.frombuffer(content, np.uint8)
    if header.changes:
        stored = stored.copy()
        for place, layout, value in header.changes:
            struct.pack_into(layout, stored, place, value)
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        image, damage = decoded(stored, flags)
    except cv2.error as error:  # for instance if the header says that the image is too large
        raise ValueError(f'{name} cannot be decoded: {error.err}') from error
    if image is None:
        if header.kind:
            more = f'; {missing("heic")}' if header.kind == HEIC else ''
            raise ValueError(f'{name} is {header.kind}, {_ADVICE}{more}')
        what = f'is damaged: {damage}' if damage else 'is not an image, or is damaged'
        raise ValueError(f'{name} {what}; {_ACCEPTED}')
    note = f'{name} has {header.pages} pages, the first is read' if header.pages > 1 else ''
    return NotedImage(without_gaps(image), header.orientation, note, damage)


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
    write_whole(path, cv2.imencode(path.suffix, image)[1].tobytes())
