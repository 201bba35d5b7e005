"""Sheets of targets: nothing overlaps, everything is on the page, and lengths are right."""

import json
import math
import re
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ahf_ros import create_detector
from ahf_ros.prints.printing.drawing import Line, Text, text_width
from ahf_ros.prints.printing.files import geometry_text, sheet_files
from ahf_ros.prints.printing.paper import LABEL_SHEETS, length_in, page_in
from ahf_ros.prints.printing.settings import SheetSettings
from ahf_ros.prints.printing.sheets import MARGIN, Sheets
from support import ROOT
from support.square_markers import needs_square_markers
from support.svg import rastered

Box = tuple[float, float, float, float]
"""Left, bottom, right, top."""

LARGE = {'family': 'metashape20', 'ids': '25000-26000'}
ARUCO = {'family': 'aruco_4x4_1000', 'ids': '990-999'}
SHEETS: dict[str, dict[str, Any]] = {
    'many': {'ids': '1-53, 54'},
    'small': {'ids': '1-161', 'dot_radius': '0.5mm', 'page': 'A5'},
    'large': {'ids': '1-3', 'dot_radius': '21mm', 'polarity': 'bright'},
    'one a page': {'ids': '1-3', 'per_page': 1, 'page': 'letter', 'landscape': True},
    'four a page': {'ids': '5-10', 'per_page': 4, 'dot_radius': '1cm'},
    'own page': {'family': 'aicon12', 'ids': '1-30', 'page': '300x150mm'},
    'tiny page': {'ids': '9-12', 'page': '70x70mm', 'dot_radius': '3'},
    'dots': {'family': 'dots', 'polarity': 'bright', 'dot_radius': '3mm'},
    'gsi': {'family': 'gsi', 'ids': '1, 2, 10001-10003', 'dot_radius': '1.5mm'},
    'labels': {'ids': '1-70', 'labels': 'avery6450', 'dot_radius': '2mm'},
    'large labels': LARGE | {'labels': 'avery5293', 'dot_radius': '3mm'},
}
MARKERS = {
    'markers': {'family': 'apriltag_36h11', 'ids': '0-30', 'side': '30mm'},
    'marker labels': ARUCO | {'labels': 'avery8293', 'side': '12mm'},
}
ALL = [
    *(pytest.param(item, id=name) for name, item in SHEETS.items()),
    *(pytest.param(item, id=name, marks=needs_square_markers) for name, item in MARKERS.items()),
]


def box_of(text: Text) -> Box:
    width = text_width(text.content, text.size)
    below, above = -0.25 * text.size, 0.75 * text.size
    if text.upwards:
        return text.x - above, text.y, text.x - below, text.y + width
    left = text.x - width / 2 if text.centred else text.x
    return left, text.y + below, left + width, text.y + above


def box_around(line: Line) -> Box:
    (x1, y1), (x2, y2) = line.start, line.end
    return min(x1, x2), min(y1, y2), max(x1, x2), max(y1, y2)


def apart(first: Box, second: Box) -> bool:
    return (
        first[2] <= second[0]
        or second[2] <= first[0]
        or first[3] <= second[1]
        or second[3] <= first[1]
    )


def distance_to(box: Box, x: float, y: float) -> float:
    beside = max(box[0] - x, 0, x - box[2])
    return math.hypot(beside, max(box[1] - y, 0, y - box[3]))


@pytest.mark.parametrize('values', ALL)
def test_every_target_has_its_caption_and_nothing_overlaps_or_leaves_the_page(
    values: dict[str, Any],
) -> None:
    settings = SheetSettings(**values)
    sheets = Sheets(settings)
    zone = settings.radius * settings.proportions.quiet_zone - 1e-9
    pages = list(sheets.pages())
    assert len(pages) == sheets.count
    shown = []
    for page in pages:
        words, lines = [box_of(text) for text in page.texts], [box_around(it) for it in page.lines]
        for left, bottom, right, top in (*words, *lines):
            assert left >= 3 and bottom >= 3 and right <= page.width - 3 and top <= page.height - 3
        for first, second in combinations(words, 2):
            assert apart(first, second)
        for ink in page.inks:
            assert zone <= ink.x <= page.width - zone and zone <= ink.y <= page.height - zone
            assert all(distance_to(box, ink.x, ink.y) >= zone for box in (*words, *lines))
        for first, second in combinations(page.inks, 2):
            assert math.hypot(first.x - second.x, first.y - second.y) >= 2 * zone
        texts = [word for text in page.texts for word in text.content.split()]
        numbers = [ink.name.split()[-1] for ink in page.inks]
        assert set(numbers) <= set(texts)
        assert texts.count(settings.family) >= len(page.inks)
        shown += map(int, numbers)
    assert shown == sheets.numbers == [target.id for target in sheets.targets()]


