"""The ring detector: what it reads under which light, what it refuses, and that it is exact."""

from dataclasses import replace
from functools import cache, partial
from itertools import product
from typing import Any

import cv2
import numpy as np
import pytest

from ahf_ros.base.target import UNDECODED, TrueTarget
from ahf_ros.families import DetectorSettings, create_detector
from ahf_ros.families.ring.counting import estimate_count
from ahf_ros.families.ring.detector import find_hypotheses, read_image
from ahf_ros.families.ring.refinement import refine_centres
from ahf_ros.prints.ring import FAMILY_NAMES, family
from ahf_ros.scenes.evaluation import score
from ahf_ros.scenes.scene import SceneSettings
from support.pictures import occluders
from support.pictures.exposure import Exposure
from support.pictures.lookalikes import other_sectors
from support.pictures.sheets import Sheet, mark_sheet, random_numbers, target_sheet
from support.scenes import SMALL, counts, errors_of, identified, rendered, scored

CODE = family('metashape12')
LIGHTS = [('dark', 'stripe'), ('bright', 'lattice')]


@pytest.mark.parametrize(('polarity', 'light'), LIGHTS)
@pytest.mark.parametrize('name', FAMILY_NAMES)
def test_all_targets_under_stripes_and_lattices(name: str, polarity: str, light: str) -> None:
    figures = scored(rendered(replace(SMALL, family=name, polarity=polarity, light=light)))
    assert counts(figures) == (6, 0, 0)
    *others, worst = errors_of(figures)
    assert others[-1] < 0.1
    assert worst < 0.4  # where an edge of light lies along that of the dot


@pytest.mark.lasting
@pytest.mark.parametrize(('polarity', 'light'), LIGHTS)
@pytest.mark.parametrize('name', FAMILY_NAMES)
def test_deep_shadow_costs_a_target_at_most_and_no_wrong_id(
    name: str, polarity: str, light: str
) -> None:
    scene = replace(SMALL, family=name, polarity=polarity, light=light, ambient=0.12)
    figures = scored(rendered(scene))
    assert (figures.wrong, figures.false_positives) == (0, 0)
    assert figures.right >= 5
    assert np.median(errors_of(figures)) < 0.1


SOFT = replace(SMALL, width=900, height=640, targets=5, blur=3.0)


@pytest.mark.parametrize(
    ('scene', 'limit'),
    [
        (replace(SMALL, dot_radius=5.0, targets=12), 0.05),
        (replace(SMALL, dot_radius=7.0, targets=12), 0.03),
        (replace(SMALL, dot_radius=45.0, targets=2, width=1000), 0.03),
        (replace(SMALL, tilt=62.0, targets=4, height=600), 0.08),
        (replace(SOFT, dot_radius=12.0), 0.1),
        (replace(SOFT, dot_radius=20.0), 0.05),
        (replace(SOFT, dot_radius=40.0, width=1400, height=1000, blur=4.0), 0.05),
    ],
    ids=['smallest', 'small', 'large', 'oblique', 'soft and small', 'soft', 'soft and large'],
)
def test_sizes_and_views(scene: Any, limit: float) -> None:
    figures = scored(rendered(scene))
    assert counts(figures) == (scene.targets, 0, 0)
    assert errors_of(figures)[-1] < limit


@pytest.mark.lasting
@pytest.mark.parametrize('light', ['stripe', 'fine_stripe', 'lattice'])
def test_oblique_views_under_stripes_and_lattices(light: str) -> None:
    view = SceneSettings(width=1000, height=600, targets=12, tilt=64.0, focal_length=3.0, seed=1)
    figures = scored(rendered(replace(view, light=light, ambient=0.12)))
    assert (figures.wrong, figures.false_positives) == (0, 0)
    assert figures.right >= 11


@pytest.mark.lasting
@pytest.mark.parametrize(('light', 'enough'), [('normal', 20), ('stripe', 16)])
def test_small_oblique_targets(light: str, enough: int) -> None:
    view = SceneSettings(width=1100, height=800, targets=20, dot_radius=7.0, tilt=60.0, seed=11)
    figures = scored(rendered(replace(view, focal_length=3.0, light=light, ambient=0.3)))
    assert (figures.wrong, figures.false_positives) == (0, 0)
    assert figures.right >= enough


def test_ellipse_and_code_are_those_of_the_target() -> None:
    scene = rendered(SMALL)
    for target, true in zip(identified(scene.image), scene.targets, strict=True):
        assert (target.id, target.code) == (true.id, true.code)
        assert target.semi_major == pytest.approx(true.semi_major, abs=0.1)
        assert target.semi_minor == pytest.approx(true.semi_minor, abs=0.1)
        assert 0.9 < target.confidence <= 1


