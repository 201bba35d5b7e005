"""Synthetic images: their truth is exact, the codes are the printed ones, the light is as told."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from ahf_ros.base.target import Target
from ahf_ros.prints.ring import family
from ahf_ros.scenes.scene import Rendering, SceneSettings, render

SMALL = SceneSettings(width=480, height=360, targets=6, dot_radius=12.0)
IDEAL = replace(SMALL, texture=0.0, full_well=0.0, pinhole=0.0, exposure=240.0)


def light_of(rendering: Rendering) -> np.ndarray:
    return (rendering.image / 255.0) ** rendering.settings.gamma


def ink_of(settings: SceneSettings) -> tuple[np.ndarray, tuple[Target, ...]]:
    """Return the share of each pixel that is inked, from images with ink and without."""
    printed = render(settings)
    plain = light_of(render(replace(settings, black=1.0)))
    return (1 - light_of(printed) / plain) / (1 - settings.black), printed.targets


def moments(ink: np.ndarray, target: Target, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Return centroid and covariance of the ink within `reach` dot radii of a target."""
    y, x = np.mgrid[: ink.shape[0], : ink.shape[1]]
    cosine, sine = math.cos(target.angle), math.sin(target.angle)
    along = (x - target.x) * cosine + (y - target.y) * sine
    across = (y - target.y) * cosine - (x - target.x) * sine
    near = np.hypot(along / target.semi_major, across / target.semi_minor) < reach
    weight = ink[near] / ink[near].sum()
    places = np.stack((x[near], y[near]), axis=1)
    centroid = weight @ places
    offset = places - centroid
    return centroid, (offset * weight[:, None]).T @ offset


def read_code(image: np.ndarray, target: Target, settings: SceneSettings) -> int | None:
    """Return the ID read counter-clockwise round the band, at the phase of best contrast."""
    table = family(settings.family)
    radius = (table.band_inner + table.band_outer) / 2
    best = (-1.0, 0)
    for phase in np.arange(8) / 8:
        angle = 2 * math.pi * (np.arange(table.bits) + phase) / table.bits
        cosine, sine = math.cos(target.angle), math.sin(target.angle)
        along = radius * target.semi_major * np.cos(-angle)
        across = radius * target.semi_minor * np.sin(-angle)
        columns = np.float32(target.x + along * cosine - across * sine)[None]
        rows = np.float32(target.y + along * sine + across * cosine)[None]
        values = cv2.remap(np.float32(image), columns, rows, cv2.INTER_LINEAR)[0]
        inked = values < 128 if settings.dark else values > 128
        contrast = float(np.abs(values - 128).min())
        best = max(best, (contrast, int((inked << np.arange(table.bits)).sum())))
    return table.number(best[1])


def test_dots_without_tilt_have_their_centroid_at_the_truth() -> None:
    """What remains, 0.002 px a dot, is the rounding to 8 bit."""
    errors = []
    for seed in range(6):
        ink, targets = ink_of(replace(IDEAL, seed=seed))
        errors += [moments(ink, target, 1.3)[0] - (target.x, target.y) for target in targets]
    assert len(errors) == 36
    assert np.sqrt(np.mean(np.square(errors))) < 0.003
    assert np.abs(np.mean(errors, axis=0)).max() < 0.001


@pytest.mark.parametrize(('tilt', 'distortion'), [(0.0, 0.0), (45.0, 0.0), (30.0, -0.2)])
def test_the_ellipse_has_the_moments_of_the_dot(tilt: float, distortion: float) -> None:
    ink, targets = ink_of(replace(IDEAL, tilt=tilt, distortion=distortion, seed=5))
    for target in targets:
        _, covariance = moments(ink, target, 1.6)
        axes = np.array(
            [
                [math.cos(target.angle), -math.sin(target.angle)],
                [math.sin(target.angle), math.cos(target.angle)],
            ]
        )
        squares = np.array([target.semi_major, target.semi_minor]) ** 2 / 4
        blurred = np.diag(squares + IDEAL.blur**2 + 1 / 12)
        assert np.abs(covariance - axes @ blurred @ axes.T).max() < 0.1


