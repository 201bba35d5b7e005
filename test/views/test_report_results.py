"""What a report reads: results in files and folders, images that moved, pictures that fit."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from ahf_ros.base.target import SquareMarker, TrueTarget
from ahf_ros.files.image_files import find_image, read_image, write_image
from ahf_ros.views.report import images
from ahf_ros.views.report.images import fitted, shown_image, thumbnail
from ahf_ros.views.report.page import families_of, row
from ahf_ros.views.report.results import ImageResult, read_results, result_from_json
from ahf_ros.vision.image import stretched_to_8_bit
from ahf_ros.vision.stack import ImageStack
from support.results import record, save_image, save_lines, searched, target, undecoded


def result(content: object, source: Path = Path('r.jsonl')) -> ImageResult:
    return result_from_json(json.loads(json.dumps(content)), source, 'line 1')


def test_lines_that_cannot_be_used_are_named_and_the_others_are_read(tmp_path: Path) -> None:
    lines = save_lines(
        tmp_path / 'a.jsonl',
        record('a.png', target(1)),
        '{"image": "torn.pn',
        {'image': 'b.png', 'targets': [{'id': 1}]},
        {'image': 'c.png', 'targets': [], 'expected': -4},
        {'image': 'd.png', 'targets': [], 'search': {'discrepancies': [1], 'gamma_low': []}},
        {'image': 7, 'targets': []},
        'null',
        {'settings': 'those of the batch'},
        record('a.png', target(2), target(3)),
    )
    (tmp_path / 'b.json').write_text(json.dumps([record('e.png'), record('f.png', target(4))]))
    results, problems = read_results([tmp_path, tmp_path / 'gone.jsonl'])
    assert [it.image for it in results] == ['a.png', 'e.png', 'f.png']
    assert [len(it.targets) for it in results] == [2, 0, 1]  # the last line on an image counts
    words = ['line 2 is not JSON', 'x is None', 'expected is -4', 'gamma_high has 0 numbers']
    words += ['image is 7', 'line 7 is not an object', 'gone.jsonl cannot be read']
    assert len(problems) == len(words)
    assert all(word in problem for word, problem in zip(words, problems, strict=True)), problems
    assert str(lines) in problems[0]
    (tmp_path / 'results.jsonl').write_text(json.dumps(record('g.png')))
    assert [it.image for it in read_results([tmp_path])[0]] == ['g.png']  # of a batch
    (tmp_path / 'empty').mkdir()
    assert 'has no results' in read_results([tmp_path / 'empty'])[1][0]


def test_images_are_found_where_they_are_now(tmp_path: Path) -> None:
    source = tmp_path / 'results' / 'r.jsonl'
    save_image(tmp_path / 'results' / 'photos' / 'a.png')
    assert find_image('photos/a.png', source) == tmp_path / 'results' / 'photos' / 'a.png'
    for camera in ('left', 'right'):
        save_image(tmp_path / 'new' / camera / 'a.png')
    moved = find_image('/mnt/day1/right/a.png', source, [tmp_path / 'new'])
    assert moved == tmp_path / 'new' / 'right' / 'a.png'
    with pytest.raises(ValueError, match=r'^b.png is not there; --images says where it is$'):
        find_image('b.png', source)
    with pytest.raises(ValueError, match=r'a.png has 160 x 120 px, accepted is .* 80 x 120 px'):
        shown_image(replace(result(record(moved)), width=80))
    (tmp_path / 'torn.png').write_bytes(moved.read_bytes()[:200])
    with pytest.raises(ValueError, match=r'torn.png is damaged: its structure is cut'):
        shown_image(result(record(tmp_path / 'torn.png')))


def test_what_is_shown_is_what_was_identified(tmp_path: Path) -> None:
    path = save_image(tmp_path / 'a.png')
    image = read_image(path)
    original, filtered = shown_image(result(record(path, target(1))))
    assert filtered is None
    assert (original == image).all()
    original, filtered = shown_image(result(record(path, target(1), **searched())))
    assert filtered is not None
    assert (original == image).all()
    assert not (filtered == image).all()
    other = tmp_path / 'b.png'
    write_image(other, image[::-1])
    stack = {'images': [str(path), str(other)], 'combination': 'mean_gray'}
    content = record(path, target(1)) | stack
    combined = ImageStack((image, image[::-1])).combined('mean_gray')
    assert (shown_image(result(content))[0] == stretched_to_8_bit(combined)).all()


def test_pictures_take_no_more_bytes_than_they_may(monkeypatch: pytest.MonkeyPatch) -> None:
    noise = np.random.default_rng(3).integers(0, 256, (900, 1200), np.uint8)
    smooth = cv2.GaussianBlur(noise, (0, 0), 8)
    for image in (noise, smooth):
        for limit in (3000, 40_000):
            picture = fitted(image, limit)
            assert len(picture.content) <= limit
            decoded = cv2.imdecode(np.frombuffer(picture.content, np.uint8), cv2.IMREAD_GRAYSCALE)
            assert decoded.shape == (picture.height, picture.width)
    assert fitted(smooth, 40_000).width > fitted(noise, 40_000).width
    assert fitted(smooth, 4_000_000).width == 1200
    assert fitted(noise[:40, :50], 10).width <= 16
    long = np.resize(noise, (16, 32_767))  # WebP has no such sides
    assert 0 < len(fitted(long, 400_000).content) <= 400_000
    small = thumbnail(noise)
    assert (small.width, small.height) == (117, 88)
    monkeypatch.setattr(images.cv2, 'haveImageWriter', lambda _: False)
    assert fitted(noise, 40_000).kind == 'image/jpeg'


def test_a_row_tells_what_is_missed_and_what_is_doubtful() -> None:
    found = [target(7), target(9, 0.92), undecoded('uncertain', 12, 0.4), undecoded('unread')]
    listed = result(record('in/a.png', *found, expected=4, expected_ids=(7, 8, 9, 12)))
    shown = row(listed, families_of([listed]), 0.95)
    assert (shown['identified'], shown['expected'], shown['missed']) == (2, 4, 2)
    assert (shown['missedIds'], shown['unexpectedIds']) == ([8, 12], [])
    assert (shown['doubtful'], shown['unread']) == (2, 1)
    assert [it[6:] for it in shown['undecoded']] == [['uncertain', 12], ['unread', -1]]
    counted = row(result(record('a.png', target(7), expected=3)), ['metashape12'], 0.95)
    assert (counted['missed'], counted['missedIds'], counted['truth']) == (2, [], None)
    truth = [TrueTarget(7, 20.5, 38.0), TrueTarget(8, 100.0, 100.0)]
    judged = row(result(record('a.png', target(7), target(3))), ['metashape12'], 0.95, truth)
    assert (judged['expected'], judged['missed'], judged['missedIds']) == (2, 1, [8])
    assert judged['truth']['wrong'] == [1]
    assert judged['truth']['missed'] == [[8, 100.0, 100.0]]
    assert judged['truth']['errors'] == [[0, -0.5, 0.0]]


def test_a_row_has_the_corners_of_squares() -> None:
    corners = ((10.0, 10.0), (30.126, 10.0), (30.0, 30.0), (10.0, 30.0))
    square = SquareMarker(5, 5, 20.0, 20.0, 10.0, 10.0, family='aruco_4x4_50', corners=corners)
    shown = row(result(record('a.png', target(7), square)), ['aruco_4x4_50', 'metashape12'], 0.95)
    drawn = [[10.0, 10.0], [30.13, 10.0], [30.0, 30.0], [10.0, 30.0]]
    assert shown['squares'] == [{'id': 5, 'corners': drawn}]


def test_a_row_tells_what_is_wrong_with_the_edges() -> None:
    lines = (record('a.png', edge_shift=it) for it in (0.9, 0.1, None))
    edges = [row(result(line), [], 0.95)['edges'] for line in lines]
    assert edges == [
        'edges are 0.9 px too dark: ink gain, under-exposure or a linear camera',
        '',
        '',
    ]
    with pytest.raises(ValueError, match="edge_shift is 'wide', accepted is a number"):
        result({**record('a.png'), 'edge_shift': 'wide'})
