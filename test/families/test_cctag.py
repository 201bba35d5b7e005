"""CCTags are identified, and nothing else is."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from ahf_ros.base.target import Target
from ahf_ros.families import create_detector
from ahf_ros.families.cctag.light import EDGES, Lights
from ahf_ros.prints import CCTAG_NAMES
from ahf_ros.prints.cctag import circle_family
from ahf_ros.scenes.scene import Rendering
from support.pictures.textures import lookalikes, textured_image
from support.scenes import counted, errors, rendering

SIZE = {'width': 560, 'height': 420, 'targets': 4, 'dot_radius': 14.0, 'seed': 2}


def scene(family: str = 'cctag3', **changes: object) -> Rendering:
    return rendering(**SIZE | {'family': family} | changes)


@cache
def identified(family: str = 'cctag3', **changes: object) -> list[Target]:
    return create_detector(family=family)(scene(family, **changes).image)


STRIPES = {'light': 'stripe', 'ambient': 0.3}
USUAL = [
    ('cctag3', {}, 0.02),
    ('cctag3', {**STRIPES, 'dot_radius': 20.0, 'targets': 3, 'seed': 3}, 0.008),
    ('cctag3', {'edge_shift': 0.5, 'dot_radius': 12.0}, 0.03),  # much of a ring
]
SHAPES = [
    ('cctag4', {}, 0.02),
    ('cctag3', {'polarity': 'bright'}, 0.02),
    ('cctag3', {'dot_radius': 10.0}, 0.03),
    ('cctag3', {'dot_radius': 60.0, 'targets': 2}, 0.02),
    ('cctag3', {'tilt': 40.0, 'dot_radius': 20.0, 'targets': 3}, 0.03),
    ('cctag3', {'blur': 2.0, 'dot_radius': 30.0, 'targets': 3}, 0.03),
    ('cctag3', {'edge_shift': -0.5, 'dot_radius': 24.0, 'targets': 3}, 0.03),
]


@pytest.mark.parametrize(
    ('family', 'changes', 'limit'),
    [*USUAL, *(pytest.param(*it, marks=pytest.mark.lasting) for it in SHAPES)],
)
def test_targets_are_identified_where_they_are(family: str, changes: dict, limit: float) -> None:
    shown, found = scene(family, **changes), identified(family, **changes)
    count = len(shown.targets)
    assert counted(shown, found) == (count, 0, 0)
    assert np.sqrt((errors(shown, found) ** 2).mean()) < limit
    assert all(target.code == target.id and target.family == family for target in found)


@pytest.mark.lasting
def test_targets_are_read_out_of_focus() -> None:
    shown = scene(dot_radius=60.0, targets=4, width=760, height=640, seed=3)
    radii = np.hypot(*np.mgrid[-7:8, -7:8])
    disc = np.clip(5.5 - radii, 0, 1)
    image = cv2.filter2D(shown.image, -1, disc / disc.sum())
    assert counted(shown, create_detector(family='cctag3')(image)) == (4, 0, 0)


@pytest.mark.lasting
@pytest.mark.parametrize(('radius', 'blur', 'seed'), [(80.0, 4.8, 5), (130.0, 8.45, 4)])
def test_large_rings_that_blur_nearly_hides_are_read(
    radius: float, blur: float, seed: int
) -> None:
    side = round(5.5 * radius)
    shown = scene(dot_radius=radius, blur=blur, width=side, height=side, targets=1, seed=seed)
    assert counted(shown, create_detector(family='cctag3')(shown.image)) == (1, 0, 0)


def drawing(number: int, radius: float, side: int) -> np.ndarray:
    """Return a drawing, in whose middle is a target of `cctag3`."""
    fine, image = 64, np.full((side, side), 255, np.uint8)
    centre, radii = round((side - 1) / 2 * fine), circle_family('cctag3').radii(np.array([number]))
    for index, of in enumerate(radii[0]):
        size, ink = round(of * radius * fine), 0 if index % 2 == 0 else 255
        cv2.circle(image, (centre, centre), size, ink, -1, cv2.LINE_AA, 6)
    return image


@pytest.mark.lasting
@pytest.mark.parametrize(
    ('number', 'radius', 'side'),
    [(0, 434.31, 1216), (0, 447.17, 1252), (11, 1017.0, 2951), (11, 1081.0, 3135)],
)
def test_large_targets_are_placed_by_their_edges(number: int, radius: float, side: int) -> None:
    (found,) = create_detector(family='cctag3')(drawing(number, radius, side))
    assert found.id == number
    assert (found.x, found.y) == pytest.approx(((side - 1) / 2,) * 2, abs=0.02)


@pytest.mark.lasting
def test_large_targets_that_are_out_of_focus_stay_where_they_are_sharp() -> None:
    image = cv2.GaussianBlur(drawing(4, 500.0, 1450), (0, 0), 20.0)
    noise = np.random.default_rng(1).normal(0, 2, image.shape)
    image = np.clip(40 + 0.6 * image + noise, 0, 255).round().astype(np.uint8)
    (found,) = create_detector(family='cctag3')(image)
    away = np.array([found.x, found.y]) - 1449 / 2
    assert found.id == 4
    assert np.abs(away).max() < 0.15
    assert away @ np.linalg.inv(np.reshape(found.covariance, (2, 2))) @ away < 9


@pytest.mark.lasting
@pytest.mark.parametrize('family', CCTAG_NAMES)
def test_small_targets_are_found_in_stripes(family: str) -> None:
    small = {**STRIPES, 'dot_radius': 12.0, 'targets': 6}
    shown, found = scene(family, **small), identified(family, **small)
    assert counted(shown, found) == (6, 0, 0)
    assert np.abs(errors(shown, found)).max() < 0.3


@pytest.mark.lasting
def test_the_growth_of_ink_is_reported() -> None:
    shown = scene(edge_shift=0.4, gamma=1.0, dot_radius=20.0, targets=3)
    found = create_detector(family='cctag3')(shown.image)
    assert [target.edge_shift for target in found] == pytest.approx([0.4] * 3, abs=0.1)


@pytest.mark.lasting
@pytest.mark.parametrize('family', ['metashape12', 'aicon14', 'dots'])
@pytest.mark.parametrize('light', ['normal', 'lattice'])
def test_targets_of_other_families_are_none(family: str, light: str) -> None:
    shown = scene(
        family, width=420, height=320, dot_radius=8.0, targets=2, light=light, ambient=0.3
    )
    assert create_detector(family='cctag3,cctag4')(shown.image) == []


@pytest.mark.lasting
@pytest.mark.parametrize('seed', [312, 320])
def test_rings_in_rings_are_none(seed: int) -> None:
    assert create_detector(family='cctag3,cctag4')(lookalikes(seed)) == []


@pytest.mark.lasting
def test_both_families_are_read_in_one_search() -> None:
    three, four = (scene(family, width=360, height=280, targets=2) for family in CCTAG_NAMES)
    both = np.hstack([three.image, four.image])
    detector = create_detector(family='cctag3,cctag4')
    assert detector.name == 'cctag'
    found = detector(both)
    assert sorted((it.family, it.id) for it in found) == sorted(
        (name, it.id)
        for name, of in zip(CCTAG_NAMES, (three, four), strict=True)
        for it in of.targets
    )
    moved = [replace(target, x=target.x + 0.3) for target in found]
    places = [[(it.x, it.y) for it in of] for of in (found, detector.refine(both, moved))]
    assert np.array(places[1]) == pytest.approx(np.array(places[0]), abs=0.05)
    alone = create_detector(family='cctag4')(both)
    assert alone == [it for it in found if it.family == 'cctag4']


@pytest.mark.lasting
def test_refinement_finds_the_place_again() -> None:
    shown = scene()
    moved = [replace(target, x=target.x + 0.5, y=target.y - 0.4) for target in identified()]
    refined = create_detector(family='cctag3').refine(shown.image, moved)
    assert len(refined) == 4
    assert np.abs(errors(shown, refined)).max() < 0.05


@pytest.mark.lasting
def test_letters_that_are_read_as_one_id_in_many_places_are_texture() -> None:
    letters = textured_image(501)[340:400, :320]
    assert create_detector(family='cctag4')(letters) == []


def test_images_without_circles_have_no_targets() -> None:
    slope = np.broadcast_to(np.linspace(60, 200, 120), (90, 120)).astype(np.uint8)
    for bounds in ({}, {'min_radius': 100.0, 'max_radius': 200.0}):
        assert create_detector(family='cctag3, cctag4', **bounds)(slope) == []


@pytest.mark.lasting
def test_texture_is_read_no_longer_than_it_may_have_a_target(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    read: list[int] = []

    def counted(gray: np.ndarray, frames: np.ndarray, most: int = EDGES) -> Lights:
        read.append(len(frames))
        return about(gray, frames, most)

    noise = np.random.default_rng(1).normal(size=(700, 900))
    soft = cv2.GaussianBlur(noise, (0, 0), 1.5)
    image = np.clip(120 + 45 * soft / soft.std(), 0, 255).astype(np.uint8)
    about = Lights.about
    monkeypatch.setattr(Lights, 'about', counted)
    assert create_detector(family='cctag4')(image) == []
    assert 0 < read[0] < 2 * 32  # as not all show the same all around
    assert sum(read) <= 6 * 32  # of two colours in three octaves
