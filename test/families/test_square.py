"""Identification of square markers on rendered scenes."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from ahf_ros.base.target import Target
from ahf_ros.families import Detector, create_detector
from ahf_ros.identification.session import identify
from ahf_ros.identification.settling import evident
from ahf_ros.prints import SQUARE_NAMES
from ahf_ros.prints.square import marker, words
from ahf_ros.scenes.evaluation import score
from ahf_ros.scenes.scene import Rendering
from ahf_ros.vision.image import GAMMA
from support.pictures.exposure import Exposure
from support.pictures.sheets import target_sheet
from support.pictures.textures import textured_image
from support.scenes import around, counted, rendering
from support.square_markers import needs_square_markers
from support.square_readers import readers

pytestmark = needs_square_markers
FAMILY = 'aruco_4x4_50'
SIZE = {'width': 1000, 'height': 750, 'targets': 6, 'dot_radius': 16.0, 'seed': 3}


@pytest.fixture
def detect() -> Detector:
    return create_detector(family=FAMILY)


def scene(family: str = FAMILY, **changes: object) -> Rendering:
    return rendering(family=family, **SIZE | changes)


@pytest.mark.parametrize(
    ('detector', 'family'),
    [
        ('aruco', 'aruco_4x4_50'),
        ('aruco', 'aruco_6x6_250'),
        ('apriltag', 'apriltag_36h11'),
        ('apriltag', 'apriltag_25h9'),
    ],
)
@pytest.mark.parametrize('tilt', [0.0, 45.0])
def test_markers_and_their_physical_centres(detector: str, family: str, tilt: float) -> None:
    shown = scene(family=family, tilt=tilt, targets=4)
    made = create_detector(family=family)
    assert (made.name, made.family) == (detector, family)
    found = made(shown.image)
    assert counted(shown, found) == (4, 0, 0)
    assert score(shown, found).rmse[2] < 0.03


def test_centres_of_markers_whose_cells_are_wider_than_any_blur(detect: Detector) -> None:
    size = {'width': 1800, 'height': 1400, 'dot_radius': 60.0, 'targets': 4, 'seed': 31}
    shown = scene(full_well=0.0, **size)
    errors = score(shown, detect(shown.image)).errors
    assert np.abs(errors).max() < 0.004  # 0.01 with profiles for more than the largest blur


@pytest.mark.parametrize(('gamma', 'low', 'high'), [(1.0, 0.45, 0.65), (2.2, -0.05, 0.05)])
def test_gamma_is_taken_out_of_the_shift_and_does_not_change_the_size(
    gamma: float, low: float, high: float, detect: Detector
) -> None:
    shown = scene(gamma=gamma, dot_radius=30.0, targets=2)
    true = {target.id: target for target in shown.targets}
    found = detect(shown.image)
    assert len(found) == 2
    for target in found:
        assert low < target.edge_shift < high
        assert target.semi_major == pytest.approx(true[target.id].semi_major, rel=0.002)


def test_several_dictionaries_are_read_in_one_search() -> None:
    for family in ('aruco_4x4_50', 'aruco_6x6_250', 'apriltag_25h9'):
        shown = scene(family=family, targets=4)
        found = create_detector(family=','.join(SQUARE_NAMES))(shown.image)
        assert counted(shown, found) == (4, 0, 0)
        # Of dictionaries that begin with the same markers, the smallest that has all of these.
        stem, _, count = family.rpartition('_')
        smallest = next((of for of in (50, 100, 250) if of > max(it.id for it in found)), None)
        named = f'{stem}_{smallest}' if count.isdigit() else family
        assert {target.family for target in found} == {named}
    assert create_detector(family='aruco_4x4_50,apriltag_36h11').name == 'square'


def test_markers_show_their_dictionary_together() -> None:
    """ID 17 has so few edges between cells that alone it may be of no dictionary of many."""
    shown = scene(targets=12, dot_radius=12.0, seed=5)
    found = create_detector(family=','.join(SQUARE_NAMES))(shown.image)
    assert 17 in {target.id for target in found}
    assert counted(shown, found) == (12, 0, 0)


@pytest.mark.parametrize(('family', 'seed'), [('aruco_4x4_50', 6), ('aruco_4x4_250', 5)])
def test_doubtful_markers_show_their_dictionary_together(family: str, seed: int) -> None:
    """Under these stripes no marker is sure enough to be of one dictionary of many."""
    size = {'width': 1400, 'height': 1000, 'targets': 12, 'dot_radius': 12.0}
    shown = scene(family, **size, light='stripe', ambient=0.12, seed=seed)
    found = create_detector(family=','.join(SQUARE_NAMES))(shown.image)
    named = create_detector(family=family)(shown.image)
    assert {it.family for it in found} == {family}
    assert [it.id for it in found] == [it.id for it in named]
    assert counted(shown, found) == (len(found), 0, 0)


@pytest.mark.parametrize('family', ['aruco_4x4_50', 'apriltag_16h5', 'aruco_5x5_50'])
def test_a_single_marker_shows_its_dictionary(family: str) -> None:
    detect = create_detector(family=','.join(SQUARE_NAMES))
    evidence = 0
    for seed in range(1, 6):
        shown = scene(family, width=400, height=300, targets=1, dot_radius=12.0, seed=seed)
        (found,) = detect(shown.image)
        assert (found.family, found.id) == (family, shown.targets[0].id)
        evidence += len(evident([found]))
    assert evidence >= 2  # some IDs are nearly those of other dictionaries


def test_hardly_any_texture_is_a_marker() -> None:
    detect = create_detector(family=','.join(SQUARE_NAMES))
    assert sum(len(detect(textured_image(seed))) for seed in range(101, 115)) == 0


@pytest.mark.parametrize(('family', 'seed'), [('aruco_4x4_1000', 4), ('aruco_4x4_50', 39)])
def test_letters_are_no_markers_with_few_edges(family: str, seed: int) -> None:
    assert create_detector(family=family)(textured_image(seed)) == []


def test_one_marker_of_a_larger_dictionary_is_read_among_many_of_a_smaller_one() -> None:
    sheet = target_sheet('aruco_4x4_1000', [*range(35), 73], 5)
    found = create_detector(family=','.join(SQUARE_NAMES))(sheet.photograph(Exposure()))
    assert {(it.family, it.id) for it in found} == {
        ('aruco_4x4_100', number) for number in (*range(35), 73)
    }


def test_letters_show_no_dictionary() -> None:
    """Narrow 0 and 8 are ID 1023 and 975 of aruco_original."""
    page = np.full((200, 900), 220, np.uint8)
    for column in range(8):
        letter = np.where(marker('aruco_original', (1023, 975)[column % 2], 1), 220, 50)
        letter = cv2.resize(letter.astype(np.uint8), (60, 84), interpolation=cv2.INTER_AREA)
        page[60:144, 30 + 105 * column : 90 + 105 * column] = letter
    page = cv2.GaussianBlur(page, (0, 0), 1.0)
    named = create_detector(family='aruco_original')(page)
    assert {it.id for it in named} == {975, 1023}
    assert create_detector(family=','.join(SQUARE_NAMES))(page) == []


def rounded(height: int, width: int, radius: int) -> np.ndarray:
    """Return a rectangle with round corners, 1 on 0."""
    inner = np.pad(np.ones((height - 2 * radius, width - 2 * radius), np.uint8), radius)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    return cv2.dilate(inner, disc)


def plate(height: int) -> np.ndarray:
    """Return six letters, 0 and 8, of a number plate; drawn eight times as large."""
    cell, width = height * 8 // 7, height * 2 // 3
    page = np.full((14 * cell, 60 * width), 220, np.uint8)
    for column in range(6):
        letter = rounded(7 * cell, 7 * width, cell)
        for top, rows in ((1, 2), (4, 2)) if column % 2 else ((1, 5),):
            hole = rounded(rows * cell, 3 * width, cell // 2)
            letter[top * cell : (top + rows) * cell, 2 * width : 5 * width] -= hole
        left = (3 + 9 * column) * width
        page[3 * cell : 10 * cell, left : left + 7 * width][letter > 0] = 50
    page = cv2.resize(page, None, fx=1 / 8, fy=1 / 8, interpolation=cv2.INTER_AREA)
    return cv2.GaussianBlur(page, (0, 0), 0.7)


@pytest.mark.lasting
def test_hardly_any_letter_with_round_corners_is_a_marker() -> None:
    """Of 66, four are where a quarter of the image shows no corner to be round."""
    detect = create_detector(family='aruco_original')
    assert sum(len(detect(plate(height))) for height in range(20, 101, 8)) <= 6


def test_sides_of_letters_converge() -> None:
    """A blunt A has the cells of ID 17 of aruco_4x4_50, whose lower half is black."""
    cells = np.kron(marker(FAMILY, 17, 1), np.ones((40, 40), np.uint8)) // 255 * 170 + 50
    side = len(cells)
    square = np.array([[0, 0], [side, 0], [side, side], [0, side]], np.float32)
    for inset, expected in ((0, [17]), (13, [])):
        letter = square * 36 / side + 60 + np.array([[inset, 0], [-inset, 0], [0, 0], [0, 0]])
        turn = cv2.getPerspectiveTransform(square, letter.astype(np.float32))
        page = cv2.warpPerspective(
            cells, turn, (640, 480), flags=cv2.INTER_AREA, borderValue=220, borderMode=0
        )
        found = create_detector(family=FAMILY)(cv2.GaussianBlur(page, (0, 0), 0.8))
        assert [it.id for it in found] == expected


@pytest.mark.parametrize('seed', [8, 9])
def test_plain_markers_show_their_dictionary_with_others(seed: int) -> None:
    shown = scene('aruco_original', seed=seed)
    found = create_detector(family=','.join(SQUARE_NAMES))(shown.image)
    assert counted(shown, found) == (6, 0, 0)


def test_markers_of_an_aprilgrid_touch_squares_and_have_wide_borders() -> None:
    family = 'apriltag_36h11'
    cells, gap, count = 10, 3, 3
    period = cells + gap
    grid = np.full((count * period + gap,) * 2, 225, np.uint8)
    for row, column in np.ndindex(count + 1, count + 1):
        top, left = row * period, column * period
        grid[top : top + gap, left : left + gap] = 30
        if row < count and column < count:
            white = words(family)[row * count + column]
            top, left = top + gap, left + gap
            grid[top : top + cells, left : left + cells] = 30
            grid[top + 2 : top + cells - 2, left + 2 : left + cells - 2][white] = 225
    image = cv2.resize(np.pad(grid, 3, constant_values=225), None, fx=7, fy=7, interpolation=0)
    light = cv2.GaussianBlur((image / 255) ** GAMMA, (0, 0), 1.0)
    found = create_detector(family=family)(np.uint8(255 * light ** (1 / GAMMA)))
    assert [it.id for it in found] == list(range(9))
    middle = 7 * (3 + gap + cells / 2) - 0.5
    rows, columns = np.divmod(np.arange(9), count)
    expected = middle + 7 * period * np.stack([columns, rows], axis=1)
    assert np.abs(np.array([(it.x, it.y) for it in found]) - expected).max() < 0.02
    assert {it.border for it in found} == {2}
    assert max(abs(it.edge_shift) for it in found) < 0.1


def test_markers_of_ten_pixels_are_read_in_sharp_images() -> None:
    family = 'apriltag_36h11'
    sheet = np.full((650, 900), 225, np.uint8)
    for number in range(6):
        top, left = 63 + 300 * (number // 3), 61 + 299 * (number % 3)
        sheet[top : top + 168, left : left + 168] = 30 + 195 * (marker(family, number, 21) > 0)
    image = cv2.resize(sheet, None, fx=1 / 16, fy=1 / 16, interpolation=cv2.INTER_AREA)
    found = create_detector(family=family)(image)
    assert [it.id for it in found] == list(range(6))


@pytest.mark.parametrize(('family', 'least'), [('apriltag_36h11', 16), ('aruco_6x6_250', 18)])
def test_small_markers_whose_ink_has_grown(family: str, least: int) -> None:
    """Doubtful ones are read where their prints lie; none is one with a border of two cells."""
    size = {'width': 1600, 'height': 1200, 'targets': 20, 'dot_radius': 10 / 3, 'seed': 1}
    shown = scene(family, **size, edge_shift=0.5)
    right, wrong, false = counted(shown, create_detector(family=family)(shown.image))
    assert right >= least
    assert wrong == false == 0


def washed_out(number: int, cell: int) -> np.ndarray:
    """Return a marker whose paper is as bright as can be, and grown by a quarter of a cell."""
    paper = cv2.copyMakeBorder(
        marker('apriltag_36h11', number, 32), *[96] * 4, cv2.BORDER_CONSTANT, value=255
    )
    grown = cv2.dilate(paper, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (15, 15)))
    sides = [cell * len(grown) // 32] * 2
    light = cv2.resize(grown, sides, interpolation=cv2.INTER_AREA) / 255
    gray = cv2.GaussianBlur(150 + 180 * light, (0, 0), cell / 10)
    noise = np.random.default_rng(5).normal(0, 1.5, gray.shape)
    return np.clip(gray + noise, 0, 255).astype(np.uint8)


@pytest.mark.parametrize('cell', [6, 8, 12])
def test_markers_whose_paper_is_washed_out(cell: int) -> None:
    detect = create_detector(family='apriltag_36h11')
    read = [[it.id for it in detect(washed_out(number, cell))] for number in (6, 7, 100, 300)]
    assert read == [[6], [7], [100], [300]]


def test_soft_markers_are_read_where_an_image_is_enlarged() -> None:
    """What a half shows of a soft marker, a half of the half shows of one that is larger."""
    detect, read = create_detector(family='apriltag_36h11'), np.zeros(2, int)
    for seed in (2, 5, 6):
        shown = scene('apriltag_36h11', targets=12, dot_radius=4.0, blur=1.0, seed=seed)
        image = cv2.blur(shown.image, (4, 1))
        larger = cv2.resize(image, None, fx=3, fy=3, interpolation=cv2.INTER_CUBIC)
        ids = {it.id for it in shown.targets}
        read += [len(ids & {it.id for it in detect(of)}) for of in (image, larger)]
    assert read.min() > 15


@pytest.mark.parametrize('gray', [0, 90, 255])
def test_a_covered_marker_is_read(gray: int) -> None:
    shown = scene(family='apriltag_36h11')
    image = shown.image.copy()
    for target in shown.targets:
        side = target.semi_major * 0.5
        image[around(target.x, target.y + 0.9 * side, 0.35 * side)] = gray
    assert counted(shown, create_detector(family='apriltag_36h11')(image)) == (6, 0, 0)


def test_no_marker_less_than_apriltag_finds_and_better_centres() -> None:
    pytest.importorskip('pupil_apriltags')
    found = readers()
    shown = scene(family='apriltag_36h11')
    ours, theirs = (score(shown, found[name](shown.image)) for name in ('ahf', 'pupil-apriltags'))
    assert ours.right == 6 >= theirs.right
    assert ours.wrong == ours.false_positives == 0
    assert ours.rmse[2] < theirs.rmse[2]


def test_markers_of_another_dictionary_are_not_seen() -> None:
    shown = scene()
    assert create_detector(family='aruco_7x7_50')(shown.image) == []


@pytest.mark.parametrize('family', [FAMILY, 'apriltag_36h11'])
@pytest.mark.parametrize(
    ('light', 'ambient'),
    [
        *(('stripe', 0.04), ('lattice', 0.04), ('shadow', 0.04)),
        *(('fine_stripe', 0.12), ('dense_lattice', 0.12)),
    ],
)
def test_no_filter_is_needed_where_light_changes_by_more_than_ink(
    light: str, ambient: float, family: str
) -> None:
    """Paper in shadow is darker than ink in light: steps between cells show the markers."""
    size = {'width': 1400, 'height': 1000, 'targets': 24, 'dot_radius': 16.0}
    shown = scene(family, **size, light=light, ambient=ambient, seed=1004)
    right, wrong, false = counted(shown, create_detector(family=family)(shown.image))
    assert right >= 22
    assert wrong == false == 0


@pytest.mark.parametrize('light', ['stripe', 'lattice'])
def test_light_may_change_within_markers_by_less_than_ink(light: str, detect: Detector) -> None:
    """Paper in shadow is darker than paper in light by far, but brighter than any ink."""
    size = {'width': 1600, 'height': 1200, 'targets': 20, 'dot_radius': 24.0}
    shown = scene(**size, distractors=8, light=light, ambient=0.12, seed=1003)
    right, wrong, false = counted(shown, detect(shown.image))
    assert right >= 17
    assert wrong == false == 0


@pytest.mark.parametrize(('seed', 'radius'), [(901, 16.0), (902, 24.0)])
def test_paper_in_shadow_makes_no_border_wider(seed: int, radius: float) -> None:
    family = 'apriltag_16h5'
    size = {'width': 1600, 'height': 1200, 'targets': 20, 'dot_radius': radius}
    shown = scene(family, **size, light='lattice', ambient=0.12, seed=seed)
    found = create_detector(family=family)(shown.image)
    places = {it.id: (it.x, it.y) for it in shown.targets}
    assert len(found) >= 16
    assert {it.border for it in found} == {1}
    assert max(np.hypot(*np.subtract((it.x, it.y), places[it.id])) for it in found) < 0.1


@pytest.mark.parametrize('light', ['stripe', 'lattice', 'fringe'])
def test_places_are_those_of_the_image_as_received(light: str, detect: Detector) -> None:
    shown = scene(light=light, ambient=0.3)
    found = identify(shown.image, detector=detect, expected_targets=6)
    assert counted(shown, found) == (6, 0, 0)
    assert score(shown, found).rmse[2] < 0.08
    again = detect.refine(shown.image, found.targets)
    for one, other in zip(found.targets, again, strict=True):
        assert (other.x, other.y) == pytest.approx((one.x, one.y), abs=0.02)


def test_corners_and_ellipse_are_those_of_the_marker(detect: Detector) -> None:
    shown = scene()
    true = {target.id: target for target in shown.targets}
    for target in detect(shown.image):
        assert target.semi_major == pytest.approx(true[target.id].semi_major, rel=0.03)
        assert target.semi_minor == pytest.approx(true[target.id].semi_minor, rel=0.03)
        corners = np.array(target.corners)
        sides = np.roll(corners, -1, axis=0) - corners
        assert np.hypot(*sides.T) == pytest.approx(np.full(4, 2 * target.semi_major), rel=0.15)
        across, down = sides[:2]
        assert across[0] * down[1] > across[1] * down[0]  # clockwise as seen, y pointing down


@pytest.mark.parametrize(('wave', 'fitted'), [(15, True), (7, False)])
def test_what_neither_edges_nor_print_fit_states_its_error(
    wave: float, fitted: bool, detect: Detector
) -> None:
    """On wavy paper edges are off by more than the image tells; short waves leave none."""
    shown = scene(targets=16, dot_radius=12.0)
    places = np.array([(it.x, it.y) for it in shown.targets])
    y, x = np.mgrid[: shown.image.shape[0], : shown.image.shape[1]].astype(np.float32)
    moved = x - 2 * np.sin(y / wave), y - 2 * np.sin(x / wave)
    there = places
    for _ in range(50):
        there = places + 2 * np.sin(there[:, ::-1] / wave)
    true = dict(zip([it.id for it in shown.targets], there, strict=True))
    image = cv2.remap(shown.image, *moved, cv2.INTER_CUBIC)
    those = [it for it in detect(image) if (it.edge_shift is not None) == fitted]
    assert len(those) >= 4
    errors = np.array([(it.x, it.y) - true[it.id] for it in those])
    squares = (errors**2).sum(axis=1) / [it.covariance[0] for it in those]
    assert 0.3 < squares.mean() / 2 < 2
    assert squares.max() < 12


def test_what_has_no_corners_or_no_sides_stays_where_it_is(detect: Detector) -> None:
    shown = scene()
    markers = detect(shown.image)
    others = [Target(1, 1, 50.0, 60.0, 5.0, 5.0), Target(2, 2, -900.0, 60.0, 5.0, 5.0)]
    assert detect.refine(shown.image, others) == others
    none = [replace(it, corners=((5.0, 5.0),) * 4) for it in markers]
    assert detect.refine(shown.image, none) == none
    plain = np.tile(np.arange(1000, dtype=np.uint8), (750, 1))
    assert detect.refine(plain, markers) == markers
    assert detect.refine(shown.image, []) == []


def test_any_kind_of_image(detect: Detector) -> None:
    shown = scene()
    same = detect(shown.image)
    for image in (shown.image.astype(np.uint16) * 16, shown.image[:, ::-1][:, ::-1]):
        assert [target.id for target in detect(image)] == [it.id for it in same]
