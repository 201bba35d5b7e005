"""The traditional detector: what it reads, what it refuses, and that it needs the filter."""

from dataclasses import asdict

import cv2
import numpy as np
import pytest

from ahf_ros.base.target import UNDECODED, Target
from ahf_ros.families import create_detector
from ahf_ros.files.image_files import read_image
from ahf_ros.files.truth_files import read_truth
from ahf_ros.identification.filtering.genes import BEGINNING, tuned
from ahf_ros.identification.filtering.homomorphic import HomomorphicFilter
from ahf_ros.scenes.evaluation import score
from ahf_ros.scenes.scene import Rendering
from support.photographs import PANEL, needs_photographs
from support.scenes import counted, relative_errors, rendering

SIZE = {'width': 640, 'height': 480, 'targets': 6, 'dot_radius': 10.0, 'seed': 3}


def scene(**changes: object) -> Rendering:
    return rendering(**SIZE | changes)


def identified(image: np.ndarray, **settings: object) -> list[Target]:
    return create_detector('traditional', **settings)(image)


@pytest.mark.parametrize('polarity', ['dark', 'bright'])
def test_refinement_starts_from_what_a_filter_shows(polarity: str) -> None:
    shown = scene(polarity=polarity, light='stripe', ambient=1.0)
    detector = create_detector('traditional')
    filtered = HomomorphicFilter(shown.image).filtered(1.2, 0.25)
    found = detector(filtered)
    assert len(found) >= 5
    assert score(shown, found).rmse[2] < 1.0
    assert score(shown, detector.refine(shown.image, found)).rmse[2] < 0.05


@pytest.mark.parametrize(
    'changes',
    [
        {'dot_radius': 5.0, 'targets': 12},
        {'dot_radius': 30.0, 'targets': 2, 'width': 800},
        {'tilt': 60.0, 'dot_radius': 14.0, 'targets': 4},
    ],
    ids=['small', 'large', 'oblique'],
)
def test_sizes_and_views(changes: dict[str, float]) -> None:
    shown = scene(**changes)
    found = identified(shown.image)
    assert counted(shown, found) == (changes['targets'], 0, 0)
    assert score(shown, found).rmse[2] < 0.08


def test_the_centre_is_the_physical_one_and_the_covariance_honest() -> None:
    shown = scene(width=2000, height=1500, targets=40, tilt=55.0, dot_radius=16.0)
    squares = relative_errors(shown, identified(shown.image))
    assert len(squares) >= 38
    assert 1 < np.mean(squares) < 4


def test_stripes_defeat_it_and_the_filter_restores_it() -> None:
    size = {'width': 1600, 'height': 1200, 'targets': 12, 'seed': 1}
    shown = rendering(**size, light='stripe', ambient=0.3)
    assert score(shown, identified(shown.image)).right <= 4
    filtered = HomomorphicFilter(shown.image).filtered(1.2, 0.25)
    assert counted(shown, identified(filtered)) == (12, 0, 0)


@pytest.mark.parametrize('light', ['stripe', 'lattice'])
def test_small_targets_in_deep_shadow_are_read_through_a_filter(light: str) -> None:
    shown = rendering(
        width=1600, height=1066, targets=24, dot_radius=10, light=light, ambient=0.12
    )
    assert score(shown, identified(shown.image)).right <= 4
    gains = tuned(shown.image.shape, BEGINNING[0])
    found = identified(HomomorphicFilter(shown.image).filtered(**asdict(gains)))
    right, wrong, false = counted(shown, found)
    assert right >= 16
    assert (wrong, false) == (0, 0)


def test_targets_are_of_one_colour_that_of_most() -> None:
    """Bright spots between shadows look like bright targets."""
    dark, bright = scene(targets=4), scene(targets=2, polarity='bright', seed=5)
    both = np.hstack([dark.image, bright.image])
    assert [it.id for it in identified(both)] == [it.id for it in dark.targets]
    found = identified(both, polarity='bright')
    assert [it.id for it in found] == [it.id for it in bright.targets]


@pytest.mark.parametrize(
    'settings',
    [{'polarity': 'bright'}, {'min_radius': 12.0}, {'max_radius': 8.0}, {'family': 'metashape14'}],
)
def test_what_is_not_asked_for_is_not_reported(
    settings: dict[str, float] | dict[str, str],
) -> None:
    assert identified(scene().image, **settings) == []


def test_dots_without_a_code_are_reported_on_request() -> None:
    image = np.full((200, 300), 220, np.uint8)
    cv2.circle(image, (90, 100), 10, 30, -1)
    cv2.circle(image, (210, 100), 10, 30, -1)
    assert identified(image) == []
    found = identified(image, report_undecoded=True)
    left, right = sorted(found, key=lambda target: target.x)
    assert (left.id, left.code, left.confidence) == (UNDECODED, 0, 0.0)
    assert (left.x, left.y) == pytest.approx((90, 100), abs=0.05)
    assert (right.x, right.y) == pytest.approx((210, 100), abs=0.05)


def test_sectors_of_a_decoded_target_are_not_reported() -> None:
    shown = scene(dot_radius=14.0, targets=4)
    found = identified(shown.image, report_undecoded=True)
    assert [target.id for target in found] == [target.id for target in shown.targets]


def test_an_id_is_reported_once() -> None:
    shown = scene()
    twice = np.hstack([shown.image, shown.image])
    ids = [target.id for target in identified(twice)]
    assert ids == [target.id for target in shown.targets]
    found = identified(twice, report_undecoded=True)
    assert [target.id for target in found] == [UNDECODED] * 6 + ids


def test_a_target_cut_by_the_frame_is_not_decoded() -> None:
    shown = scene()
    cut = min(shown.targets, key=lambda target: target.x)
    image = shown.image[:, round(cut.x - 2.5 * cut.semi_major) :]
    assert cut.id not in {target.id for target in identified(image)}


def test_noise_shows_no_targets() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (600, 800)).astype(np.uint8)
    assert identified(noise[:16, :16]) == []  # the smallest image
    assert identified(noise, report_undecoded=True) == []
    assert identified(cv2.GaussianBlur(noise, (0, 0), 5) * 4) == []


@needs_photographs
def test_a_real_panel() -> None:
    truth = read_truth(PANEL / 'truth.csv')['043_0021.png']
    image = read_image(PANEL / '043_0021.png')
    figures = score(truth, identified(image, family='aicon14'))
    assert (figures.wrong, figures.false_positives) == (0, 0)
    assert figures.right >= 70  # measured: 70 of 71
    assert figures.rmse[2] < 0.03  # px; measured: 0.025
