"""Point-distributed targets are identified, and nothing else is."""

from itertools import product
from pathlib import Path

import numpy as np
import pytest

from ahf_ros.base.target import UNDECODED, DottedTarget, Identification
from ahf_ros.families import create_detector
from ahf_ros.families.gsi.evidence import Evidence, find_evidence, likely_templates, read_codes
from ahf_ros.families.gsi.grouping import Templates
from ahf_ros.prints.gsi import GSI_LIBRARY, point_family, positions_of, value_of
from ahf_ros.scenes.scene import Rendering
from ahf_ros.views.drawing.overlay import DECODED_COLOUR, DECODING_DOT_COLOUR, draw
from ahf_ros.vision.homography import fit_homographies
from ahf_ros.vision.pyramid import image_pyramid
from support.pictures.textures import text_page, weave
from support.scenes import around, counted, errors, relative_errors, rendering

SIZE = {'family': 'gsi', 'width': 1000, 'height': 700, 'targets': 4, 'dot_radius': 6.0, 'seed': 3}
detect = create_detector(family='gsi')


def scene(**changes: object) -> Rendering:
    return rendering(**SIZE | changes)


@pytest.mark.lasting
@pytest.mark.parametrize('seed', [101, 102, 103])
def test_letters_are_no_dots(seed: int) -> None:
    assert detect(text_page(seed)) == []


@pytest.mark.lasting
@pytest.mark.parametrize('seed', [101, 102, 103])
def test_threads_are_no_dots(seed: int) -> None:
    assert detect(weave(seed)) == []


@pytest.mark.lasting
@pytest.mark.parametrize(
    ('radius', 'changes'),
    [
        *product((1.0, 1.25, 2.0, 2.5, 3.0, 3.6), ({}, {'polarity': 'bright', 'light': 'stripe'})),
        *product((1.0, 2.0, 3.6), [{'light': 'lattice'}]),
    ],
)
def test_dots_have_any_radius_and_the_data_file_need_not_say_which(
    tmp_path: Path, radius: float, changes: dict
) -> None:
    path = tmp_path / 'gsi.json'
    path.write_text(
        GSI_LIBRARY.read_text().replace('"dot_radius": 1.5', f'"dot_radius": {radius}')
    )
    pixels = 6.0 * radius / point_family().dot_radius
    own = {'targets': 3, 'dot_radius': pixels, 'family_file': str(path), 'seed': 5}
    shown = scene(width=1200, height=900, **own, **changes)
    found = detect(shown.image)
    assert counted(shown, found) == (3, 0, 0)
    assert np.hypot(*errors(shown, found).T).max() < 0.15
    sizes = {target.id: target.semi_major for target in shown.targets}
    for target in found:
        assert target.semi_major == pytest.approx(sizes[target.id], rel=0.1)


def test_places_within_two_radii_of_a_dot_tell_nothing_new() -> None:
    family = point_family()
    count, word = len(family.template), family.words[:1]
    shown = np.zeros(len(family.places), bool)
    shown[:count] = shown[count + family.decoding_dots(int(word[0]))] = True
    near = np.hypot(*(family.places[:, None] - family.places[shown]).transpose(2, 0, 1)).min(
        axis=1
    )
    ratio = np.where(shown, 8.0, -6.0)
    ratio[~shown & (near < 5)] = 3.0  # as large dots cover them in part
    evidence = Evidence(ratio[None], np.ones((1, len(ratio)), bool))
    small, large = (read_codes(evidence, np.array([scale]), family) for scale in (1.0, 2.0))
    assert small.words == large.words == word
    assert small.support[0] < 0.95
    assert large.support[0] == pytest.approx(1)


def test_covariances_are_about_right() -> None:
    scenes = [scene(dot_radius=8.0, targets=3, seed=seed) for seed in (3, 4, 5)]
    squares = [relative_errors(shown, detect(shown.image)) for shown in scenes]
    assert 0.05 < np.concatenate(squares).mean() < 6