@pytest.mark.parametrize('light', ['normal', 'stripe', 'lattice'])
def test_an_image_without_targets_shows_none(light: str) -> None:
    scene = replace(SMALL, width=1000, height=800, targets=0, distractors=20, light=light)
    assert identified(rendered(scene).image) == []


def test_distractors_leave_targets_alone() -> None:
    scene = replace(SMALL, width=1000, height=800, distractors=10, light='stripe')
    assert counts(scored(rendered(scene))) == (6, 0, 0)


@pytest.mark.parametrize('polarity', ['dark', 'bright'])
def test_polarity_is_found_or_obeyed(polarity: str) -> None:
    scene = rendered(replace(SMALL, polarity=polarity))
    other = 'bright' if polarity == 'dark' else 'dark'
    found = identified(scene.image, polarity=polarity)
    assert [it.id for it in found] == [it.id for it in scene.targets]
    assert identified(scene.image, polarity=other) == []


def test_only_dots_between_the_smallest_and_the_largest_radius_are_reported() -> None:
    scene = rendered(SMALL)
    by_size = sorted(scene.targets, key=lambda target: target.semi_major)
    between = (by_size[2].semi_major + by_size[3].semi_major) / 2
    small = {target.id for target in identified(scene.image, max_radius=between)}
    large = {target.id for target in identified(scene.image, min_radius=between)}
    assert small == {target.id for target in by_size[:3]}
    assert large == {target.id for target in by_size[3:]}


def test_dots_without_a_code_are_reported_on_request() -> None:
    image = np.full((200, 300), 220, np.uint8)
    cv2.circle(image, (90, 100), 10, 30, -1)
    cv2.circle(image, (210, 100), 10, 30, -1)
    image = cv2.GaussianBlur(image, (0, 0), 0.7)
    assert identified(image) == []
    found = identified(image, report_undecoded=True)
    centres = np.array(sorted((it.x, it.y) for it in found))
    assert centres == pytest.approx(np.array([(90, 100), (210, 100)]), abs=0.05)
    assert all((it.id, it.code, it.reason) == (UNDECODED, 0, 'unread') for it in found)
    assert max(it.confidence for it in found) < 0.5


def test_decoded_targets_are_the_same_when_dots_are_reported() -> None:
    rendering = rendered(SMALL)
    found = identified(rendering.image, report_undecoded=True)
    decoded, alone = [it for it in found if it.id != UNDECODED], identified(rendering.image)
    assert [it.id for it in decoded] == [it.id for it in alone]
    # Dots are measured together with others, which may change the last bits.
    centres = (np.array([(it.x, it.y) for it in some]) for some in (decoded, alone))
    assert np.allclose(*centres, rtol=0, atol=1e-6)


def test_an_id_is_reported_once_or_not_at_all() -> None:
    rendering = rendered(SMALL)
    twice = np.hstack([rendering.image, rendering.image])
    ids = [target.id for target in identified(twice)]
    assert len(set(ids)) == len(ids)
    assert set(ids) <= {target.id for target in rendering.targets}
    found = identified(twice, report_undecoded=True)
    assert len(found) == 12
    assert [target.id for target in found if target.id != UNDECODED] == ids
    contested = [target for target in found if target.id == UNDECODED]
    assert {target.reason for target in contested} == {'contested'}
    assert {target.likely_id for target in contested} <= {it.id for it in rendering.targets}
    told = create_detector('ring', family='metashape12').contesting()(twice)
    # The two of an ID are equally high but for the last bits, which have no order.
    places = [sorted((it.id, round(it.x)) for it in of) for of in (told, found)]
    assert places[0] == places[1]


@pytest.mark.lasting
@pytest.mark.parametrize('kept', [0.5, 1.5, 2.5, 3.2])
@pytest.mark.parametrize('name', FAMILY_NAMES)
def test_a_target_that_the_frame_cuts_is_not_guessed(name: str, kept: float) -> None:
    rendering = rendered(replace(SMALL, family=name))
    cut = min(rendering.targets, key=lambda target: target.x)
    left = round(cut.x - kept * cut.semi_major)
    truth = [
        TrueTarget(target.id, target.x - left, target.y, target.x - left > 4 * target.semi_major)
        for target in rendering.targets
    ]
    figures = score(truth, identified(rendering.image[:, left:], family=name))
    assert (figures.wrong, figures.false_positives) == (0, 0)
    assert figures.right == figures.expected >= 3


