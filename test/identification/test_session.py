"""The settings of an identification, and the builder that every way in uses."""

from dataclasses import replace

import numpy as np
import pytest

from ahf_ros.base.settings.nested import flat_parameters, flat_values, updated
from ahf_ros.base.target import Target
from ahf_ros.families import DetectorSettings, create_detector
from ahf_ros.identification.filtering.settings import AdaptiveSettings
from ahf_ros.identification.session import create_identifier, identify
from ahf_ros.identification.session_settings import IdentificationSettings
from ahf_ros.nodes.settings import DetectorNodeSettings
from ahf_ros.scenes.scene import SceneSettings
from support.scenes import rendered
from support.square_markers import needs_square_markers

IMAGE = np.arange(400, dtype=np.uint8).reshape(20, 20)


def target(number: int, x: float = 5.0) -> Target:
    return Target(number, number, x, 5.0, 3.0, 3.0)


class Filtered:
    """A detector that is blind to the image as received, and measures centres in it."""

    name = 'filtered'
    family = 'metashape12'

    def __init__(self) -> None:
        self.drafts = 0

    def __call__(self, image: np.ndarray) -> list[Target]:
        return [] if image is IMAGE else [target(1)]

    def draft(self, image: np.ndarray) -> list[Target]:
        self.drafts += 1
        return self(image)

    def refine(self, image: np.ndarray, targets: list[Target]) -> list[Target]:
        assert image is IMAGE
        return [replace(it, x=7.5) for it in targets]


def test_values_are_settings_by_name_and_may_change_others() -> None:
    settings = IdentificationSettings(
        expected_targets=3,
        detection=DetectorSettings(family='aicon14'),
        adaptive=AdaptiveSettings(fusion=True),
    )
    assert updated(IdentificationSettings(), flat_values(settings)) == settings
    assert set(flat_values(settings)) == {it.name for it in flat_parameters(type(settings))}
    other = updated(settings, {'family': 'aruco_4x4_50', 'min_radius': 9})
    assert (other.detection.family, other.detection.min_radius) == ('aruco_4x4_50', 9.0)
    assert other.adaptive == settings.adaptive


def test_any_function_is_a_detector() -> None:
    found = identify(IMAGE, detector=lambda image: [target(2), target(1)], expected_targets=2)
    assert [it.id for it in found.targets] == [1, 2]
    assert (found.expected, found.filter.applied) == (2, False)


def test_what_a_detector_can_do_more_is_used() -> None:
    detector = Filtered()
    found = identify(IMAGE, detector=detector, expected_targets=1, threads=1)
    assert found.filter.applied
    assert [it.x for it in found.targets] == [7.5]
    assert detector.drafts == found.filter.evaluations - 1


def test_another_number_may_be_expected_of_one_image() -> None:
    identifier = create_identifier(detector=Filtered(), expected_targets=0, threads=1)
    assert identifier.identify(IMAGE).targets == ()
    assert identifier.identify(IMAGE, expected_targets=1).expected == 1
    assert identifier.identify(IMAGE).expected == 0


def test_an_identification_is_interrupted_between_two_trials() -> None:
    calls = []

    def interrupt() -> None:
        if len(calls) == 3:
            raise KeyboardInterrupt
        calls.append(1)

    def nothing(image: np.ndarray) -> list[Target]:
        return []

    identifier = create_identifier(
        detector=nothing, interrupt=interrupt, expected_targets=5, threads=1
    )
    with pytest.raises(KeyboardInterrupt):
        identifier.identify(IMAGE)


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        ({'expected': 5}, 'expected is not a parameter, accepted is one of detector, expected_t'),
        ({'expected_targets': -1}, 'expected_targets is -1, accepted is an integer from 0 to 1'),
        (
            {'expected_targets': 4, 'expected_ids': '1-3'},
            'expected_targets is 4 and expected_ids has 3 IDs; accepted with these is their numb',
        ),
        (
            {'expected_targets': 4, 'network_ids': '1-3'},
            'expected_targets is 4 and network_ids has 3 IDs; accepted with these is at most the',
        ),
        (
            {'expected_ids': '1-3', 'network_ids': '1-9'},
            "expected_ids is '1-3' and network_ids is '1-9', accepted is one of them",
        ),
        ({'network_ids': '1-x'}, "network_ids has '1-x', accepted are integers and ranges"),
        (
            {'family': 'metashape12', 'network_ids': '1-200'},
            'network_ids has 162, .*accepted are IDs of metashape12 from 1 to 161',
        ),
        ({'detector': 'magic'}, "detector is 'magic', accepted is one of auto, ring, "),
        ({'family': 'ring12'}, "family is 'ring12', accepted is one of metashape12, .*_36h11"),
        ({'detector': 'ring', 'family': 'aruco_4x4_50'}, "detector is 'ring' and family is 'aru"),
        ({'detector': 'command'}, "command '' is empty, accepted is a program"),
    ],
)
def test_what_is_not_accepted_is_named(values: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        create_identifier(**values)


def test_only_targets_of_the_detector_are_counted() -> None:
    message = "family is 'aicon12', accepted with estimate_expected is that of the detector, 'meta"
    with pytest.raises(ValueError, match=message):
        create_identifier(detector=Filtered(), family='aicon12', estimate_expected=True)
    assert create_identifier(detector=Filtered(), estimate_expected=True)


@pytest.mark.parametrize(
    'values',
    [
        {'family': 'metashape12'},
        pytest.param({'family': 'apriltag_36h11'}, marks=needs_square_markers),
        {'family': 'gsi', 'dot_radius': 5},
    ],
)
def test_all_families_are_looked_for_by_default_and_the_result_says_so(values: dict) -> None:
    scene = SceneSettings(
        **{'width': 640, 'height': 480, 'targets': 4, 'dot_radius': 12, **values}
    )
    shown = rendered(scene)
    found = identify(shown.image)
    assert found.looked_for == 'auto'
    assert [it.key for it in found] == [it.key for it in shown.targets]
    named = identify(shown.image, family=scene.family)
    assert (named.looked_for, len(named)) == (scene.family, 4)
    other = identify(shown.image, family='cctag3,dots')
    assert (other.looked_for, len(other)) == ('cctag3,dots', 0)
    own = identify(shown.image, detector=lambda image: [target(1)])
    assert own.looked_for == ''


def test_every_way_in_has_the_same_default() -> None:
    assert DetectorSettings().family == DetectorNodeSettings().identification.detection.family
    assert create_detector().family == create_identifier().identify(IMAGE).looked_for == 'auto'
