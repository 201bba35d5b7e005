"""Overlays: the image stays, each target gets the colour of what it is."""

from typing import Any

import numpy as np
import pytest

from ahf_ros.base.target import (
    UNDECODED,
    FilterState,
    Identification,
    SquareMarker,
    Target,
    UndecodedTarget,
)
from ahf_ros.scenes.scene import SceneSettings
from ahf_ros.views.drawing import overlay as overlay_module
from ahf_ros.views.drawing.overlay import (
    DECODED_COLOUR,
    DOUBTFUL_COLOUR,
    MISSED_COLOUR,
    UNDECODED_COLOUR,
    WRONG_COLOUR,
    Label,
    draw,
    overlay,
    place_labels,
    summary,
)
from ahf_ros.views.drawing.tiles import Tile, side_by_side
from support.scenes import rendered

GRAY = np.full((240, 320), 120, np.uint8)


def target(number: int, x: float = 160.0, y: float = 140.0) -> Target:
    return Target(number, 0, x, y, 20.0, 12.0, 0.3)


def shown(image: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """Return where the image has about that colour; lines are smooth."""
    return np.abs(image.astype(int) - colour).max(axis=2) < 60


def test_the_image_stays_where_nothing_is_drawn() -> None:
    drawn = draw(GRAY, Identification((target(7),)))
    assert (drawn.shape, drawn.dtype) == ((240, 320, 3), np.uint8)
    assert (drawn[180:] == 120).all()
    assert (drawn[120:160, 130:190] != 120).any()
    assert (GRAY == 120).all()


def test_colours_say_what_a_target_is() -> None:
    undecoded, wrong, right = target(UNDECODED, 60.0), target(3, 160.0), target(4, 250.0)
    drawn = overlay(GRAY, (undecoded, wrong, right), wrong=[wrong])
    for colour, x in ((UNDECODED_COLOUR, 60), (WRONG_COLOUR, 160), (DECODED_COLOUR, 250)):
        columns = np.flatnonzero(shown(drawn, colour).any(axis=0))
        assert abs(columns.mean() - x) < 20
        assert shown(drawn, colour)[140, x] == (colour != UNDECODED_COLOUR)


def test_a_missed_target_is_crossed_out() -> None:
    drawn = overlay(GRAY, (), missed=[target(3)])
    crossed = shown(drawn, MISSED_COLOUR)
    assert crossed[140, 160]
    assert all(crossed[140 + down, 160 + across] for down in (-30, 30) for across in (-30, 30))
    assert not crossed[140, 180:].any()


def test_doubtful_targets_are_dashed_and_have_a_question_mark() -> None:
    place = (160.0, 140.0, 20.0, 12.0, 0.3)
    uncertain = UndecodedTarget(UNDECODED, 0, *place, 0.4, reason='uncertain', likely_id=7)
    whole = shown(overlay(GRAY, [target(7)]), DECODED_COLOUR)[126:155].sum()
    for doubtful in (Target(7, 0, *place, 0.9), uncertain):
        drawn = overlay(GRAY, [doubtful])
        assert not shown(drawn, DECODED_COLOUR).any()
        assert shown(drawn, DOUBTFUL_COLOUR)[100:125, 175:205].any()  # its label
        assert 0.4 * whole < shown(drawn, DOUBTFUL_COLOUR)[126:155].sum() < 0.85 * whole


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
    outline = np.array([*turned, (210, 70), (210, 170), (110, 70), (110, 170)])
    label = Label('7', 160.0, 120.0, 100.0, DECODED_COLOUR, outline)
    ((left, bottom),) = place_labels([label], [(18.0, 11.0)], (240, 320), 2.0)
    assert np.hypot(left - 210.0, bottom - 70.0) < 8.0


def test_pictures_side_by_side_have_their_text_above_them() -> None:
    remarks = [('two', DECODED_COLOUR), ('a word that is much too long ' * 9, WRONG_COLOUR)]
    row = [Tile(GRAY, 'one', remarks), Tile(draw(GRAY, Identification(())), 'a title ' * 40)]
    made = side_by_side([row, row], 160)
    assert (made.shape[1], made.dtype) == (2 * 162, np.uint8)
    above = made[: made.shape[0] // 2 - 122]
    assert shown(above, WRONG_COLOUR)[:, :162].any()
    assert not shown(above, WRONG_COLOUR)[:, 162:].any()
    assert (made[: made.shape[0] // 2] == made[made.shape[0] // 2 :]).all()
    assert (made[made.shape[0] // 2 - 60] == 120).any()


def test_an_undecoded_target_has_no_label() -> None:
    drawn = draw(GRAY, Identification((target(UNDECODED),)))
    other = draw(GRAY, Identification((target(5),)))
    assert (other[100:125, 175:200] != drawn[100:125, 175:200]).any()
    assert (drawn[100:125, 178:200] == 120).all()


@pytest.mark.parametrize('place', [(2.0, 2.0), (318.0, 238.0), (318.0, 2.0), (-50.0, 900.0)])
def test_targets_at_the_border_keep_their_label_inside(place: tuple[float, float]) -> None:
    drawn = draw(GRAY, Identification((target(88, *place),)))
    assert drawn.shape == (240, 320, 3)
    if 0 <= place[0] < 320:
        assert shown(drawn, DECODED_COLOUR).sum() > 40


@pytest.mark.parametrize(
    'image', [GRAY.astype(np.uint16) * 100, np.linspace(0, 1, 76800).reshape(240, 320)]
)
def test_images_of_more_bits_are_scaled(image: Any) -> None:
    image[0, 0] = 0
    drawn = draw(image, Identification(()))
    assert drawn.dtype == np.uint8
    assert drawn.max() == 255


def test_lines_grow_with_the_image() -> None:
    large = np.full((2656, 3984), 120, np.uint8)
    small = shown(draw(GRAY, Identification((target(7),))), DECODED_COLOUR).sum()
    assert shown(draw(large, Identification((target(7),))), DECODED_COLOUR).sum() > 1.5 * small


def test_the_summary_says_how_many_and_through_what() -> None:
    def told(expected: int = 0, *more: FilterState, **values: object) -> str:
        return summary(Identification((target(7), target(UNDECODED)), expected, *more, **values))

    assert told() == '1 identified, no filter'
    through = FilterState(applied=True, gamma_high=1.2, gamma_low=0.25)
    assert told(54, through) == '1 identified of 54, gamma_high 1.2, gamma_low 0.25'
    assert told(3, expected_ids=(6, 7, 8)) == '1 identified of 3, missed 6 8, no filter'
    many = told(20, expected_ids=range(10, 30))
    assert many.endswith('missed 10 11 12 13 14 15 16 17 18 19 20 21 and 8 others, no filter')
    assert told(54, mirrored=True) == '1 identified of 54, mirrored, no filter'
    assert told(54, estimated=True) == '1 identified of an estimated 54, no filter'


def test_no_size_of_a_target_crashes() -> None:
    for size in (1e-9, 1e3, 65536.0):
        for place in (-65536.0, 0.0, 30.0, 65536.0):
            target = Target(7, 7, place, place, size, size, 0.3)
            drawn = draw(np.full((60, 80), 128, np.uint8), Identification((target,)))
            assert drawn.shape == (60, 80, 3)


def test_labels_of_a_dense_scene_stand_at_their_own_targets(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of 150 real targets, side by side, no label lies on a target or on another label."""
    scene = rendered(SceneSettings(width=900, height=650, targets=150, dot_radius=5, seed=3))
    boxes: list[tuple[float, ...]] = []
    named: list[Label] = []

    def placed(labels: Any, sizes: Any, *rest: Any) -> Any:
        corners = place_labels(labels, sizes, *rest)
        for (left, bottom), (width, height) in zip(corners, sizes, strict=True):
            boxes.append((left, bottom - height, left + width, bottom))
        named.extend(labels)
        return corners

    monkeypatch.setattr(overlay_module, 'place_labels', placed)
    overlay(scene.image, scene.targets)
    left, top, right, bottom = np.array(boxes).T
    x, y, radius = np.array([(it.x, it.y, it.radius) for it in named]).T
    across = x[:, None] - np.clip(x[:, None], left, right)
    down = y[:, None] - np.clip(y[:, None], top, bottom)
    beyond = np.hypot(across, down) - radius[:, None]
    assert len(boxes) == 150
    assert beyond.min() > -2.0
    assert np.mean(beyond.argmin(axis=0) == np.arange(150)) > 0.95
    apart = (left[:, None] >= right) | (right[:, None] <= left)
    apart |= (top[:, None] >= bottom) | (bottom[:, None] <= top)
    assert apart.sum() == 150 * 149


def test_a_label_that_has_to_move_has_a_line_to_its_target() -> None:
    label = Label('7', 140.0, 100.0, 12.0, DECODED_COLOUR)
    canvas = np.full((240, 320, 3), 120, np.uint8)
    overlay_module._draw_leader(canvas, label, (190.0, 60.0, 220.0, 70.0), 1)
    line = np.argwhere(shown(canvas, DECODED_COLOUR))
    for end in ((70, 190), (94, 150)):
        assert np.hypot(*(line - end).T).min() < 3.0
    canvas[:] = 120
    overlay_module._draw_leader(canvas, label, (150.0, 80.0, 180.0, 90.0), 1)
    assert not shown(canvas, DECODED_COLOUR).any()
