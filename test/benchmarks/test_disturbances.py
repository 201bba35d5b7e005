"""The benchmark of disturbances: its sheets, what covers them, and its tables."""

from pathlib import Path

import numpy as np
import pytest

from ahf_ros.base.target import Target, TrueTarget
from ahf_ros.prints.ring import FAMILY_NAMES, family
from ahf_ros.prints.square import SQUARE_NAMES
from benchmarks import disturbances
from support.pictures import occluders
from support.pictures.disturbed import Targets, overlapping
from support.pictures.exposure import Cell, Exposure, Occluder
from support.pictures.lookalikes import LOOKALIKES, other_sectors, other_words
from support.pictures.sheets import CELL, cell_pixels, mark_sheet, random_numbers, target_sheet

RADIUS = 12.0


ALONG = np.linspace(-CELL, CELL, 601, dtype=np.float32)
PLACE = Cell(*np.meshgrid(ALONG, ALONG[::-1]), 0.3, 12, 2.25, 3.5, float(ALONG[1] - ALONG[0]))
DISTANCE = np.hypot(PLACE.x, PLACE.y)
PHASE = (np.arctan2(PLACE.y, PLACE.x) - PLACE.turn) * 12 / (2 * np.pi)
SECTOR = np.floor(PHASE).astype(int) % 12