def test_bars_of_100_mm_in_both_axes_where_there_is_room() -> None:
    (page,) = Sheets(SheetSettings(ids='1')).pages()
    longest = [line for line in page.lines if math.dist(line.start, line.end) > 90]
    ends = [np.subtract(line.end, line.start).tolist() for line in longest]
    assert ends == [[100, 0], [0, 100]]
    ticks = [line for line in page.lines if line.start[1] == 6 and line.end[0] == line.start[0]]
    assert [tick.start[0] - MARGIN for tick in ticks] == list(range(0, 101, 10))
    (small,) = Sheets(SheetSettings(ids='1', page='80x90mm')).pages()
    lengths = sorted(math.dist(line.start, line.end) for line in small.lines)
    assert lengths[-2:] == [pytest.approx(20), pytest.approx(50)]


def test_cut_marks_are_at_the_corners_of_cells_and_not_on_labels() -> None:
    (page,) = Sheets(SheetSettings(ids='1-3')).pages()
    crosses = [line for line in page.lines if math.dist(line.start, line.end) == pytest.approx(4)]
    assert len(crosses) == 2 * 8
    (labels,) = Sheets(SheetSettings(ids='1-3', labels='avery6450', dot_radius='2mm')).pages()
    assert not [line for line in labels.lines if math.dist(line.start, line.end) == 4]


def test_labels_are_where_the_maker_has_them() -> None:
    sheet = LABEL_SHEETS['avery6450']
    right = sheet.left + (sheet.columns - 1) * sheet.pitch_x + sheet.diameter
    bottom = sheet.top + (sheet.rows - 1) * sheet.pitch_y + sheet.diameter
    assert (sheet.columns * sheet.rows, sheet.diameter) == (63, 25.4)
    assert right + sheet.left == pytest.approx(215.9)
    assert bottom + sheet.top == pytest.approx(279.4)
    sheets = Sheets(SheetSettings(**SHEETS['labels']))
    first = next(sheets.targets())
    assert (first.x, first.y) == pytest.approx((0.875 * 25.4, 10 * 25.4))
    assert sheets.count == 2


