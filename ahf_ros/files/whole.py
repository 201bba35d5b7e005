"""Whether an encoded image is whole: decoders fill up what is missing, and return an image."""

import os
import re
import struct
import threading
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from tempfile import mkstemp

import cv2
import numpy as np

from ahf_ros.base.text import printable
from ahf_ros.files.png import is_png, png_chunks
from ahf_ros.files.tiff import first_directory, is_tiff

_JPEG = b'\xff\xd8'
_END, _SCAN = 0xD9, 0xDA  # markers of JPEG
_ALONE = frozenset((0x01, *range(0xD0, 0xD9)))  # markers without a segment
_AFTER_DATA = re.compile(rb'\xff[\x01-\xcf\xd8-\xfe]')  # the next marker but for restarts
_PLACES = ((273, 279), (324, 325))  # tags of TIFF: where strips or tiles are, and their sizes

_SAID = re.compile(r'(Corrupt JPEG data|Premature end of JPEG|TIFF_Error|libpng error).*')
_LOG = re.compile(r'\[ *(ERROR|WARN):\d+@|libpng warning')  # of decoders
_PADDED = re.compile(r'(\d+) extraneous bytes before marker 0xd9')
_PADDING = 16  # bytes after the data of all pixels, as some webcams send them

_LARGEST_PIXEL = 9  # bytes of a PNG: four samples of 16 bit, and what packing may add
_BESIDE = 2**24  # bytes of a chunk with something else than pixels

_lock = threading.Lock()
_passed = 0  # bytes that were held back and passed on


def damage(data: bytes) -> str:
    """Return what is missing in an encoded image, for people; empty where nothing is seen.

    A JPEG needs its end marker (ITU-T T.81, B.1.1), a PNG the checksums of its critical chunks and
    its last chunk, a TIFF its strips or tiles. What follows the image is not looked at. Nothing is
    decoded: `decoded` also has what a decoder finds.
    """
    try:
        if data.startswith(_JPEG):
            return '' if _jpeg_ends(data) else 'it has no end marker, so it is cut'
        if is_png(data):
            return _png_damage(data)
        if is_tiff(data):
            return _tiff_damage(data)
    except (struct.error, ValueError, OverflowError, IndexError):
        return 'its structure is cut or damaged'
    return ''


def decoded(data: np.ndarray, flags: int) -> tuple[np.ndarray | None, str]:
    """Return what `cv2.imdecode` does, and what is missing in the image as `damage` says it.

    Decoders write to standard error what they fill up, and nowhere else. During a call, what other
    threads write there is held back.
    """
    content = data.tobytes()
    seen = damage(content)
    if is_png(content) and not _is_credible(content):
        return None, seen
    with _lock, _standard_error() as said:
        image = cv2.imdecode(data, flags)
    for line in said:
        found = _SAID.search(line)
        padded = _PADDED.search(line)
        if found and not (padded and int(padded[1]) <= _PADDING):
            seen = seen or printable(found[0])
    return image, seen


@contextmanager
def _standard_error() -> Iterator[list[str]]:
    """Hold back what this process writes to standard error, and return its lines at the end.

    All others than those of decoders about damage are written afterwards; what another thread was
    writing at that moment follows with the next image.
    """
    global _passed
    lines: list[str] = []
    try:
        held, original = _scratch_file(), os.dup(2)
    except OSError:  # there is no room, or standard error is closed
        yield lines
        return
    try:
        os.dup2(held, 2)
        try:
            yield lines
        finally:
            os.dup2(original, 2)
        os.lseek(held, _passed, os.SEEK_SET)  # writes are appended, wherever this is
        written = os.read(held, os.fstat(held).st_size)
        _passed += len(written)
        logged = False
        for line in written.splitlines(keepends=True):
            text = line.decode(errors='replace')
            lines.append(text)
            logged = bool(_LOG.match(text) or (logged and not text.strip()))
            if not (logged or _SAID.search(text)):
                with suppress(OSError):  # nobody reads it any more
                    os.write(original, line)
    finally:
        os.close(original)


@cache
def _scratch_file() -> int:
    """Return the descriptor of a file of this process to which every write is appended."""
    made, name = mkstemp(prefix='ahf_')
    os.close(made)
    descriptor = os.open(name, os.O_RDWR | os.O_APPEND | getattr(os, 'O_BINARY', 0))
    with suppress(OSError):  # Windows removes no open file
        os.unlink(name)  # noqa: PTH108
    return descriptor


def _jpeg_ends(data: bytes) -> bool:
    """Return whether an end marker follows the segments and scans of a JPEG."""
    place = len(_JPEG)
    while True:
        place = data.index(0xFF, place) + 1
        marker = data[place]
        if marker == _END:
            return True
        if marker in (0x00, 0xFF) or marker in _ALONE:
            continue
        (size,) = struct.unpack_from('>H', data, place + 1)
        place += 1 + size
        if marker == _SCAN:
            following = _AFTER_DATA.search(data, place)
            if following is None:
                return False
            place = following.start()


def _png_damage(data: bytes) -> str:
    view = memoryview(data)
    for kind, place, size in png_chunks(data):
        (checksum,) = struct.unpack_from('>L', data, place + size)
        critical = kind[0] & 0x20 == 0
        if critical and zlib.crc32(view[place - 4 : place + size]) != checksum:
            return f'the checksum of its chunk {printable(kind.decode("latin-1"))} is wrong'
    return ''


def _is_credible(data: bytes) -> bool:
    """Return whether no chunk of a PNG says that it is larger than all its pixels.

    A decoder takes the memory for a chunk before it looks whether that is there: 4 GB at most.
    """
    with suppress(struct.error):
        width, height = struct.unpack_from('>LL', data, 16)
        most = _LARGEST_PIXEL * width * height + _BESIDE
        return all(size <= most for _, _, size in png_chunks(data))
    return True


def _tiff_damage(data: bytes) -> str:
    fields = first_directory(data)
    for offsets, sizes in _PLACES:
        if offsets in fields and sizes in fields:
            ends = fields[offsets].values(data) + fields[sizes].values(data)
            if ends.size and ends.max() > len(data):
                return f'it has {len(data)} bytes, its pixels go to byte {ends.max():.0f}'
    return ''
