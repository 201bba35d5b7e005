"""Overlays: the image stays, each target gets the colour of what it is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ahf_ros.drawing.colours import (
    DECODED_COLOUR,
    DOUBTFUL_COLOUR,
    MISSED_COLOUR,
    UNDECODED_COLOUR,
    WRONG_COLOUR,
)
from ahf_ros.drawing.overlay import Label, draw, overlay, place_labels, summary
from ahf_ros.drawing.tiles import Tile, side_by_side
from ahf_ros.target import (
    UNDECODED,
    FilterState,
    Identification,
    SquareMarker,
    Target,
    UndecodedTarget,
)

GRAY = np.full((240, 320), 120, np.uint8)


def target(number: int, x: float = 160.0, y: float = 140.0) -> Target:
    return Target(number, 0, x, y, 20.0, 12.0, 0.3)


def shown(image: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """Return where the image has about that colour; lines are smooth."""
    return np.abs(image.astype(int) - colour).max(axis=2) < 60


def test_the_image_stays_where_nothing_is_drawn():
    drawn = draw(GRAY, Identification((target(7),)))
    assert (drawn.shape, drawn.dtype) == ((240, 320, 3), np.uint8)
    assert (drawn[180:] == 120).all()
    assert (drawn[120:160, 130:190] != 120).any()
    assert (GRAY == 120).all()


def test_colours_say_what_a_target_is():
    undecoded, wrong, right = target(UNDECODED, 60.0), target(3, 160.0), target(4, 250.0)
    drawn = overlay(GRAY, (undecoded, wrong, right), wrong=[wrong])
    for colour, x in ((UNDECODED_COLOUR, 60), (WRONG_COLOUR, 160), (DECODED_COLOUR, 250)):
        columns = np.flatnonzero(shown(drawn, colour).any(axis=0))
        assert abs(columns.mean() - x) < 20
        assert shown(drawn, colour)[140, x] == (colour != UNDECODED_COLOUR)


def test_a_missed_target_is_crossed_out():
    drawn = overlay(GRAY, (), missed=[target(3)])
    crossed = shown(drawn, MISSED_COLOUR)
    assert crossed[140, 160]
    assert all(crossed[140 + down, 160 + across] for down in (-30, 30) for across in (-30, 30))
    assert not crossed[140, 180:].any()


def test_doubtful_targets_are_dashed_and_have_a_question_mark() -> None:
    uncertain = UndecodedTarget(
        UNDECODED, 0, 160.0, 140.0, 20.0, 12.0, 0.3, 0.4, reason='uncertain', likely_id=7
    )
    for target in (Target(7, 0, 160.0, 140.0, 20.0, 12.0, 0.3, 0.9), uncertain):
        drawn = overlay(GRAY, [target])
        assert not shown(drawn, DECODED_COLOUR).any()
        assert shown(drawn, DOUBTFUL_COLOUR)[100:125, 175:205].any()  # its label
        ring = shown(drawn, DOUBTFUL_COLOUR)[126:155]
        whole = shown(overlay(GRAY, [Target(7, 0, 160.0, 140.0, 20.0, 12.0, 0.3)]), DECODED_COLOUR)
        assert 0.4 * whole[126:155].sum() < ring.sum() < 0.85 * whole[126:155].sum()


def test_labels_hide_no_target_and_no_other_label() -> None:
    places = [(x, y) for y in range(60, 240, 60) for x in range(60, 320, 60)]
    labels = [Label('12', x, y, 22.0, DECODED_COLOUR) for x, y in places]
    placed = place_labels(labels, [(18.0, 11.0)] * len(labels), (240, 320), 2.0)
    boxes = [(left, bottom - 11, left + 18, bottom) for left, bottom in placed]
    for index, (left, top, right, bottom) in enumerate(boxes):
        assert 0 <= left < right <= 320
        assert 0 <= top < bottom <= 240
        for label in labels:
            across = label.x - min(max(label.x, left), right)
            down = label.y - min(max(label.y, top), bottom)
            assert np.hypot(across, down) > 20
        for other in boxes[:index]:
            assert other[0] > right or other[2] < left or other[1] > bottom or other[3] < top


def test_squares_are_drawn_as_squares_with_their_number_beside_them() -> None:
    turned = [(160.0, 20.0), (260.0, 120.0), (160.0, 220.0), (60.0, 120.0)]
    marker = SquareMarker(7, 7, 160.0, 120.0, 71.0, 71.0, corners=tuple(turned))
    drawn = shown(overlay(GRAY, [marker]), DECODED_COLOUR)
    assert all(drawn[round(y), round(x)] for x, y in turned)
    assert not drawn[120 - 71, 160]  # the inscribed circle
    sides = [(210.0, 70.0), (210.0, 170.0), (110.0, 70.0), (110.0, 170.0)]
    outline = np.array([*turned, *sides])
    label = Label('7', 160.0, 120.0, 100.0, DECODED_COLOUR, outline)
    ((left, bottom),) = place_labels([label], [(18.0, 11.0)], (240, 320), 2.0)
    assert np.hypot(left - 210.0, bottom - 70.0) < 8.0


def test_pictures_side_by_side_have_their_text_above_them():
    remarks = [('two', DECODED_COLOUR), ('a word that is much too long ' * 9, WRONG_COLOUR)]
    row = [Tile(GRAY, 'one', remarks), Tile(draw(GRAY, Identification(())), 'a title ' * 40)]
    made = side_by_side([row, row], 160)
    assert (made.shape[1], made.dtype) == (2 * 162, np.uint8)
    above = made[: made.shape[0] // 2 - 122]
    assert shown(above, WRONG_COLOUR)[:, :162].any()
    assert not shown(above, WRONG_COLOUR)[:, 162:].any()
    assert (made[: made.shape[0] // 2] == made[made.shape[0] // 2 :]).all()
    assert (made[made.shape[0] // 2 - 60] == 120).any()


def test_an_undecoded_target_has_no_label():
    drawn, other = (draw(GRAY, Identification((target(it),))) for it in (UNDECODED, 5))
    assert (other[100:125, 175:200] != drawn[100:125, 175:200]).any()
    assert (drawn[100:125, 178:200] == 120).all()


@pytest.mark.parametrize('place', [(2.0, 2.0), (318.0, 238.0), (318.0, 2.0), (-50.0, 900.0)])
def test_targets_at_the_border_keep_their_label_inside(place):
    drawn = draw(GRAY, Identification((target(88, *place),)))
    assert drawn.shape == (240, 320, 3)
    if 0 <= place[0] < 320:
        assert shown(drawn, DECODED_COLOUR).sum() > 40


@pytest.mark.parametrize(
    'image', [GRAY.astype(np.uint16) * 100, np.linspace(0, 1, 76800).reshape(240, 320)]
)
def test_images_of_more_bits_are_scaled(image):
    image[0, 0] = 0
    drawn = draw(image, Identification(()))
    assert drawn.dtype == np.uint8
    assert drawn.max() == 255


def test_lines_grow_with_the_image():
    large = np.full((2656, 3984), 120, np.uint8)
    small, wide = (draw(image, Identification((target(7),))) for image in (GRAY, large))
    assert shown(wide[:240, :320], DECODED_COLOUR).sum() > 1.5 * shown(small, DECODED_COLOUR).sum()


def test_the_summary_says_how_many_and_through_what():
    def told(*given: Any, **named: Any) -> str:
        return summary(Identification((target(7), target(UNDECODED)), *given, **named))

    assert told() == '1 identified, no filter'
    through = FilterState(applied=True, gamma_high=1.2, gamma_low=0.25)
    assert told(54, through) == '1 identified of 54, gamma_high 1.2, gamma_low 0.25'
    missed = '1 identified of 3, missed 6 8, no filter'
    assert told(3, expected_ids=(6, 7, 8)) == missed
    many = told(20, expected_ids=(*range(1, 7), *range(8, 22)))
    assert many.endswith('missed 1 2 3 4 5 6 8 9 10 11 12 13 and 8 others, no filter')
    assert told(54, mirrored=True) == '1 identified of 54, mirrored, no filter'
    assert told(54, estimated=True) == '1 identified of an estimated 54, no filter'


def test_no_size_of_a_target_crashes() -> None:
    for size in (1e-9, 1e3, 65536.0):
        for place in (-65536.0, 0.0, 30.0, 65536.0):
            target = Target(7, 7, place, place, size, size, 0.3)
            drawn = draw(np.full((60, 80), 128, np.uint8), Identification((target,)))
            assert drawn.shape == (60, 80, 3)