def test_svg_pages_show_the_targets_at_their_places() -> None:
    sheets = Sheets(SheetSettings(ids='1-30', page='A5', dot_radius='3mm', polarity='bright'))
    files = list(sheet_files(Path('here/sheet.svg'), sheets))
    assert [str(path) for path, _ in files] == ['here/sheet_1.svg', 'here/sheet_2.svg']
    detect = create_detector(family='metashape12', polarity='bright')
    targets = list(sheets.targets())
    for number, (_, content) in enumerate(files, 1):
        image = rastered(content, 4.0)
        found = detect((image // 2 + 60).astype(np.uint8))
        printed = [target for target in targets if target.page == number]
        assert [target.id for target in found] == [target.id for target in printed]
        for target, place in zip(found, printed, strict=True):
            x, y = (target.x + 0.5) / 4, 210 - (target.y + 0.5) / 4
            assert math.dist((x, y), (place.x, place.y)) < 0.02


def test_the_picture_of_the_documentation_is_current() -> None:
    sheets = Sheets(SheetSettings(ids='1-6', page='A6', landscape=True))
    ((_, content),) = sheet_files(Path('targets.svg'), sheets)
    assert (ROOT / 'docs' / 'targets.svg').read_bytes() == content


def test_the_geometry_is_that_of_the_pages() -> None:
    sheets = Sheets(SheetSettings(ids='1-40', dot_radius='4mm', pinhole=0.1))
    geometry = json.loads(geometry_text(sheets))
    assert geometry['page'] == {'name': 'A4', 'width': 210.0, 'height': 297.0}
    assert geometry['radii'] == {
        'dot': 4.0,
        'pinhole': 0.4,
        'band_inner': 9.0,
        'band_outer': 14.0,
        'quiet_zone': 16.8,
    }
    inks = [(number, ink) for number, page in enumerate(sheets.pages(), 1) for ink in page.inks]
    assert (sheets.count, len(next(sheets.pages()).inks)) == (2, 35)
    for target, (page, ink) in zip(geometry['targets'], inks, strict=True):
        assert (target['page'], f'metashape12 {target["id"]}') == (page, ink.name)
        assert (target['x'], target['y']) == pytest.approx((ink.x, ink.y), abs=1e-6)
    assert geometry['targets'][0]['code'] == 71


@pytest.mark.parametrize(
    ('text', 'length'), [('4mm', 4), ('4', 4), ('.4 cm', 4), ('0.25in', 6.35), ('72pt', 25.4)]
)
def test_lengths(text: str, length: float) -> None:
    assert length_in('dot_radius', text) == pytest.approx(length)


def test_the_width_of_text_is_that_of_helvetica() -> None:
    assert text_width('100 mm', 10.0) == 36.12


def test_pages() -> None:
    assert (page_in('LETTER').width, page_in('21x29.7cm').height) == (215.9, 297.0)
    assert page_in('8.5x11in').name == '8.5x11in'
    assert SheetSettings(page='a3', landscape=True).paper.width == 420


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        ({'ids': '160-163'}, 'ids has 162, 163, accepted are IDs of metashape12 from 1 to 161'),
        ({'dot_radius': '-4mm'}, "dot_radius is '-4mm', accepted is a length such as 4mm"),
        ({'dot_radius': '9km'}, "dot_radius is '9km', accepted is a length"),
        ({'page': 'B7'}, "page is 'B7', accepted is one of A0, A1"),
        ({'page': '9000x20mm'}, "page is '9000mm', accepted is a length"),
        ({'side': '10mm'}, "side is '10mm', accepted is a length for a family of square markers"),
        ({'labels': 'avery6450', 'page': 'A4'}, "labels is 'avery6450', accepted with page"),
        ({'labels': 'mine'}, "labels is 'mine', accepted is one of none, avery6450"),
        ({'polarity': 'red'}, "polarity is 'red', accepted is one of auto, dark, bright"),
        ({'pinhole': 0.7}, 'pinhole is 0.7, accepted is a number from -1 to 0.5'),
        pytest.param(
            {'family': 'aruco_4x4_50', 'polarity': 'bright'},
            "polarity is 'bright' and family is 'aruco_4x4_50'",
            marks=needs_square_markers,
        ),
    ],
)
def test_settings_that_are_not_accepted_are_named(values: dict, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        SheetSettings(**values)


@pytest.mark.parametrize(
    'values',
    [
        {'dot_radius': '60mm'},
        {'dot_radius': '3mm', 'labels': 'avery6450'},
        pytest.param(
            {'family': 'aruco_4x4_50', 'side': '1m', 'page': 'A2'}, marks=needs_square_markers
        ),
    ],
)
def test_the_largest_radius_is_told_and_is_accepted(values: dict) -> None:
    settings = SheetSettings(**values)
    with pytest.raises(ValueError, match=r'accepted is at most [\d.]+ mm for ') as info:
        Sheets(settings).layout  # noqa: B018
    ((field, most),) = re.findall(r'(\w+) is .*accepted is at most ([\d.]+) mm', str(info.value))
    assert Sheets(replace(settings, **{field: f'{most} mm'})).layout.places
    too_much = {field: f'{float(most) + 0.011} mm'}
    with pytest.raises(ValueError, match='accepted is at most'):
        Sheets(replace(settings, **too_much)).layout  # noqa: B018


def test_a_page_too_small_for_anything() -> None:
    with pytest.raises(ValueError, match='dot_radius is 4 mm, accepted is no length for metash'):
        Sheets(SheetSettings(page='20x20mm')).layout  # noqa: B018


def test_a_family_tells_its_hole_and_colour(tmp_path: Path) -> None:
    file = tmp_path / 'mine.yaml'
    text = 'family: mine\nbits: 8\nband: [2, 3]\nwords: all\npinhole: 0.1\npolarity: bright\n'
    file.write_text(text)
    settings = SheetSettings(family='mine', family_file=str(file), ids='1')
    assert (settings.hole, settings.colour) == (0.1, 'bright')
    changed = replace(settings, pinhole=0.0, polarity='dark')
    assert (changed.hole, changed.colour) == (0.0, 'dark')
    usual = replace(settings, family='metashape12')
    assert (usual.hole, usual.colour) == (0.05, 'dark')