def test_a_mirror_image_is_never_read_as_the_code_itself() -> None:
    # The positions are mirror images of each other, so that it is the target of another code.
    family = point_family()
    mirrored = {
        number: family.position_numbers[np.hypot(*(family.positions - place[::-1]).T).argmin()]
        for number, place in zip(family.position_numbers.tolist(), family.positions, strict=True)
    }
    shown = scene()
    found = detect(np.ascontiguousarray(shown.image[:, ::-1]))
    codes = {
        value_of(int(mirrored[position]) for position in positions_of(target.code))
        for target in shown.targets
    }
    assert {target.code for target in found} == codes
    assert not codes & {target.code for target in shown.targets}
    turned = detect(np.ascontiguousarray(shown.image[::-1, ::-1]))
    assert [target.id for target in turned] == [target.id for target in shown.targets]


def test_a_target_without_one_of_its_dots_is_not_reported() -> None:
    shown = scene(targets=1, texture=0.0)
    (target,) = detect(shown.image)
    assert isinstance(target, DottedTarget)
    for x, y, radius, *_ in target.dots[-3:]:
        image = shown.image.copy()
        patch = image[around(x, y, radius + 4)]
        patch[...] = patch[0, 0]
        assert detect(image) == []


@pytest.mark.parametrize(
    ('name', 'changes'),
    [
        ('gsi', {'distractors': 12, 'dot_radius': 5.0, 'targets': 3}),
        ('gsi_published', {'distractors': 8, 'targets': 2}),
    ],
)
def test_dots_of_no_target_are_reported_on_request(name: str, changes: dict) -> None:
    shown = scene(**changes)
    found = create_detector(name, family='gsi', report_undecoded=True)(shown.image)
    decoded = [target for target in found if target.id != UNDECODED]
    others = [target for target in found if target.id == UNDECODED]
    assert {target.id for target in decoded} == {target.id for target in shown.targets}
    assert others and all(target.code == 0 for target in others)
    assert all(type(it) is int for target in others for it in (target.id, target.code))
    assert name != 'gsi' or not any(target.confidence for target in others)
    for target in decoded:
        assert isinstance(target, DottedTarget)
        for x, y, radius, *_ in target.dots:
            assert all(np.hypot(it.x - x, it.y - y) > radius for it in others)
    assert create_detector(name, family='gsi')(shown.image) == decoded


def test_dots_of_a_target_are_those_of_the_print_in_their_order() -> None:
    shown = scene()
    family = point_family()
    for target in detect(shown.image):
        assert isinstance(target, DottedTarget)
        assert (len(target.dots), target.template_dots, target.polarity) == (8, 5, 1)
        x, y, major, *_ = target.dots[family.reference]
        assert (x, y) == pytest.approx((target.x, target.y), abs=0.05)
        assert major == pytest.approx(target.semi_major, rel=0.02)
        a, b, c, d = np.array(target.dots)[:4, :2]
        sides = np.cross(np.append(b - c, 0), np.append(d - c, 0))[2]
        assert sides < 0  # counter-clockwise as seen, y going down
        gap = np.hypot(*(a - c)) / np.hypot(*(b - c))
        assert gap == pytest.approx(26 * 2**0.5 / 11, rel=0.05)


def test_a_dot_that_was_found_may_be_hidden_and_one_that_was_not_found_may_not() -> None:
    shown = scene(targets=1, tilt=0.0)
    (target,) = detect(shown.image)
    assert isinstance(target, DottedTarget)
    family = point_family()
    count = len(family.template)
    x, y, radius, *_ = target.dots[0]
    image = shown.image.copy()
    patch = image[around(x, y, 1.6 * radius)]
    patch[...] = patch.max()
    centres = np.array(target.dots)[None, :count, :2]
    fit = fit_homographies(family.places[:count], centres, np.ones((1, count)), family.reach)
    unseen = Templates(
        homographies=np.tile(fit.homographies, (2, 1, 1)),
        members=np.array([range(count), [-1, *range(1, count)]]),
        polarity=np.full(2, target.polarity),
        scale=np.ones(2),
        misfit=np.zeros(2),
    )
    log = image_pyramid(image, 60.0).logs[0]
    likely, _ = likely_templates(log, unseen, family, 0.75)
    assert likely.members.tolist() == [[*range(count)]]