def drawn(occluder: Occluder, seed: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Return which share of a cell something covers, and how gray it is."""
    return occluder(PLACE, np.random.default_rng(seed))


@pytest.mark.parametrize('name', ['metashape12', 'aicon14', 'aruco_4x4_50'])
def test_the_truth_is_where_the_marks_are(name: str) -> None:
    sheet = target_sheet(name, np.array([5, 6, 7]), 1, columns=2)
    image = 220.0 - sheet.photograph(Exposure())
    side = cell_pixels(RADIUS)
    assert image.shape == (2 * side, 2 * side)
    assert [target.id for target in sheet.truth] == [5, 6, 7]
    for index, target in enumerate(sheet.truth):
        row, column = divmod(index, 2)
        assert abs(target.x - (column + 0.5) * side) < 1.5
        assert abs(target.y - (row + 0.5) * side) < 1.5
    if name not in SQUARE_NAMES:
        rows, columns = np.mgrid[:side, :side]
        first = sheet.truth[0]
        dot = np.hypot(columns - first.x, rows - first.y) < 1.5 * RADIUS
        weight = np.maximum(image[:side, :side][dot], 0)
        assert np.average(columns[dot], weights=weight) == pytest.approx(first.x, abs=0.1)
        assert np.average(rows[dot], weights=weight) == pytest.approx(first.y, abs=0.1)


@pytest.mark.parametrize('name', ['aicon12', 'cct12'])
def test_targets_on_others_have_words_of_their_own(name: str) -> None:
    """IDs of `cct12` are words, not counted from 1."""
    [below] = random_numbers(name, 6, 3)
    _, truth = overlapping(name, below, 3, 4.0)
    shown = [it.id for it in truth]
    assert (shown[:6], len(set(shown))) == (below.tolist(), 12)
    assert set(shown) <= set(family(name).numbers.tolist())


def test_a_sheet_is_the_same_every_time_and_another_one_with_another_seed() -> None:
    exposure = Exposure(occluder=occluders.over_sectors(2, 128.0))
    first, again, other = (
        target_sheet('aicon12', np.arange(1, 4), seed, columns=3).photograph(exposure)
        for seed in (1, 1, 2)
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_no_target_is_twice_on_a_sheet() -> None:
    for name in ('metashape12', 'aruco_4x4_50'):
        sheets = random_numbers(name, 100, 1)
        assert sum(map(len, sheets)) == 100
        assert all(len(set(numbers)) == len(numbers) and 0 not in numbers for numbers in sheets)


def test_levels_are_those_asked_for() -> None:
    sheet = target_sheet('metashape12', np.array([1]), 1)
    image = sheet.photograph(Exposure(levels=(130.0, 120.0, 0.5)))
    target = sheet.truth[0]
    assert np.median(image) == pytest.approx(130, abs=8)  # the light is not quite even
    inside = image[round(target.y) + 4, round(target.x) - 4 : round(target.x) + 5]
    assert np.median(image) - np.median(inside) == pytest.approx(10, abs=1.5)


def test_bright_targets_are_dark_ones_inverted() -> None:
    exposure = Exposure(levels=(200.0, 100.0, 0.0))
    dark, bright = (
        target_sheet('aicon12', np.array([9]), 1, bright=bright).photograph(exposure)
        for bright in (False, True)
    )
    assert np.corrcoef(dark.ravel(), bright.ravel())[0, 1] < -0.9


@pytest.mark.parametrize('whole', [False, True])
def test_a_wedge_covers_its_sectors_and_nothing_else(whole: bool) -> None:
    share, gray = drawn(occluders.over_sectors(2, 99.0, whole=whole))
    assert gray == 99.0
    assert share[DISTANCE < 1.15].max() == 0
    band = (DISTANCE > 2.3) & (DISTANCE < 3.4)
    assert share[band].mean() == pytest.approx(2 / 12, abs=0.01)
    if whole:
        shares = np.array([share[band & (index == SECTOR)].mean() for index in range(12)])
        assert (shares > 0.97).sum() == 2
        assert (shares < 0.03).sum() == 10


def test_paper_and_finger_and_disc_reach_as_far_as_they_should() -> None:
    (paper, _), (disc, _), (finger, _) = map(
        drawn, (occluders.paper(2.0, 0.0), occluders.disc(1.0, 0.0), occluders.finger(2.0, 0.0))
    )
    assert DISTANCE[paper > 0.5].min() == pytest.approx(2.0, abs=0.02)
    assert DISTANCE[disc > 0.5].min() == pytest.approx(2.875 - 1, abs=0.02)
    assert disc.sum() * PLACE.width**2 == pytest.approx(np.pi, rel=0.01)
    assert 1.15 < DISTANCE[finger > 0.5].min() < 2.1


def test_dirt_covers_a_little_of_the_target_and_hides_ink_and_paper() -> None:
    sizes = (1 / RADIUS, 3 / RADIUS)
    for occluder, least, most in (
        (occluders.specks(40, sizes), 0.01, 0.035),
        (occluders.scratches(6, sizes), 0.1, 0.4),
    ):
        share, gray = drawn(occluder, 4)
        inside = DISTANCE < 3.5
        assert least < share[inside].mean() < most
        assert np.ptp(gray[share > 0.5]) > 100  # some is bright, some dark
    share, _ = drawn(occluders.specks(40, sizes), 4)
    assert DISTANCE[share > 0].max() < 4


def test_a_highlight_is_brightest_on_the_band() -> None:
    added = occluders.highlight(1.0, 200.0)(PLACE, np.random.default_rng(3))
    assert added.max() == pytest.approx(200, abs=1)
    assert DISTANCE.ravel()[added.argmax()] == pytest.approx(2.875, abs=0.03)


def test_look_alikes_are_no_codewords() -> None:
    generator = np.random.default_rng(1)
    for name in FAMILY_NAMES:
        for kind in LOOKALIKES.values():
            inks = [kind(family(name), generator) for _ in range(2)]
            assert mark_sheet(inks, 1).photograph(Exposure()).min() < 100
    code = family('metashape12')
    jacobian = np.eye(2, dtype=np.float32) * PLACE.width
    middle = (DISTANCE > 2.4) & (DISTANCE < 3.3) & (np.abs(PHASE % 1 - 0.5) < 0.4)
    for draw in (other_words, other_sectors):
        for _ in range(20):
            ink = draw(code, generator)(PLACE.turn)(PLACE.x, PLACE.y, jacobian)
            shares = np.array([ink[middle & (index == SECTOR)].mean() for index in range(12)])
            whole = ((shares < 0.02) | (shares > 0.98)).all()
            word = int((shares > 0.5) @ (1 << np.arange(12)))
            assert not whole or code.number(word) is None


def test_every_row_has_scenes_with_the_targets_of_the_family() -> None:
    for name in ('metashape16', 'aruco_4x4_50'):
        rows = dict(Targets(name, 2, 1).rows())
        assert len(rows) >= 50
    rows = dict(Targets('metashape12', 2, 1).rows())
    image, truth = next(rows['mirrored'])
    clean, straight = next(rows['clean'])
    assert np.array_equal(image[:, ::-1], clean)
    assert [target.x for target in truth] == pytest.approx(
        [image.shape[1] - 1 - target.x for target in straight]
    )


def test_rows_that_are_cut_have_the_border_at_its_distance() -> None:
    rows = dict(Targets('metashape12', 30, 1).rows())
    sides = set()
    for image, truth in rows['border of the image 2.6 dot radii away']:
        height, width = image.shape
        for target in truth:
            gaps = (target.x, target.y, width - 1 - target.x, height - 1 - target.y)
            assert min(gaps) + 0.5 == pytest.approx(2.6 * RADIUS, abs=1.05)
            sides.add(int(np.argmin(gaps)))
    assert len(sides) == 4


def test_counts_say_what_is_certain_and_wrong() -> None:
    count = disturbances.Count()
    truth = [TrueTarget(1, 10.0, 10.0), TrueTarget(2, 50.0, 10.0)]
    targets = [
        Target(1, 71, 10.2, 10.0, 5, 5),
        Target(3, 77, 50.0, 10.0, 5, 5, confidence=0.995),
        Target(4, 83, 90.0, 10.0, 5, 5, confidence=0.985),
    ]
    count.add(truth, targets)
    assert (count.expected, count.right, count.wrong, count.false) == (2, 1, 1, 1)
    assert (count.above(0.9), count.above(0.99)) == (2, 1)
    assert str(count) == '1 / 1 + 1 (1)'


def test_tables_of_a_few_targets(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    arguments = ['--tables', 'disturbances', '--families', 'metashape12', '--count', '6']
    arguments += ['--rows', 'clean', 'border', '--json', str(tmp_path / 'table.json')]
    assert disturbances.main(arguments) == 0
    lines = capsys.readouterr().out.splitlines()
    assert '| clean | 6 / 0 |' in lines
    assert len(lines) == 6
    assert (tmp_path / 'table.json').stat().st_size > 100