@pytest.mark.parametrize(('tilt', 'distortion'), [(45.0, 0.0), (60.0, 0.0), (45.0, -0.2)])
def test_the_truth_is_the_physical_centre_and_not_that_of_the_ellipse(
    tilt: float, distortion: float
) -> None:
    """The perspective shift of a circle is as its area, so that two circles tell the centre."""
    hole = 0.5
    settings = replace(
        IDEAL,
        tilt=tilt,
        distortion=distortion,
        targets=2,
        dot_radius=16.0,
        radius_spread=0.0,
        focal_length=1.5,
        blur=0.4,
        seed=2,
    )
    dots, targets = ink_of(settings)
    rings, _ = ink_of(replace(settings, pinhole=hole))
    shift = 0.0
    for target in targets:
        outer, _ = moments(dots, target, 1.6)
        inner, _ = moments(dots - rings, target, 1.6)
        centre = inner + (inner - outer) * hole**2 / (1 - hole**2)
        assert np.abs(centre - (target.x, target.y)).max() < 0.01
        shift = max(shift, np.hypot(*(outer - (target.x, target.y))))
    assert shift > 0.1


@pytest.mark.parametrize(
    ('name', 'polarity', 'tilt'),
    [
        ('metashape12', 'dark', 0.0),
        ('metashape12', 'bright', 40.0),
        ('metashape14', 'dark', 40.0),
        ('metashape20', 'dark', 0.0),
        ('aicon12', 'dark', 0.0),
        ('aicon14', 'bright', 40.0),
    ],
)
def test_codes_are_read_counter_clockwise(name: str, polarity: str, tilt: float) -> None:
    settings = replace(
        SMALL, family=name, polarity=polarity, tilt=tilt, ambient=0.3, black=0.03, seed=1
    )
    rendering = render(settings)
    read = [read_code(rendering.image, target, settings) for target in rendering.targets]
    assert read == [target.id for target in rendering.targets]
    mirrored = rendering.image[:, ::-1]
    wrong = [
        read_code(
            mirrored,
            replace(target, x=settings.width - 1 - target.x, angle=-target.angle),
            settings,
        )
        for target in rendering.targets
    ]
    assert wrong != read


def test_targets_are_sorted_and_have_the_words_of_their_codes() -> None:
    targets = render(SMALL).targets
    assert [target.id for target in targets] == sorted({target.id for target in targets})
    table = family(SMALL.family)
    assert [target.code for target in targets] == [table.word(target.id) for target in targets]


@pytest.mark.parametrize('tilt', [0.0, 50.0, 70.0])
@pytest.mark.parametrize('seed', range(4))
def test_targets_are_whole_apart_and_of_the_size_asked_for(tilt: float, seed: int) -> None:
    settings = SceneSettings(
        width=640,
        height=480,
        targets=20,
        dot_radius=6.0,
        tilt=tilt,
        seed=seed,
        texture=0.0,
        focal_length=2.5,
    )
    targets = render(settings).targets
    places = np.array([(target.x, target.y) for target in targets])
    sizes = np.array([target.semi_major for target in targets])
    assert np.abs(sizes / settings.dot_radius - 1).max() < 0.11
    assert (places.min(axis=0) > 4.2 * sizes.min()).all()
    assert (places.max(axis=0) < np.array([639, 479]) - 4.2 * sizes.min()).all()
    gaps = np.linalg.norm(places[:, None] - places[None], axis=2)[np.triu_indices(20, 1)]
    assert gaps.min() > 2 * 4.2 * sizes.min()
    assert all(target.semi_minor <= target.semi_major for target in targets)
    assert all(-math.pi / 2 < target.angle <= math.pi / 2 for target in targets)


