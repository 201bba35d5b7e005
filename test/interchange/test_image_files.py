"""Images in files; every file that cannot be used is named."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from ahf_ros.interchange.image_files import SUFFIXES, read_image, write_image

GRAY = np.arange(20 * 30, dtype=np.uint16).reshape(20, 30)


@pytest.mark.parametrize('suffix', ['.png', '.tif', '.tiff', '.bmp'])
def test_what_is_written_is_read(tmp_path, suffix):
    image = (GRAY % 256).astype(np.uint8)
    write_image(tmp_path / 'deep' / f'image{suffix}', image)
    np.testing.assert_array_equal(read_image(tmp_path / 'deep' / f'image{suffix}'), image)


@pytest.mark.parametrize('suffix', ['.png', '.tif'])
def test_16_bit(tmp_path, suffix):
    write_image(tmp_path / f'image{suffix}', GRAY * 100)
    read = read_image(tmp_path / f'image{suffix}')
    assert read.dtype == np.uint16
    np.testing.assert_array_equal(read, GRAY * 100)


@pytest.mark.parametrize('suffix', ['.jpg', '.jpeg', '.png'])
@pytest.mark.parametrize('channels', [3, 4])
def test_colour_turns_to_gray(tmp_path, suffix, channels):
    colour = np.full((20, 30, channels), (200, 100, 50, 7)[:channels], np.uint8)
    write_image(tmp_path / f'image{suffix}', colour)
    read = read_image(str(tmp_path / f'image{suffix}'))
    assert read.shape == (20, 30)
    luma = 0.114 * 200 + 0.587 * 100 + 0.299 * 50
    np.testing.assert_allclose(read, luma, atol=2)


def test_float_images_keep_their_values(tmp_path):
    image = GRAY.astype(np.float32) / 7
    cv2.imwrite(str(tmp_path / 'image.tif'), image)
    np.testing.assert_array_equal(read_image(tmp_path / 'image.tif'), image)


def test_names_that_are_not_ascii(tmp_path):
    write_image(tmp_path / 'Prüfkörper.png', GRAY)
    np.testing.assert_array_equal(read_image(tmp_path / 'Prüfkörper.png'), GRAY)


def test_files_that_are_no_images_are_named(tmp_path):
    (tmp_path / 'empty.png').touch()
    (tmp_path / 'text.png').write_text('not an image')
    for name, words in [
        ('missing.png', 'cannot be read: No such file'),
        ('.', 'cannot be read: Is a directory'),
        ('empty.png', 'is empty'),
        ('text.png', 'is not an image'),
    ]:
        with pytest.raises(ValueError, match=words) as caught:
            read_image(tmp_path / name)
        assert str(tmp_path / name) in str(caught.value)


def test_images_that_cannot_be_written_are_named(tmp_path):
    with pytest.raises(
        ValueError, match=r'image.xyz has an unknown format, accepted is one of .bmp'
    ):
        write_image(tmp_path / 'image.xyz', GRAY)
    (tmp_path / 'file').touch()
    with pytest.raises(ValueError, match=r'image.png cannot be written: '):
        write_image(tmp_path / 'file' / 'image.png', GRAY)
    assert '.png' in SUFFIXES
