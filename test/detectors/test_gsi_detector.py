"""Point-distributed targets are identified, and nothing else is."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from ahf_ros.codes.gsi import positions_of, value_of
from ahf_ros.codes.gsi_library import GSI_LIBRARY, point_family
from ahf_ros.detectors import create_detector
from ahf_ros.detectors.gsi.evidence import Evidence, seen_templates
from ahf_ros.detectors.gsi.grouping import Templates, find_templates
from ahf_ros.detectors.gsi.reading import read_codes
from ahf_ros.drawing.overlay import DECODED_COLOUR, DECODING_DOT_COLOUR, draw
from ahf_ros.evaluation import score
from ahf_ros.features.dots import Dots
from ahf_ros.features.frame import affine_frames
from ahf_ros.features.homography import fit_homographies, local_frames
from ahf_ros.features.pyramid import image_pyramid
from ahf_ros.filtering.homomorphic import HomomorphicFilter
from ahf_ros.synthetic.scene import Rendering, SceneSettings, render
from ahf_ros.target import UNDECODED, DottedTarget, Identification

SIZE = {'family': 'gsi', 'width': 1000, 'height': 700, 'targets': 4, 'dot_radius': 6.0}


@cache
def rendering(**changes: object) -> Rendering:
    return render(SceneSettings(**{**SIZE, 'seed': 3, **changes}))


def errors(shown: Rendering, targets: list) -> np.ndarray:
    true = {target.id: target for target in shown.targets}
    return np.array([(it.x - true[it.id].x, it.y - true[it.id].y) for it in targets])


@pytest.mark.parametrize(
    ('changes', 'bound'),
    [
        ({}, 0.02),
        ({'polarity': 'bright'}, 0.02),
        ({'tilt': 60.0, 'polarity': 'bright', 'focal_length': 4.0}, 0.05),
        ({'tilt': 75.0, 'polarity': 'bright', 'focal_length': 8.0}, 0.2),
        ({'dot_radius': 10.0, 'targets': 2}, 0.01),
        ({'dot_radius': 3.0, 'sizes': '1, 2', 'targets': 6}, 0.05),
        ({'light': 'stripe', 'dot_radius': 9.0, 'targets': 2}, 0.05),
        ({'light': 'fringe', 'ambient': 0.12, 'polarity': 'bright'}, 0.05),
    ],
)
def test_targets_are_identified_and_placed(changes: dict, bound: float) -> None:
    shown = rendering(**changes)
    found = create_detector(family='gsi', min_radius=2.0)(shown.image)
    figures = score(shown.targets, found)
    assert figures.right == len(shown.targets)
    assert figures.wrong == figures.false_positives == 0
    assert np.sqrt((errors(shown, found) ** 2).mean()) < bound
    codes = {target.id: target.code for target in shown.targets}
    assert all(target.code == codes[target.id] for target in found)
    assert all(0.95 <= target.confidence <= 1 for target in found)


@pytest.mark.parametrize('radius', [1.0, 1.25, 2.0, 2.5, 3.0, 3.6])
@pytest.mark.parametrize(
    'changes', [{}, {'polarity': 'bright', 'light': 'stripe'}, {'light': 'lattice'}]
)
def test_dots_have_any_radius_and_the_data_file_need_not_say_which(
    tmp_path: Path, radius: float, changes: dict
) -> None:
    path = tmp_path / 'gsi.json'
    path.write_text(
        GSI_LIBRARY.read_text().replace('"dot_radius": 1.5', f'"dot_radius": {radius}')
    )
    pixels = 8.0 * radius / point_family().dot_radius
    own = {'targets': 3, 'dot_radius': pixels, 'family_file': str(path), 'seed': 5}
    shown = render(SceneSettings(**{**SIZE, 'width': 1600, 'height': 1200, **own, **changes}))
    found = create_detector(family='gsi')(shown.image)
    figures = score(shown.targets, found)
    assert (figures.right, figures.wrong, figures.false_positives) == (3, 0, 0)
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
    squares = []
    for seed in (3, 4, 5):
        shown = rendering(dot_radius=8.0, targets=3, seed=seed)
        found = create_detector(family='gsi')(shown.image)
        for target, error in zip(found, errors(shown, found), strict=True):
            squares.append(error @ np.linalg.solve(np.reshape(target.covariance, (2, 2)), error))
    assert 0.05 < np.mean(squares) < 6


def test_a_mirror_image_is_never_read_as_the_code_itself() -> None:
    # The positions are mirror images of each other, so that it is the target of another code.
    family = point_family()
    mirrored = {
        number: family.position_numbers[np.hypot(*(family.positions - place[::-1]).T).argmin()]
        for number, place in zip(family.position_numbers.tolist(), family.positions, strict=True)
    }
    detector = create_detector(family='gsi')
    shown = rendering()
    found = detector(np.ascontiguousarray(shown.image[:, ::-1]))
    codes = {
        value_of(int(mirrored[position]) for position in positions_of(target.code))
        for target in shown.targets
    }
    assert {target.code for target in found} == codes
    assert not codes & {target.code for target in shown.targets}
    turned = detector(np.ascontiguousarray(shown.image[::-1, ::-1]))
    assert [target.id for target in turned] == [target.id for target in shown.targets]


def test_a_target_without_one_of_its_dots_is_not_reported() -> None:
    shown = rendering(targets=1, texture=0.0)
    (target,) = create_detector(family='gsi')(shown.image)
    assert isinstance(target, DottedTarget)
    for x, y, radius, *_ in target.dots[-3:]:
        image = shown.image.copy()
        half = round(radius + 4)
        column, row = round(x), round(y)
        ground = image[row - half, column - half]
        image[row - half : row + half + 1, column - half : column + half + 1] = ground
        assert create_detector(family='gsi')(image) == []


def test_dots_of_no_target_are_reported_on_request() -> None:
    shown = rendering(distractors=12, dot_radius=5.0, targets=3)
    found = create_detector(family='gsi', report_undecoded=True)(shown.image)
    decoded = [target for target in found if target.id != UNDECODED]
    others = [target for target in found if target.id == UNDECODED]
    assert {target.id for target in decoded} == {target.id for target in shown.targets}
    assert others and all(target.code == 0 and target.confidence == 0 for target in others)
    for target in decoded:
        assert isinstance(target, DottedTarget)
        for x, y, radius, *_ in target.dots:
            assert all(np.hypot(it.x - x, it.y - y) > radius for it in others)
    assert create_detector(family='gsi')(shown.image) == decoded


def test_dots_of_a_target_are_those_of_the_print_in_their_order() -> None:
    shown = rendering()
    family = point_family()
    for target in create_detector(family='gsi')(shown.image):
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


def test_places_come_from_the_image_as_received() -> None:
    shown = rendering(light='stripe', dot_radius=9.0, targets=2)
    detector = create_detector(family='gsi')
    filtered = HomomorphicFilter(shown.image).filtered(1.2, 0.4)
    found = detector(filtered)
    assert len(found) == 2
    refined = detector.refine(shown.image, found)
    assert [target.id for target in refined] == [target.id for target in found]
    assert np.hypot(*errors(shown, refined).T).max() < 0.05
    assert detector.refine(shown.image, []) == []


def grid(spacing: float, count: tuple[int, int], radius: float) -> Dots:
    x, y = np.meshgrid(*(spacing * (1 + np.arange(side)) for side in count))
    size = np.full(x.size, radius)
    frames = affine_frames(x.ravel(), y.ravel(), size, size, 0 * size)
    return Dots(frames, np.ones(x.size, int), np.ones(x.size))


def test_a_grid_of_dots_has_a_bounded_number_of_templates() -> None:
    templates = find_templates(grid(24.0, (50, 40), 5.0), point_family())
    assert len(templates.misfit) <= 4000
    assert not len(find_templates(grid(24.0, (2, 1), 5.0), point_family()).misfit)


def test_a_dot_that_was_found_may_be_hidden_and_one_that_was_not_found_may_not() -> None:
    shown = rendering(targets=1, tilt=0.0)
    (target,) = create_detector(family='gsi')(shown.image)
    assert isinstance(target, DottedTarget)
    family = point_family()
    count = len(family.template)
    x, y, radius, *_ = target.dots[0]
    image = shown.image.copy()
    half = round(1.6 * radius)
    patch = image[round(y) - half : round(y) + half + 1, round(x) - half : round(x) + half + 1]
    patch[...] = patch.max()
    centres = np.array(target.dots)[None, :count, :2]
    fit = fit_homographies(family.places[:count], centres, np.ones((1, count)), family.reach)
    sign = np.array([target.polarity])
    unseen = Templates(
        np.tile(fit.homographies, (2, 1, 1)),
        np.array([range(count), [-1, *range(1, count)]]),
        np.tile(sign, 2),
        np.ones(2),
        np.zeros(2),
    )
    log = image_pyramid(image, 60.0).logs[0]
    assert seen_templates(log, unseen, family).members.tolist() == [[*range(count)]]


def test_targets_in_deep_lattices_are_read() -> None:
    scene = {'width': 1800, 'height': 1200, 'targets': 5, 'dot_radius': 10.0, 'seed': 5}
    shown = rendering(light='lattice', ambient=0.04, **scene)
    figures = score(shown.targets, create_detector(family='gsi')(shown.image))
    assert (figures.right, figures.wrong, figures.false_positives) == (5, 0, 0)


def test_a_grid_of_dots_is_no_target() -> None:
    y, x = np.mgrid[:600, :800]
    inside = np.hypot((x + 12) % 24 - 12, (y + 12) % 24 - 12)
    image = (60 + 160 * np.clip(inside - 4.5, 0, 1)).astype(np.uint8)
    assert create_detector(family='gsi')(image) == []


OWN = """
family: six
unit: mm
dot_radius: 1.5
reference: centre
template:
  centre: [0, 0, 3]
  far: [0, 18, 3]
  left: [-14, -6, 3]