def test_codes_repeat_only_where_there_are_too_few() -> None:
    settings = SceneSettings(width=640, height=480, targets=170, dot_radius=3.0, seed=1)
    numbers = [target.id for target in render(settings).targets]
    assert len(set(numbers)) == 161
    assert np.unique(numbers, return_counts=True)[1].max() == 2


def test_the_same_seed_gives_the_same_image_whatever_the_threads() -> None:
    settings = replace(SMALL, light='lattice', distractors=4, tilt=20.0, seed=3)
    first = render(settings)
    threads = cv2.getNumThreads()
    try:
        cv2.setNumThreads(1)
        second = render(settings)
    finally:
        cv2.setNumThreads(threads)
    assert np.array_equal(first.image, second.image)
    assert first.targets == second.targets


def test_another_seed_gives_other_codes_places_and_light() -> None:
    first, second = (render(replace(SMALL, light='stripe', seed=seed)) for seed in (1, 2))
    assert {target.id for target in first.targets} != {target.id for target in second.targets}
    assert {target.x for target in first.targets}.isdisjoint(target.x for target in second.targets)
    correlation = np.corrcoef(first.image.ravel(), second.image.ravel())[0, 1]
    assert abs(correlation) < 0.9
    assert not np.array_equal(first.intrinsics, second.intrinsics)


def test_lit_white_has_the_exposure_and_shadow_the_ambient_light() -> None:
    settings = replace(IDEAL, targets=0, light='wide_stripe', ambient=0.12, exposure=220.0)
    values = render(settings).image
    lit, dark = np.percentile(values, (75, 25))
    assert lit == pytest.approx(220, abs=8)
    assert (dark / lit) ** 2.2 == pytest.approx(0.12 / 1.12, rel=0.25)
    assert values.max() < 255


def test_no_ambient_light_leaves_the_shadow_black() -> None:
    image = render(replace(IDEAL, light='wide_stripe', ambient=0.0, defocus=0.0)).image
    assert np.percentile(image, 20) == 0


def test_noise_is_that_of_the_electrons() -> None:
    settings = replace(IDEAL, targets=0, full_well=2000.0, read_noise=10.0)
    clean = light_of(render(replace(settings, full_well=0.0)))
    error = light_of(render(settings)) - clean
    expected = np.sqrt(clean / 2000 + (10 / 2000) ** 2)
    assert (error / expected).std() == pytest.approx(1.0, abs=0.03)
    assert abs((error / expected).mean()) < 0.02


@pytest.mark.parametrize('polarity', ['dark', 'bright'])
def test_the_contrast_of_the_print_is_as_told(polarity: str) -> None:
    settings = replace(IDEAL, polarity=polarity, black=0.1)
    rendering = render(settings)
    light = light_of(rendering)
    target = rendering.targets[0]
    dot = light[round(target.y), round(target.x)]
    gap = light[round(target.y), round(target.x + 1.6 * target.semi_major)]
    assert min(dot, gap) / max(dot, gap) == pytest.approx(0.1, rel=0.05)
    assert (dot < gap) == (polarity == 'dark')


def test_distractors_leave_the_targets_alone() -> None:
    plain = render(replace(IDEAL, distractors=0))
    cluttered = render(replace(IDEAL, distractors=5))
    assert plain.targets == cluttered.targets
    changed = np.abs(plain.image.astype(int) - cluttered.image) > 20
    assert changed.sum() > 200
    y, x = np.nonzero(changed)
    for target in plain.targets:
        assert np.hypot(x - target.x, y - target.y).min() > 4.2 * target.semi_major