def test_templates_that_are_left_out_have_no_code_with_the_support() -> None:
    shown = scene(light='lattice', ambient=0.3)
    family = point_family()
    count = len(family.template)
    random = np.random.default_rng(7)
    centres = np.array([it.dots for it in detect(shown.image)])[:, :count, :2]
    moved = [centres + random.normal(0, error, centres.shape) for error in (0.0, 1.0, 2.0, 4.0)]
    centres = np.concatenate(moved * 5)
    ones = np.ones(centres.shape[:2])
    kind = {
        'homographies': fit_homographies(
            family.places[:count], centres, ones, family.reach
        ).homographies,
        'polarity': np.ones(len(centres), int),
        'scale': random.uniform(0.5, 2.5, len(centres)),
    }
    some = Templates(
        **kind,
        members=np.tile(np.arange(count), (len(centres), 1)),
        misfit=random.uniform(size=len(centres)),
    )
    log = image_pyramid(shown.image, 60.0).logs[0]
    every, _ = likely_templates(log, some, family, -np.inf)
    kept, evidence = likely_templates(log, some, family, 0.75)
    support = read_codes(find_evidence(log, **_places(every), family=family), every.scale, family)
    enough = support.support >= 0.75
    assert np.isin(every.misfit[enough], kept.misfit).all()
    assert enough.any()
    assert len(kept.misfit) < len(every.misfit)
    whole = find_evidence(log, **_places(kept), family=family)
    np.testing.assert_array_equal(evidence.ratio, whole.ratio)
    np.testing.assert_array_equal(evidence.inside, whole.inside)


def _places(of: Templates) -> dict[str, np.ndarray]:
    """Return where the targets of templates are."""
    return {'homographies': of.homographies, 'polarity': of.polarity, 'scale': of.scale}


def test_targets_in_deep_lattices_are_read() -> None:
    size = {'width': 1800, 'height': 1200, 'targets': 5, 'dot_radius': 10.0, 'seed': 5}
    shown = scene(light='lattice', ambient=0.04, **size)
    assert counted(shown, detect(shown.image)) == (5, 0, 0)


def test_targets_at_75_degrees_are_read() -> None:
    size = {'width': 1600, 'height': 1066, 'targets': 8, 'dot_radius': 5.1, 'seed': 1}
    shown = scene(tilt=75.0, polarity='bright', focal_length=8.0, **size)
    assert counted(shown, detect(shown.image)) == (8, 0, 0)


def test_a_grid_of_dots_is_no_target() -> None:
    y, x = np.mgrid[:600, :800]
    inside = np.hypot((x + 12) % 24 - 12, (y + 12) % 24 - 12)
    image = (60 + 160 * np.clip(inside - 4.5, 0, 1)).astype(np.uint8)
    assert detect(image) == []


def test_overlays_tell_template_and_decoding_dots_apart() -> None:
    shown = scene()
    found = tuple(detect(shown.image))
    canvas = draw(shown.image, Identification(found))
    assert isinstance(found[0], DottedTarget)
    for index, colour in ((0, DECODED_COLOUR), (7, DECODING_DOT_COLOUR)):
        x, y, major, *_ = found[0].dots[index]
        patch = canvas[around(x, y, major + 3)]
        assert (np.abs(patch.astype(int) - colour).max(axis=2) < 30).any()


def test_paper_in_a_dark_stripe_is_not_taken_for_a_dot() -> None:
    # As wide as a dot, a stripe has the outline of one on most of its circumference.
    shown = scene(light='stripe', ambient=0.04, dot_radius=10.0, targets=3, width=1300)
    right, wrong, false = counted(shown, detect(shown.image))
    assert right >= 2
    assert wrong == false == 0