positions:
  0: [8, 8]
  1: [14, 0]
  2: [10, -10]
  3: [0, -12]
  4: [-10, 8]
  5: [10, 18]
rule: {dots: 3, minimum_distance: 6, first_own_number: 1}
"""


def test_a_family_of_ones_own_is_printed_and_identified(tmp_path: Path) -> None:
    # Three large dots and three small ones, after the description of Hattori's targets.
    path = tmp_path / 'six.yaml'
    path.write_text(OWN)
    family = point_family(str(path))
    scene = SceneSettings(
        width=900, height=700, targets=4, family='gsi', family_file=str(path), dot_radius=5, seed=2
    )
    shown = render(scene)
    found = create_detector(family='gsi', family_file=str(path))(shown.image)
    figures = score(shown.targets, found)
    assert (figures.right, figures.wrong, figures.false_positives) == (4, 0, 0)
    assert all(family.number(target.code) == target.id for target in found)
    assert np.hypot(*errors(shown, found).T).max() < 0.05


def test_a_bad_data_file_is_refused_when_the_detector_is_made(tmp_path: Path) -> None:
    path = tmp_path / 'two.yaml'
    path.write_text(OWN.replace('  left: [-14, -6, 3]\n', ''))
    with pytest.raises(ValueError, match=r'two\.yaml, line 7: template .*3 to 12 names'):
        create_detector(family='gsi', family_file=str(path))


def test_overlays_tell_template_and_decoding_dots_apart() -> None:
    shown = rendering()
    found = tuple(create_detector(family='gsi')(shown.image))
    canvas = draw(shown.image, Identification(found))
    assert isinstance(found[0], DottedTarget)
    for index, colour in ((0, DECODED_COLOUR), (7, DECODING_DOT_COLOUR)):
        x, y, major, *_ = found[0].dots[index]
        half = round(major + 3)
        column, row = round(x), round(y)
        around = canvas[row - half : row + half + 1, column - half : column + half + 1]
        assert (np.abs(around.astype(int) - colour).max(axis=2) < 30).any()


def test_templates_are_not_mirrored_wherever_they_are() -> None:
    # Far from the origin of the image, perspective dominates the upper left of a homography.
    family = point_family()
    slopes, centre, depth = [[0.86, -1.29], [-0.97, -3.30]], [3287.0, 1778.0], [-4.5e-4, 4.8e-4]
    homography = np.vstack(
        [np.column_stack([slopes + np.outer(centre, depth), centre]), [*depth, 1]]
    )
    assert np.linalg.det(homography[:2, :2]) > 0 > np.linalg.det(homography)
    which = [0, 1, 2, 3, 4, 5, 9, 30]
    frames = local_frames(homography[None], family.places[which], family.radii[which])[0]
    dots = Dots(frames, np.ones(len(which), int), np.ones(len(which)))
    templates = find_templates(dots, family)
    found = templates.homographies[:, :2, 2] / templates.homographies[:, 2:, 2]
    assert np.hypot(*(found - centre).T).min() < 0.1
    assert (np.linalg.det(templates.homographies) < 0).all()


def test_small_dots_that_look_a_pixel_wider_still_make_a_template() -> None:
    # Blobs of few pixels have axes of whole pixels: 3 px where the dot has 1.7 px.
    family = point_family()
    minor = np.cos(np.deg2rad(70.0))
    pixels = 5.1 / family.dot_radius
    homography = np.diag([pixels, -pixels * minor, 1.0])
    homography[:2, 2] = 400.0, 300.0
    which = np.arange(len(family.template))
    frames = local_frames(homography[None], family.places[which], family.radii[which])[0]
    wide = frames.copy()
    wide[:, :2, :2] = np.diag([5.1, 3.0])
    dots = Dots(wide, np.ones(len(which), int), np.ones(len(which)))
    templates = find_templates(dots, family)
    assert templates.members.tolist() == [which.tolist()]
    assert templates.misfit[0] < 0.1


def test_paper_in_a_dark_stripe_is_not_taken_for_a_dot() -> None:
    # As wide as a dot, a stripe has the outline of one on most of its circumference.
    shown = rendering(light='stripe', ambient=0.04, dot_radius=10.0, targets=3, width=1300)
    found = create_detector(family='gsi')(shown.image)
    figures = score(shown.targets, found)
    assert figures.right >= 2
    assert figures.wrong == figures.false_positives == 0