@pytest.mark.parametrize('shift', [-1.5, 0.75, 2.0])
def test_ink_that_is_gained_makes_dots_larger_about_the_same_centres(shift: float) -> None:
    for settings, sign in ((IDEAL, 1), (replace(IDEAL, polarity='bright'), -1)):
        moved = replace(settings, edge_shift=shift, radius_spread=0.0)
        light = light_of(render(moved))
        plain = light_of(render(replace(moved, black=1.0)))
        share = (light / plain - moved.black) / (1 - moved.black)  # of white
        ink = 1 - share if sign == 1 else share
        y, x = np.mgrid[: ink.shape[0], : ink.shape[1]]
        for target in render(moved).targets:
            assert target.semi_major == pytest.approx(12, abs=0.01)
            dot = ink * (np.hypot(x - target.x, y - target.y) < 1.7 * 12)
            radius = math.sqrt(dot.sum() / math.pi)
            assert radius == pytest.approx(12 + sign * shift, abs=0.05)
            assert (dot * x).sum() / dot.sum() == pytest.approx(target.x, abs=0.05)
            assert (dot * y).sum() / dot.sum() == pytest.approx(target.y, abs=0.05)


def test_light_above_saturation_is_lost() -> None:
    usual, over = light_of(render(IDEAL)), light_of(render(replace(IDEAL, overexposure=4.0)))
    assert np.abs(over - np.minimum(4 * usual, 1)).max() <= 0.04
    assert (over == 1).mean() > 0.8
    assert usual.max() < 1


def test_targets_are_on_white_cards_before_a_darker_wall() -> None:
    settings = replace(IDEAL, width=640, wall=0.4, distractors=2)
    rendering = render(settings)
    light = light_of(rendering)
    assert np.median(light) == pytest.approx(0.4 * light.max(), rel=0.25)
    assert light.min() > 0.02  # distractors are as dark as any ink
    for target in rendering.targets:
        corners = [(1, 1), (1, -1), (-1, 1), (-1, -1)]
        gap = [light[round(target.y + 14 * v), round(target.x + 14 * u)] for u, v in corners]
        assert min(gap) > 2 * np.median(light)


def test_an_image_may_show_distractors_alone() -> None:
    rendering = render(replace(SMALL, targets=0, distractors=10))
    assert rendering.targets == ()
    assert rendering.image.min() < 80


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'ambient': -0.1}, r'ambient is -0\.1, accepted is a number from 0'),
        ({'targets': -1}, r'targets is -1, accepted is an integer of at least 0'),
        ({'targets': 100}, r'targets is 100, accepted is an integer from 0 to 6 with a dot_r'),
        ({'targets': 6.0}, r'targets is 6\.0, accepted is an integer'),
        ({'family': 'qr'}, r"family is 'qr', accepted is one of metashape12"),
        ({'light': 'disco'}, r"light is 'disco', accepted is one of normal, stripe"),
        ({'polarity': 'red'}, r"polarity is 'red', accepted is one of auto, dark, bright"),
        ({'dot_radius': math.nan}, r'dot_radius is nan, accepted is a number from 1'),
        ({'tilt': 75.0, 'focal_length': 1.0}, r'tilt is 75\.0, accepted is a number from 0 to 5'),
        ({'distortion': -0.3, 'focal_length': 0.6}, r'distortion is -0\.3, accepted .* of at l'),
        ({'edge_shift': 4.0}, r'edge_shift is 4\.0, accepted is a number from -3\.78 to 3\.78'),
        ({'seed': 0.5}, r'seed is 0\.5, accepted is an integer'),
    ],
)
def test_bad_settings_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(SMALL, **change)


def test_too_many_targets_for_a_steep_wall_are_refused() -> None:
    settings = SceneSettings(width=640, height=480, targets=80, dot_radius=6.0, tilt=66.0)
    with pytest.raises(ValueError, match=r'targets is 80, accepted is an integer from 0 to \d+ '):
        render(settings)


def test_too_many_distractors_are_refused() -> None:
    with pytest.raises(ValueError, match=r'distractors is 500, accepted is an integer from 0 to '):
        render(replace(SMALL, distractors=500))
