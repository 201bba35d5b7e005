"""Each promise of `Target` and of the settings, on the same scenes for every kind of family."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from ahf_ros import SceneSettings, UndecodedTarget, create_detector, identify, render
from ahf_ros.base.target import UNDECODED, SquareMarker, Target
from ahf_ros.prints.square import words
from ahf_ros.scenes.evaluation import score
from ahf_ros.scenes.scene import Rendering
from support.square_markers import needs_square_markers

# How far its print reaches from the centre of a target, in its radius, and where its code is.
KINDS = {
    'metashape20': (3.2, (1.4, 3.1)),
    'cct12': (3.2, (1.4, 3.1)),
    'gsi': (13.0, (3.0, 9.0)),
    'dots': (4.6, (1.35, 2.55)),
    'cctag3': (1.2, (0.0, 0.62)),
    'aruco_4x4_50': (1.6, (0.0, 0.66)),
    'apriltag_36h11': (1.6, (0.0, 0.72)),
}
PLAIN = {'width': 1200, 'height': 900, 'targets': 6, 'radius_spread': 0.0, 'seed': 3}
# Scenes in which some targets of a family are hardly read.
STRIPES = {'dot_radius': 12.0, 'light': 'stripe', 'ambient': 0.1}
DOUBTFUL: dict[str, dict[str, Any]] = {
    'metashape20': {'dot_radius': 5.0, 'light': 'stripe', 'ambient': 0.1},
    'cct12': {'dot_radius': 5.0, 'light': 'stripe', 'ambient': 0.1},
    'gsi': {'dot_radius': 2.5, 'light': 'lattice', 'ambient': 0.3},
    'dots': {'dot_radius': 5.0, 'light': 'lattice', 'ambient': 0.1},
    'cctag3': {'dot_radius': 8.0, 'blur': 1.0, 'targets': 3},
    'aruco_4x4_50': STRIPES,
    'apriltag_36h11': STRIPES,
}
EVERY = pytest.mark.parametrize(
    'family',
    [
        pytest.param(it, marks=needs_square_markers if it.startswith(('aruco', 'april')) else ())
        for it in KINDS
    ],
)


@cache
def scene(family: str, **changes: Any) -> Rendering:
    large = family.startswith(('cctag', 'aruco', 'apriltag'))
    size: dict[str, Any] = {'dot_radius': 24.0 if large else 8.0}
    if family == 'cctag3':  # whose light takes long to tell from rings
        size |= {'width': 640, 'height': 480, 'targets': 3, 'dot_radius': 20.0}
    return render(SceneSettings(family=family, **{**PLAIN, **size, **changes}))


def near(targets: list[Target] | tuple[Target, ...], place: Target) -> list[Target]:
    return [it for it in targets if np.hypot(it.x - place.x, it.y - place.y) < 5]


def damaged(shown: Rendering, victim: Target, family: str) -> np.ndarray:
    """Return an image in which the code of a target is painted over, and nothing else."""
    image = shown.image.copy()
    inner, outer = (of * victim.semi_minor for of in KINDS[family][1])
    y, x = np.indices(image.shape)
    away = np.hypot(x - victim.x, y - victim.y)
    image[(away > inner) & (away < outer)] = np.median(image[away < outer + 9])
    return image


@EVERY
@pytest.mark.parametrize('grown', [-0.3, 0.0, 0.6])
def test_the_edge_shift_is_the_growth_of_ink_in_light(family: str, grown: float) -> None:
    shown = scene(family, edge_shift=grown)
    found = identify(shown.image, family=family).targets
    assert len(found) == len(shown.targets)
    shifts = [it.edge_shift for it in found]
    assert np.median(shifts) == pytest.approx(grown, abs=0.06)
    assert shifts == pytest.approx([grown] * len(found), abs=0.2)


@EVERY
def test_size_and_direction_are_those_of_the_print(family: str) -> None:
    shown = scene(family, edge_shift=0.6, tilt=40.0)
    true = {it.id: it for it in shown.targets}
    found = identify(shown.image, family=family).targets
    assert len(found) == len(true)
    for target in found:
        own = true[target.id]
        assert target.semi_major == pytest.approx(own.semi_major, rel=0.04)
        assert target.semi_minor == pytest.approx(own.semi_minor, rel=0.04)
        assert np.cos(2 * (target.angle - own.angle)) > 0.99
        assert (target.code, target.family) == (own.code, family)


@EVERY
def test_what_is_not_decoded_says_why_and_is_reported_on_demand_alone(family: str) -> None:
    shown = scene(family)
    height, width = shown.image.shape
    victim = min(shown.targets, key=lambda it: np.hypot(it.x - width / 2, it.y - height / 2))
    image = damaged(shown, victim, family)
    found = identify(image, family=family).targets
    assert {it.id for it in found} == {it.id for it in shown.targets} - {victim.id}
    every = identify(image, family=family, report_undecoded=True).targets
    assert [it.key for it in every if it.id != UNDECODED] == [it.key for it in found]
    others = [it for it in every if it.id == UNDECODED]
    assert all(isinstance(it, UndecodedTarget) for it in others)
    reach = KINDS[family][0] * victim.semi_major
    at = [it for it in others if np.hypot(it.x - victim.x, it.y - victim.y) < reach]
    assert at or family == 'cctag3'  # its code is all of its print: what is left is no target
    for target in at:
        assert isinstance(target, UndecodedTarget)
        assert (target.code, target.family) == (0, '')
        assert target.reason in ('unread', 'uncertain')
        assert (target.likely_family == '') == (target.likely_id == UNDECODED)


def twice(shown: Rendering, family: str) -> tuple[np.ndarray, Target]:
    """Return an image in which one target takes the place of another as well, and that target."""
    image = shown.image.copy()
    half = int(KINDS[family][0] * shown.targets[0].semi_major)
    inside = [
        it
        for it in shown.targets
        if half < it.x < image.shape[1] - half and half < it.y < image.shape[0] - half
    ]
    first, second = inside[:2]
    parts = [
        np.s_[int(it.y) - half : int(it.y) + half, int(it.x) - half : int(it.x) + half]
        for it in (first, second)
    ]
    image[parts[1]] = image[parts[0]]
    return image, first


@EVERY
def test_of_two_that_are_sure_of_an_id_none_has_it_unless_both_are_markers(family: str) -> None:
    image, own = twice(scene(family, sizes='1'), family)
    found = identify(image, family=family, report_undecoded=True)
    holders = [it for it in found.targets if it.id == own.id]
    if holders:
        # Square markers are printed in numbers: their readers report each.
        assert all(isinstance(it, SquareMarker) for it in holders)
        assert len(holders) == 2
        return
    contested = [it for it in found.targets if isinstance(it, UndecodedTarget)]
    contested = [it for it in contested if it.reason == 'contested']
    assert [it.likely_id for it in contested] == [own.id] * 2
    assert list(found.repeated) == contested
    assert not near(identify(image, family=family).targets, own)


@EVERY
def test_expected_ids_make_nothing_of_clear_ids(family: str) -> None:
    shown = scene(family)
    every = frozenset(it.id for it in shown.targets)
    detector = create_detector(family=family)
    plain = detector(shown.image)
    assert [it.id for it in detector.expecting(every)(shown.image)] == [it.id for it in plain]
    others = frozenset(sorted(every)[:2])
    assert [it.id for it in detector.expecting(others)(shown.image)] == [it.id for it in plain]


@EVERY
def test_expected_ids_lose_no_target_in_doubt(family: str) -> None:
    shown = scene(family, **DOUBTFUL[family])
    detector = create_detector(family=family)
    without = score(shown, detector(shown.image))
    expected = frozenset(it.id for it in shown.targets)
    known = score(shown, detector.expecting(expected)(shown.image))
    assert (known.wrong, known.false_positives) == (0, 0)
    assert known.right >= without.right
    assert known.right > without.right or family != 'dots'


@needs_square_markers
def test_an_expected_marker_wins_a_draw() -> None:
    cells = words('aruco_4x4_50')
    turned = np.array([np.rot90(of, turn) for of in cells for turn in range(4)])
    differing = (turned != cells[3]).sum(axis=(1, 2))
    differing[12:16] = 99  # turns of the same marker
    rival = int(differing.argmin())
    cell = 16
    image = np.full((240, 240), 220, np.uint8)
    image[48:144, 48:144] = np.pad(cells[3], 1).repeat(cell, 0).repeat(cell, 1) * 180 + 40
    for row, column in np.argwhere(turned[rival] != cells[3]):
        top, left = 64 + cell * row, 64 + cell * column
        image[top : top + cell, left : left + cell] = 94  # half-way in the logarithm
    detector = create_detector(family='aruco_4x4_50')
    assert not [it for it in detector(image) if it.id in (3, rival // 4)]
    for number in (3, rival // 4):
        assert [it.id for it in detector.expecting(frozenset({number}))(image)] == [number]