@pytest.mark.lasting
def test_a_covered_sector_is_not_guessed() -> None:
    rendering = rendered(SMALL)
    for turn in np.arange(0, 360, 45):
        image = rendering.image.copy()
        for target in rendering.targets:
            middle = sum(CODE.band) / 2 * target.semi_major
            left = target.x + middle * np.cos(np.radians(turn)) - target.semi_major
            top = target.y + middle * np.sin(np.radians(turn)) - target.semi_major
            size = round(2 * target.semi_major)
            cv2.rectangle(image, (round(left), round(top), size, size), 128, -1)
        figures = score(rendering, identified(image))
        assert (figures.wrong, figures.false_positives) == (0, 0)


@pytest.mark.parametrize(
    'image',
    [
        np.zeros((20, 30, 3), np.uint8),
        np.full((20, 30), np.nan),
        np.full((20, 30), 7, np.uint8),
        'image.png',
    ],
    ids=['colours', 'NaN', 'constant', 'no image'],
)
@pytest.mark.parametrize(
    'take',
    [
        identified,
        partial(estimate_count, settings=DetectorSettings(family='metashape12')),
        partial(refine_centres, targets=[], families=[CODE]),
    ],
)
def test_what_is_no_image_is_refused(take: Any, image: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r'image .*accepted'):
        take(image)


@pytest.mark.parametrize('shape', [(16, 16), (16, 3000), (17, 333)])
def test_the_smallest_images(shape: tuple[int, int]) -> None:
    image = np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8)
    assert identified(image) == []


FAINT = [
    ((130, 110, 1.5), 0.1),
    ((130, 115, 1.0), 0.1),
    ((130, 120, 0.7), 0.1),
    ((130, 125, 0.5), 0.15),
    ((240, 200, 1.0), 0.05),
    ((90, 60, 1.0), 0.05),
]
"""Levels of paper, ink and noise, and the usual error of a coordinate, px."""


@cache
def sheet(name: str = 'metashape12', bright: bool = False) -> Sheet:
    return target_sheet(name, np.array([3, 50, 101, 140]), 1, columns=2, bright=bright)


@pytest.mark.parametrize(
    ('name', 'bright', 'levels', 'precision'),
    [
        *(('metashape12', bright, *faint) for bright in (False, True) for faint in FAINT),
        *((name, False, (160, 140, 1.0), 0.1) for name in FAMILY_NAMES),
    ],
)
def test_faint_targets_are_identified(name: str, bright: Any, levels: Any, precision: Any) -> None:
    of = sheet(name, bright)
    image = of.photograph(Exposure(levels=levels))
    figures = score(of.truth, identified(image, family=name))
    assert counts(figures) == (4, 0, 0)
    assert np.sqrt(np.mean(np.square(figures.errors))) < precision


@pytest.mark.parametrize('light', [3.0, 4.0])
def test_over_exposed_targets_are_identified(light: float) -> None:
    figures = score(sheet().truth, identified(sheet().photograph(Exposure(light=light))))
    assert counts(figures) == (4, 0, 0)
    assert np.abs(figures.errors).max() < 0.05


@pytest.mark.parametrize(('levels', 'sharpened'), [((300, 45, 1.5), 0.0), ((230, 45, 1.0), 2.0)])
def test_bright_marks_that_a_camera_clips_or_sharpens_are_read(
    levels: tuple[int, int, float], sharpened: float
) -> None:
    of = sheet(bright=True)
    image = of.photograph(Exposure(levels=levels))
    blurred = cv2.GaussianBlur(image, (0, 0), 1.5)
    image = cv2.addWeighted(image, 1 + sharpened, blurred, -sharpened, 0)
    assert counts(score(of.truth, identified(image))) == (4, 0, 0)


@pytest.mark.parametrize('light', ['normal', 'stripe', 'lattice'])
def test_an_image_of_clear_targets_is_read_once(light: str) -> None:
    image, settings = (
        rendered(replace(SMALL, light=light)).image,
        DetectorSettings(family='metashape12'),
    )
    once, found = read_image(image, settings), find_hypotheses(image, settings)
    assert np.array_equal(found.frames, once.frames)
    assert np.array_equal(found.confidence, once.confidence)
    assert once.certain.sum() >= 6


