"""Images, truth and results in files; every file that cannot be used is named."""

from __future__ import annotations

import io
import json

import cv2
import numpy as np
import pytest

from ahf_ros.interchange.files import (
    SUFFIXES,
    read_image,
    read_results,
    read_truth,
    write_image,
    write_truth,
)
from ahf_ros.target import TrueTarget

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
        ('empty.png', 'is an empty file'),
        ('text.png', 'is not an image'),
    ]:
        with pytest.raises(ValueError, match=words) as caught:
            read_image(tmp_path / name)
        assert str(tmp_path / name) in str(caught.value)


def test_images_that_cannot_be_written_are_named(tmp_path):
    with pytest.raises(ValueError, match=r'image.xyz has an unknown format, accepted is .bmp'):
        write_image(tmp_path / 'image.xyz', GRAY)
    (tmp_path / 'file').touch()
    with pytest.raises(ValueError, match=r'image.png cannot be written: '):
        write_image(tmp_path / 'file' / 'image.png', GRAY)
    assert '.png' in SUFFIXES


def test_truth_that_is_written_is_read(tmp_path):
    truth = {
        'a.png': (TrueTarget(3, 1.25, 2.5), TrueTarget(7, 100.1234, 3.0, confirmed=False)),
        'b.png': (TrueTarget(1, 0.0, 0.0),),
    }
    write_truth(tmp_path / 'truth.csv', truth)
    assert read_truth(tmp_path / 'truth.csv') == truth


def test_truth_in_another_order_with_folders_and_no_confirmed(tmp_path):
    (tmp_path / 'truth.csv').write_text('\ufeffid,y,x,image,note\n5,2,1,in/a.png,?\n', 'utf-8')
    assert read_truth(tmp_path / 'truth.csv') == {'a.png': (TrueTarget(5, 1.0, 2.0),)}


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('image,id,x\n', 'has no column y'),
        ('', 'has no column id, image, x, y'),
        ('image,id,x,y\na.png,1,2,far\n', "line 2: y is 'far', accepted is a number"),
        ('image,id,x,y\na.png,1,nan,2\n', "line 2: x is 'nan', accepted is a finite number"),
        ('image,id,x,y\na.png,one,1,2\n', "line 2: id is 'one', accepted is an integer"),
        ('image,id,x,y\na.png,1\n', 'line 2: x is None, accepted is a number'),
        ('image,id,x,y\n,1,2,3\n', "line 2: image is '', accepted is the name of a file"),
        ('image,id,x,y\ni/a,1,2,3\nj/a,1,2,3\n', 'line 3: a is in two folders'),
    ],
)
def test_truth_that_cannot_be_used_is_named(tmp_path, text, message):
    (tmp_path / 'truth.csv').write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        read_truth(tmp_path / 'truth.csv')
    assert str(tmp_path / 'truth.csv') in str(caught.value)


def test_truth_that_is_no_text_is_named(tmp_path):
    write_image(tmp_path / 'image.png', GRAY)
    with pytest.raises(ValueError, match=r'image.png is not in UTF-8'):
        read_truth(tmp_path / 'image.png')


def test_truth_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(ValueError, match=r'truth.csv cannot be written: No such file'):
        write_truth(tmp_path / 'nowhere' / 'truth.csv', {})


def test_results_need_only_ids_and_places(tmp_path):
    lines = [
        json.dumps({'image': 'in/a.png', 'targets': [{'id': 4, 'x': 1.5, 'y': 2}]}),
        '',
        json.dumps({'image': 'b.png', 'targets': [], 'more': 1}),
    ]
    (tmp_path / 'results.jsonl').write_text('\n'.join(lines))
    results = read_results(tmp_path / 'results.jsonl')
    assert list(results) == ['a.png', 'b.png']
    (target,) = results['a.png']
    assert (target.id, target.x, target.y) == (4, 1.5, 2.0)


def test_results_from_standard_input(monkeypatch):
    monkeypatch.setattr('sys.stdin', io.StringIO('{"image": "a.png", "targets": []}\n'))
    assert read_results('-') == {'a.png': ()}


@pytest.mark.parametrize(
    ('line', 'message'),
    [
        ('{"image": ', 'line 1 is not JSON'),
        ('[]', 'line 1 is not an object with a list of targets'),
        ('{"image": "a", "targets": {}}', 'line 1 is not an object with a list of targets'),
        ('{"targets": []}', 'line 1: image is None, accepted is the name of a file'),
        ('{"image": "a", "targets": [3]}', 'line 1: target is 3, accepted is an object'),
        ('{"image": "a", "targets": [{"id": 1, "x": 2}]}', 'line 1: y is None'),
        ('{"image": "a", "targets": [{"id": 1.5, "x": 2, "y": 3}]}', 'line 1: id is 1.5'),
        ('{"image": "a", "targets": [{"id": 1, "x": NaN, "y": 3}]}', 'line 1: x is nan'),
        ('{"image": "a", "targets": []}\n{"image": "b/a", "targets": []}', 'a has appeared'),
    ],
)
def test_results_that_cannot_be_used_are_named(tmp_path, line, message):
    (tmp_path / 'results.jsonl').write_text(line)
    with pytest.raises(ValueError, match=message) as caught:
        read_results(tmp_path / 'results.jsonl')
    assert str(tmp_path / 'results.jsonl') in str(caught.value)
