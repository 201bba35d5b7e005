"""Encoded images that are cut, have holes, or carry more than their pixels."""

import os
import struct
from threading import Thread
from typing import Any

import cv2
import numpy as np
import pytest

from ahf_ros.files.whole import damage, decoded

NOISE = np.random.default_rng(0).integers(0, 255, (240, 320), np.uint8)
SMOOTH = cv2.GaussianBlur(NOISE, (0, 0), 3)
FLAGS = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH
JPEG_KINDS = [[], [cv2.IMWRITE_JPEG_PROGRESSIVE, 1], [cv2.IMWRITE_JPEG_RST_INTERVAL, 4]]

OLD = tuple(map(int, cv2.__version__.split('.')[:2])) < (4, 7)


def encoded(suffix: str, *parameters: int) -> bytes:
    return bytes(cv2.imencode(suffix, SMOOTH, parameters)[1])


def decoded_damage(data: bytes) -> str:
    return decoded(np.frombuffer(data, np.uint8), FLAGS)[1]


def strips_first(pixels: np.ndarray, rows: int) -> bytes:
    """Return an uncompressed TIFF whose directory comes before its strips."""
    height, width = pixels.shape
    strips = -(-height // rows)
    tags = {256: width, 257: height, 258: 8, 259: 1, 262: 1, 277: 1, 278: rows}
    lists = 8 + 2 + (len(tags) + 2) * 12 + 4
    start = lists + 8 * strips
    offsets = [start + it * rows * width for it in range(strips)]
    sizes = [len(pixels[it * rows : (it + 1) * rows].tobytes()) for it in range(strips)]
    fields = [(tag, 1, value) for tag, value in tags.items()]
    fields += [(273, strips, lists), (279, strips, lists + 4 * strips)]
    directory = b''.join(struct.pack('<HHLL', tag, 4, *rest) for tag, *rest in sorted(fields))
    head = struct.pack('<2sHLH', b'II', 42, 8, len(fields)) + directory + bytes(4)
    return head + struct.pack(f'<{2 * strips}L', *offsets, *sizes) + pixels.tobytes()


@pytest.mark.parametrize('parameters', JPEG_KINDS)
def test_a_jpeg_that_is_cut_or_has_a_hole_is_damaged(parameters: Any) -> None:
    whole = encoded('.jpg', *parameters)
    middle = len(whole) // 2
    assert damage(whole) == decoded_damage(whole) == ''
    for cut in (whole[:middle], whole[:-2], whole[:300]):
        assert 'cut' in damage(cut)
        assert damage(cut) == decoded_damage(cut)
    for hole in (
        whole[:middle] + whole[middle + 1000 :],
        whole[:middle] + whole[-2:],
        whole[:middle] + bytes(1000) + whole[middle + 1000 :],
    ):
        assert 'Corrupt JPEG data' in decoded_damage(hole)


def test_what_cameras_add_to_a_jpeg_is_no_damage() -> None:
    whole = encoded('.jpg')
    thumbnail = cv2.imencode('.jpg', SMOOTH[:60, :80])[1].tobytes()
    exif = b'\xff\xe1' + struct.pack('>H', 8 + len(thumbnail)) + b'Exif\0\0' + thumbnail
    for good in (
        whole + bytes(100),  # padded
        whole + whole[: len(whole) // 3],  # a preview or a trailer, whatever it is
        whole[:2] + exif + whole[2:],
        whole[:2] + b'\xff\xff' + whole[2:],  # fills up before a marker
        whole[:-2] + b'\0' + whole[-2:],  # of some webcams
    ):
        assert decoded_damage(good) == ''


def test_a_tiff_whose_strips_are_not_in_the_file_is_damaged() -> None:
    whole = strips_first(SMOOTH, 16)
    assert np.array_equal(decoded(np.frombuffer(whole, np.uint8), FLAGS)[0], SMOOTH)
    assert damage(whole) == decoded_damage(whole) == ''
    size = len(whole)
    assert damage(whole[:-1]) == f'it has {size - 1} bytes, its pixels go to byte {size}'
    assert damage(whole[:150]) == 'its structure is cut or damaged'


@pytest.mark.skipif(OLD, reason='OpenCV before 4.7 does not say it')
@pytest.mark.parametrize('compression', [5, 8])
def test_a_tiff_with_a_hole_is_damaged(compression: int) -> None:
    whole = encoded('.tif', cv2.IMWRITE_TIFF_COMPRESSION, compression)
    middle = len(whole) // 2
    hole = whole[:middle] + bytes(1000) + whole[middle + 1000 :]
    assert decoded_damage(whole) == ''
    image, missing = decoded(np.frombuffer(hole, np.uint8), FLAGS)
    assert image is None or 'TIFF_Error' in missing  # some versions of OpenCV refuse it


def test_a_png_has_its_checksums_and_its_end() -> None:
    whole = encoded('.png')
    middle = len(whole) // 2
    changed = whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]
    assert damage(whole) == ''
    assert damage(changed) == 'the checksum of its chunk IDAT is wrong'
    assert damage(whole[:middle]) == 'its structure is cut or damaged'


def test_others_may_write_to_standard_error_meanwhile(capfd: pytest.CaptureFixture[str]) -> None:
    whole = encoded('.jpg')  # of which the decoder says nothing itself
    lines = [f'line {number}' for number in range(2000)]

    def write() -> None:
        for line in lines:
            os.write(2, f'{line}\n'.encode())

    writer = Thread(target=write)
    writer.start()
    while writer.is_alive():
        assert decoded_damage(whole) == ''
    writer.join()
    decoded_damage(whole)  # passes on what was being written during the last image
    assert sorted(capfd.readouterr().err.splitlines()) == sorted(lines)


def test_chunks_of_png_that_say_they_are_huge_take_no_memory() -> None:
    """Decoders take it, 4 GB, before they look for the content."""
    content = bytearray(encoded('.png'))
    place = content.index(b'IDAT') - 4
    content[place : place + 4] = b'\xff' * 4
    image, said = decoded(np.frombuffer(content, np.uint8), FLAGS)
    assert image is None
    assert said == 'its structure is cut or damaged'