def test_faint_and_clear_targets_in_one_image() -> None:
    of = sheet()
    clear, faint = of.photograph(Exposure()), of.photograph(Exposure(levels=(150, 130, 1.0)))
    image, settings = (
        np.hstack([clear, np.full_like(clear, 140), faint]),
        DetectorSettings(family='metashape12'),
    )
    once, found = read_image(image, settings), find_hypotheses(image, settings)
    first = len(once.frames)
    assert np.array_equal(found.frames[:first], once.frames)
    added = found.frames[first:, :2, 2]
    centres = np.array([(it.x + 2 * clear.shape[1], it.y) for it in of.truth])
    away = np.linalg.norm(centres[:, None] - added, axis=2).min(axis=1)
    assert away.max() < 0.2
    assert added[:, 0].min() > clear.shape[1]


def test_faint_marks_that_are_no_targets_stay_unread() -> None:
    generator = np.random.default_rng(4)
    marks = mark_sheet([other_sectors(CODE, generator) for _ in range(6)], 1)
    faint, clear = Exposure(levels=(130, 110, 1.0)), Exposure()
    assert len(identified(marks.photograph(faint))) <= len(identified(marks.photograph(clear)))


COVERED = {
    'black over 1 sector': (Exposure(occluder=occluders.over_sectors(1, 61)), 15),
    'gray over 1 sector': (Exposure(occluder=occluders.over_sectors(1, 128)), 15),
    'gray over 2 sectors': (Exposure(occluder=occluders.over_sectors(2, 128)), 5),
    'gray finger': (Exposure(occluder=occluders.finger(2.0, 128)), 12),
    'white spot': (Exposure(occluder=occluders.disc(1.0, 220)), 4),
    'highlight': (Exposure(glare=occluders.highlight(1.0, 200)), 10),
}
"""Disturbances, and how many of 18 targets are identified at least."""


COVERED_BRIGHT = {
    'white over 1 sector': (Exposure(occluder=occluders.over_sectors(1, 220)), 15),
    'gray over 2 sectors': (Exposure(occluder=occluders.over_sectors(2, 170)), 5),
    'gray finger': (Exposure(occluder=occluders.finger(2.0, 128)), 12),
    'white spot': (Exposure(occluder=occluders.disc(1.0, 220)), 12),
}
"""The same of bright targets on dark ground."""


@cache
def whole_sheet(*, bright: bool = False) -> Sheet:
    numbers = random_numbers('metashape12', 18, 31)[0]
    return target_sheet('metashape12', numbers, 31, bright=bright)


@pytest.mark.lasting
@pytest.mark.parametrize(
    ('sight', 'bright'), [*product(COVERED, [False]), *product(COVERED_BRIGHT, [True])]
)
def test_what_is_covered_costs_targets_and_gives_no_wrong_one(sight: str, bright: bool) -> None:
    exposure, minimum = (COVERED_BRIGHT if bright else COVERED)[sight]
    sheet = whole_sheet(bright=bright)
    targets = identified(sheet.photograph(exposure))
    figures = score(sheet.truth, targets)
    assert len(targets) == figures.right >= minimum


@pytest.mark.lasting
@pytest.mark.parametrize('read_as', [name for name in FAMILY_NAMES if name != 'metashape12'])
def test_targets_of_another_family_are_not_reported(read_as: str) -> None:
    assert not identified(whole_sheet().photograph(Exposure()), family=read_as)


ROW = SceneSettings(width=900, height=640, targets=20, dot_radius=10.0, radius_spread=0.0, seed=21)


@cache
def seen(**changes: Any) -> Any:
    """Return the figures and the shifts of the edges of a scene with dots of 10 px, by ID."""
    scene = rendered(replace(ROW, **changes))
    targets = identified(scene.image)
    return score(scene, targets), {it.id: it.edge_shift for it in targets}


@pytest.mark.lasting
@pytest.mark.parametrize('polarity', ['dark', 'bright'])
@pytest.mark.parametrize('edge_shift', [-1.0, -0.6, 0.6, 1.0])
def test_shifted_edges_cost_no_target_and_are_reported(edge_shift: float, polarity: str) -> None:
    figures, shifts = seen(polarity=polarity, edge_shift=edge_shift)
    plain, _ = seen(polarity=polarity)
    assert counts(figures) == (20, 0, 0)
    assert figures.rmse[2] < plain.rmse[2] + 0.005
    assert list(shifts.values()) == pytest.approx([edge_shift] * 20, abs=0.15)


@pytest.mark.parametrize('overexposure', [2.0, 4.0])
def test_edges_of_over_exposed_targets_are_shifted(overexposure: float) -> None:
    (figures, shifts), (_, as_printed) = seen(overexposure=overexposure), seen(polarity='dark')
    assert counts(figures) == (20, 0, 0)
    assert np.median([*shifts.values()]) < np.median([*as_printed.values()]) - 0.1
