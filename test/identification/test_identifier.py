import threading
from dataclasses import replace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from ahf_ros.base.target import UNDECODED, Identification, Target, UndecodedTarget, count_codes
from ahf_ros.identification.filtering.genes import FIRST
from ahf_ros.identification.filtering.homomorphic import HomomorphicFilter, median_distance
from ahf_ros.identification.filtering.identifier import Identifier, is_mirrored
from ahf_ros.identification.filtering.settings import (
    EXTENDED,
    PUBLISHED,
    AdaptiveSettings,
    FilterSettings,
    GeneticSettings,
    TuningSettings,
)
from ahf_ros.identification.filtering.trials import CONFIRMED
from ahf_ros.identification.session import create_identifier
from ahf_ros.scenes.scene import SceneSettings, render

COUNT = 144
SHORT = AdaptiveSettings(fusion=False, genetic=GeneticSettings(max_evaluations=30))


def identify(
    image: np.ndarray, detector: Any, expected: int | None, settings: Any = None, **parts: Any
) -> Identification:
    return Identifier(detector, settings, **parts).identify(image, expected_targets=expected)


def dotted(fall_off: Any) -> np.ndarray:
    """Return bright single pixels on gray paper in a light that falls off to the right."""
    image = np.full((96, 96), 40.0)
    image[4::8, 4::8] = 250
    return np.rint(image * np.exp(-fall_off * np.arange(96) / 96)).astype(np.uint8)


BRIGHT, DIM = dotted(0.1), dotted(3.0)


def target(number: int, x: float = 1.0, y: float = 2.0) -> Target:
    return Target(number, max(number, 0), x, y, 1.0, 1.0)


class Dots:
    """A detector that needs even light: it sees the dots above half of the range."""

    def __init__(self) -> None:
        self.calls = 0
        self.images = []
        self.lock = threading.Lock()

    def lit(self, image: np.ndarray) -> np.ndarray | list[Any]:
        with self.lock:
            self.calls += 1
            self.images.append(image)
        lit = image >= 128
        return np.argwhere(lit) if lit.mean() <= 0.1 else []

    def __call__(self, image: np.ndarray) -> list[Target]:
        return [
            target(int(row // 8 * 12 + column // 8 + 1), float(column), float(row))
            for row, column in self.lit(image)
        ]


def test_the_edge_shift_of_an_image_is_the_median_of_its_decoded_targets() -> None:
    shifts = {UNDECODED: 9.0, 1: -0.5, 2: -0.75, 3: None, 4: 2.0}
    targets = [replace(target(number), edge_shift=it) for number, it in shifts.items()]
    assert identify(BRIGHT, lambda _: targets, 0).edge_shift == -0.5
    assert identify(BRIGHT, lambda _: targets[:1], 0).edge_shift is None


@pytest.mark.parametrize('asked', [False, True])
def test_targets_that_share_an_id_are_named_and_not_identified(asked: bool) -> None:
    contested = {'reason': 'contested', 'likely_family': 'a'}
    twins = [
        UndecodedTarget(UNDECODED, 0, x, 5.0, 1.0, 1.0, likely_id=7, **contested)
        for x in (5.0, 9.0)
    ]
    other = UndecodedTarget(UNDECODED, 0, 20.0, 5.0, 1.0, 1.0, likely_id=8, **contested)
    identifier = Identifier(lambda _: [*twins, other, target(3)], contested=asked)
    found = identifier.identify(BRIGHT)
    assert (found.count, found.repeated) == (1, tuple(twins))
    assert [it.id for it in found] == [UNDECODED] * (3 * asked) + [3]


def test_the_image_as_received_comes_first_and_may_be_enough() -> None:
    detector = Dots()
    result = identify(BRIGHT, detector, COUNT)
    assert result.count == result.expected == COUNT
    assert (result.filter.applied, result.filter.evaluations, detector.calls) == (False, 1, 1)
    assert result.search is None
    assert detector.images[0] is BRIGHT


def test_a_filter_is_found_where_the_light_defeats_the_detector() -> None:
    assert count_codes(Dots()(DIM)) < COUNT / 2
    detector = Dots()
    published = AdaptiveSettings(tuning=TuningSettings(search=PUBLISHED), threads=1)
    result = identify(DIM, detector, COUNT, published)
    state = result.filter
    assert result.count == COUNT
    assert state.applied
    assert state.evaluations == detector.calls
    assert state.generations >= 1
    trace = result.search
    assert (trace.reason, trace.discrepancies[-1], min(trace.discrepancies)) == ('found', 0, 0)
    assert len(trace.gamma_high) == len(trace.attenuation) == state.evaluations - 1
    assert trace.generations[-1] == len(trace.discrepancies)
    assert (trace.gamma_high[-1], trace.cutoff[-1]) == (state.gamma_high, state.cutoff)
    assert state.cutoff == median_distance(96, 96)
    assert state.attenuation == state.gamma_high - state.gamma_low
    filtered = HomomorphicFilter(DIM).filtered(state.gamma_high, state.gamma_low)
    assert tuple(Dots()(filtered)) == tuple(sorted(result.targets, key=lambda it: (it.y, it.x)))


def test_targets_are_sorted_by_id_undecoded_first() -> None:
    found = [target(5), target(UNDECODED), target(2)]
    result = identify(DIM, lambda image: found, 2)
    assert [it.id for it in result.targets] == [UNDECODED, 2, 5]
    assert result.count == 2


def without_time(found: Identification) -> Identification:
    return replace(found, filter=replace(found.filter, duration=0.0))


@pytest.mark.parametrize('threads', [2, 4])
@pytest.mark.parametrize(
    ('expected', 'more'),
    [(COUNT, {}), (COUNT + 1, {}), (COUNT + 1, {'coarse': True, 'fusion': True})],
)
def test_the_result_does_not_depend_on_the_threads(
    threads: int, expected: int | None, more: Any
) -> None:
    one, others = (
        identify(DIM, Dots(), expected, replace(SHORT, threads=number, **more))
        for number in (1, threads)
    )
    assert without_time(others) == without_time(one)
    assert not more or one.filter.evaluations == 1 + 30 + CONFIRMED


def test_the_best_result_wins_where_no_filter_shows_all() -> None:
    results = []

    def detector(image: np.ndarray) -> list[Target]:
        results.append(Dots()(image))
        return results[-1]

    result = identify(DIM, detector, COUNT + 1, replace(SHORT, threads=1))
    smallest = min(abs(COUNT + 1 - count_codes(found)) for found in results)
    assert COUNT + 1 - result.count == smallest
    assert result.filter.evaluations == len(results) == 31


def test_the_image_as_received_wins_a_tie() -> None:
    result = identify(DIM, lambda image: [target(1)], 5, SHORT)
    assert not result.filter.applied
    assert (result.filter.gamma_high, result.filter.gamma_low) == (1.0, 1.0)
    assert result.filter.evaluations == 31


@pytest.mark.parametrize('threads', [1, 3])
def test_a_search_in_vain_ends_with_the_patience_of_the_detector(threads: int) -> None:
    settings = AdaptiveSettings(threads=threads)
    identifier = Identifier(lambda image: [target(1)], settings, patience=2)
    assert identifier.identify(DIM, expected_targets=5).filter.evaluations == 3
    assert identifier.last_search.reason == 'patience'
    assert identifier.last_search.tried == FIRST[:2]


def test_the_settings_come_before_the_patience_of_the_detector() -> None:
    settings = AdaptiveSettings(genetic=GeneticSettings(patience=100))
    identifier = Identifier(lambda image: [target(1)], settings, patience=2)
    assert identifier.identify(DIM, expected_targets=5).filter.evaluations == 51


@pytest.mark.parametrize(
    ('changes', 'patience', 'agreed'),
    [
        ({}, 0, True),
        ({'genetic': GeneticSettings(patience=3)}, 2, True),
        ({}, 3, False),
        ({'fusion': False}, 0, False),
        ({'tuning': TuningSettings(search='published')}, 0, False),
    ],
    ids=['default', 'patience set', 'patience of the detector', 'switched off', 'published'],
)
def test_whether_filters_have_to_agree(changes: Any, patience: int, agreed: bool) -> None:
    """Every filter shows another target beside the one that all show."""
    numbers = iter(range(2, 1000))

    def detector(image: np.ndarray) -> list[Target]:
        return [] if image is DIM else [target(1), target(next(numbers), 9.0)]

    settings = AdaptiveSettings(threads=1, **changes)
    result = Identifier(detector, settings, patience=patience).identify(DIM, expected_targets=9)
    assert result.filter.applied
    assert [it.id for it in result.targets] == ([1] if agreed else [1, 2])


def test_a_filter_that_shows_more_keeps_a_search_going() -> None:
    numbers = iter((3, 3, 4))
    identifier = Identifier(
        lambda image: [target(number) for number in range(next(numbers, 4))],
        AdaptiveSettings(threads=1),
        patience=2,
    )
    result = identifier.identify(DIM, expected_targets=9)
    assert (result.count, result.filter.evaluations) == (4, 5)


def test_too_many_targets_are_as_bad_as_too_few() -> None:
    def detector(image: np.ndarray) -> list[Target]:
        number = 7 if image is DIM else 4
        return [target(index) for index in range(number)]

    result = identify(DIM, detector, 5, SHORT)
    assert (result.count, result.filter.applied) == (4, True)


@pytest.mark.parametrize(('expected', 'ahf'), [(0, True), (COUNT, False)])
def test_without_an_expected_number_or_switched_off_nothing_is_filtered(
    expected: int | None, ahf: bool
) -> None:
    detector = Dots()
    result = identify(DIM, detector, expected, AdaptiveSettings(ahf=ahf))
    assert (result.expected, detector.calls, result.filter.applied) == (expected, 1, False)


def estimate_of(count: int) -> Mock:
    """Return an estimate that is always the same."""
    return Mock(return_value=count)


def test_an_estimate_stands_in_for_an_unknown_number() -> None:
    given = identify(DIM, Dots(), COUNT, SHORT)
    estimated = identify(DIM, Dots(), 0, SHORT, estimate=estimate_of(COUNT))
    assert (given.expected, given.estimated) == (COUNT, False)
    assert without_time(estimated) == replace(without_time(given), estimated=True)


def test_a_given_number_is_not_estimated() -> None:
    estimate = estimate_of(3)
    result = identify(BRIGHT, Dots(), COUNT, estimate=estimate)
    assert (result.expected, result.estimated, estimate.call_count) == (COUNT, False, 0)


def test_no_estimate_is_below_what_is_identified_at_once() -> None:
    result = identify(BRIGHT, Dots(), 0, estimate=estimate_of(7))
    assert (result.expected, result.filter.applied) == (COUNT, False)


def test_an_estimate_of_none_filters_nothing() -> None:
    ramp = np.arange(96, dtype=np.uint8) + np.zeros((96, 1), np.uint8)
    result = identify(ramp, Dots(), 0, SHORT, estimate=estimate_of(0))
    assert (result.expected, result.estimated, result.filter.evaluations) == (0, True, 1)


@pytest.mark.parametrize('surplus', [0, 1])
def test_a_steady_stream_is_estimated_once_and_not_searched_again(surplus: int) -> None:
    detector, estimate = Dots(), estimate_of(COUNT + surplus)
    identifier = Identifier(detector, SHORT, estimate=estimate)
    first = identifier.identify(DIM, expected_targets=0)
    assert first.filter.applied
    calls = detector.calls
    second = identifier.identify(DIM, expected_targets=0)
    assert (detector.calls - calls, estimate.call_count) == (1, 1)
    assert (second.targets, second.expected) == (first.targets, COUNT + surplus)
    assert (second.filter.evaluations, identifier.last_search) == (1, None)


def test_other_results_are_estimated_again() -> None:
    estimate = estimate_of(COUNT)
    identifier = Identifier(Dots(), SHORT, estimate=estimate)
    fewer = DIM.copy()
    fewer[:40, :40] = DIM[0, :40]
    for image, calls in ((DIM, 1), (fewer, 2), (fewer, 2)):
        identifier.identify(image, expected_targets=0)
        assert estimate.call_count == calls
    identifier.reset()
    identifier.identify(fewer, expected_targets=0)
    assert estimate.call_count == 3


@pytest.mark.parametrize('estimate', [-1, 2.0, None])
def test_an_estimate_that_is_no_number_is_refused(estimate: float | None) -> None:
    with pytest.raises(ValueError, match=r'estimate is .*, accepted is an integer of at least 0'):
        identify(DIM, Dots(), 0, SHORT, estimate=estimate_of(estimate))


@pytest.mark.parametrize('kind', [np.uint16, np.float32, np.float64])
def test_a_detector_sees_8_bit_images_whatever_was_received(kind: Any) -> None:
    detector = Dots()
    result = identify(DIM.astype(kind) * 100, detector, COUNT)
    assert {image.dtype for image in detector.images} == {np.dtype(np.uint8)}
    assert result.count == COUNT


def test_centres_are_refined_in_the_image_as_received() -> None:
    def refine(image: np.ndarray, targets: list[Target]) -> list[Target]:
        assert image is DIM
        return [replace(it, x=it.x + 0.25) for it in targets]

    published = AdaptiveSettings(tuning=TuningSettings(search=PUBLISHED))
    result = identify(DIM, Dots(), COUNT, published, refine=refine)
    assert result.filter.applied
    assert [it.x for it in result.targets[:2]] == [4.25, 12.25]


def test_centres_are_refined_from_the_8_bit_version_of_an_image_and_not_as_received() -> None:
    for image, count in ((BRIGHT, COUNT), (BRIGHT.astype(np.uint16) * 100, 1)):
        result = identify(image, Dots(), 0, refine=lambda image, targets: [target(9)])
        assert result.count == count


def test_a_stream_begins_with_the_filter_that_worked_last_until_reset() -> None:
    detector = Dots()
    identifier = Identifier(detector)
    first = identifier.identify(DIM, expected_targets=COUNT)
    assert identifier.last_search.reason == 'found'
    detector.calls = 0
    second = identifier.identify(DIM, expected_targets=COUNT)
    assert second.targets == first.targets
    assert (second.filter.evaluations, second.filter.generations, detector.calls) == (1, 0, 1)
    assert second.filter.gamma_low == first.filter.gamma_low
    assert identifier.last_search is None
    identifier.reset()
    again = identifier.identify(DIM, expected_targets=COUNT)
    assert again.filter.evaluations == first.filter.evaluations > 1
    assert again.targets == first.targets


def test_a_filter_that_no_longer_works_is_given_up() -> None:
    def detector(image: np.ndarray) -> list[Target]:
        return Dots()(image) if image is BRIGHT or even else []

    even = True
    identifier = Identifier(detector, SHORT)
    assert identifier.identify(DIM, expected_targets=COUNT).filter.applied
    even = False
    result = identifier.identify(BRIGHT, expected_targets=COUNT)
    assert (result.count, result.filter.applied, result.filter.evaluations) == (COUNT, False, 2)
    assert identifier.identify(BRIGHT, expected_targets=COUNT).filter.evaluations == 1


def test_a_search_begins_with_the_filter_that_worked_last_and_does_not_repeat_it() -> None:
    detector = Dots()
    identifier = Identifier(detector, replace(SHORT, threads=1))
    identifier.identify(DIM, expected_targets=COUNT)
    detector.images.clear()
    result = identifier.identify(DIM, expected_targets=COUNT + 1)
    assert result.count == COUNT
    assert len(detector.images) == result.filter.evaluations == 31
    shown = {image.tobytes() for image in detector.images if image is not DIM}
    assert len(shown) == 30


def test_the_clock_measures_the_duration_and_limits_the_search() -> None:
    seconds = iter(range(1000))
    settings = AdaptiveSettings(genetic=GeneticSettings(max_duration=5.0), threads=1)
    identifier = Identifier(lambda image: [], settings, clock=lambda: float(next(seconds)))
    result = identifier.identify(DIM, expected_targets=COUNT)
    assert identifier.last_search.reason == 'duration'
    assert result.filter.evaluations == 6
    assert (result.filter.duration, identifier.last_search.duration) == (9.0, 7.0)


@pytest.mark.parametrize('threads', [1, 2])
@pytest.mark.parametrize('filtered_only', [False, True])
def test_what_the_detector_raises_is_raised(threads: int, filtered_only: bool) -> None:
    def detector(image: np.ndarray) -> list[Target]:
        if image is DIM and filtered_only:
            return []
        raise RuntimeError('no licence')

    with pytest.raises(RuntimeError, match='no licence'):
        identify(DIM, detector, COUNT, replace(SHORT, threads=threads))


def test_targets_with_the_same_id_count_once_and_are_passed_on() -> None:
    found = [target(3), target(3, x=50.0), target(4)]
    result = identify(DIM, lambda image: found, 2)
    assert (result.count, len(result.targets), result.filter.evaluations) == (2, 3, 1)


def test_what_is_no_list_of_targets_is_refused() -> None:
    with pytest.raises(ValueError, match='detector returned None, accepted is a list of targets'):
        identify(DIM, lambda image: None, COUNT)
    with pytest.raises(ValueError, match='refine of detector returned None'):
        identify(DIM, Dots(), COUNT, refine=lambda image, targets: None)


@pytest.mark.parametrize('expected', [-1, 2.0, True, '54'])
def test_an_expected_number_that_is_none_is_refused(expected: Any) -> None:
    with pytest.raises(ValueError, match=r'expected_targets is .*, accepted is an integer'):
        identify(DIM, Dots(), expected)


@pytest.mark.parametrize(
    'image',
    [
        np.zeros((96, 96), np.uint8),
        np.zeros((1, 1), np.uint8),
        np.zeros((0, 0), np.uint8),
        np.full((96, 96), np.nan),
        'photo.jpg',
    ],
)
def test_what_is_not_an_image_is_refused_before_the_detector_sees_it(image: np.ndarray) -> None:
    detector = Dots()
    with pytest.raises(ValueError, match=r'^image '):
        identify(image, detector, COUNT)
    assert detector.calls == 0


def test_one_filter_is_a_range_too() -> None:
    one = TuningSettings(
        search=PUBLISHED,
        gamma_high_min=1.2,
        gamma_high_max=1.2,
        gamma_low_min=0.25,
        gamma_low_max=0.25,
    )
    settings = AdaptiveSettings(tuning=one)
    result = identify(DIM, lambda image: [target(1)] if image is not DIM else [], 5, settings)
    assert (result.filter.gamma_high, result.filter.gamma_low) == (1.2, 0.25)
    assert result.filter.evaluations == 2


def test_the_settings_of_the_filter_reach_it() -> None:
    seen = []
    settings = replace(SHORT, filter=FilterSettings(black_percentile=40.0), threads=1)
    identify(DIM, lambda image: seen.append(image) or [], 5, settings)
    assert all((image == 0).mean() > 0.3 for image in seen[1:])


def listed(shown: Any) -> list[Target]:
    """Return the targets of a detector that sees another one in the image as received."""
    return [target(number) for number in ([1, 2, 99] if shown is DIM else [1, 2, 3])]


def test_ids_that_are_listed_beat_a_number() -> None:
    """IDs that are not listed neither count nor choose a filter."""
    without = identify(DIM, listed, 3)
    assert [target.id for target in without.targets] == [1, 2, 99]  # three, as expected
    settings = AdaptiveSettings(expected_ids='1-3')
    found = identify(DIM, listed, 50, settings)
    assert [target.id for target in found.targets] == [1, 2, 3]
    assert (found.expected, found.filter.applied) == (3, True)
    assert (found.expected_ids, without.expected_ids) == ((1, 2, 3), ())
    assert (found.other_ids, without.other_ids) == ((), ())
    seen = identify(DIM, listed, 0, AdaptiveSettings(expected_ids='1-2'))
    assert [target.id for target in seen.targets] == [1, 2]
    assert (seen.expected, seen.filter.evaluations, seen.filter.applied) == (2, 1, False)
    assert seen.other_ids == (99,)
    only = identify(DIM, listed, 0, replace(settings, ahf=False))
    assert [target.id for target in only.targets] == [1, 2]
    with pytest.raises(ValueError, match="expected_ids has '3-1', accepted are integers"):
        AdaptiveSettings(expected_ids='3-1')


def test_ids_of_a_network_are_no_number_of_targets() -> None:
    network = AdaptiveSettings(network_ids='1-50')
    found = identify(DIM, listed, 0, network)
    assert [target.id for target in found] == [1, 2]
    assert (found.expected, found.expected_ids, found.other_ids) == (0, (), (99,))
    assert (found.filter.evaluations, found.filter.applied) == (1, False)
    numbered = identify(DIM, listed, 3, network)  # N is not their number, but may be given
    assert [target.id for target in numbered] == [1, 2, 3]
    assert (numbered.expected, numbered.filter.applied) == (3, True)


def test_an_extended_search_tries_other_cutoffs_and_says_which() -> None:
    seen = []

    def detector(image: np.ndarray) -> list[Target]:
        seen.append(image)
        return [target(1)] if len(seen) == 20 else []

    extended = AdaptiveSettings(tuning=TuningSettings(search=EXTENDED), threads=1)
    state = identify(DIM, detector, 1, extended).filter
    assert state.evaluations == 20
    assert state.attenuation > 1.5 * (state.gamma_high - state.gamma_low)
    chosen = state.gamma_high, state.gamma_low, state.cutoff, state.attenuation
    assert np.array_equal(HomomorphicFilter(DIM).filtered(*chosen), seen[-1])


class Drafting(Dots):
    """A detector whose drafts are a pixel off, and which can put that right."""

    def __init__(self) -> None:
        super().__init__()
        self.drafts = 0

    def draft(self, image: np.ndarray) -> list[Target]:
        with self.lock:
            self.drafts += 1
        return [replace(it, x=it.x + 1) for it in Dots()(image)]

    def refine(self, image: np.ndarray, targets: list[Target]) -> list[Target]:
        return [replace(it, x=it.x - 1) for it in targets]


def test_filters_are_tried_with_drafts_where_centres_are_refined() -> None:
    detector = Drafting()
    result = identify(DIM, detector, COUNT, refine=detector.refine, draft=detector.draft)
    plain = identify(DIM, Dots(), COUNT)
    assert result.filter.applied
    assert result.targets == plain.targets
    assert (detector.calls, detector.drafts >= result.filter.evaluations - 1) == (1, True)


def test_there_are_no_drafts_without_a_refinement_or_a_filter() -> None:
    detector = Drafting()
    for image, parts in ((BRIGHT, {'refine': detector.refine}), (DIM, {})):
        found = identify(image, detector, COUNT, draft=detector.draft, **parts)
        assert found.targets == identify(image, Dots(), COUNT).targets
    assert detector.drafts == 0


class Blocks(Dots):
    """The same on paper with dots of two pixels by two; each half of the image shows one."""

    def __call__(self, image: np.ndarray) -> list[Target]:
        cell = image.shape[0] // 12
        numbers = {int(row // cell * 12 + column // cell) for row, column in self.lit(image)}
        return [target(number + 1) for number in sorted(numbers)]


def test_a_coarse_search_confirms_its_best_filters_on_the_whole_image() -> None:
    large = np.kron(DIM, np.ones((2, 2), np.uint8))
    detector = Blocks()
    published = TuningSettings(search=PUBLISHED)
    settings = replace(SHORT, coarse=True, threads=1, tuning=published)
    result = identify(large, detector, COUNT, settings)
    shapes = [image.shape for image in detector.images]
    coarse = shapes.count((96, 96))
    whole = shapes.count((192, 192))
    assert result.count == COUNT
    assert (shapes[0], shapes[-1]) == ((192, 192), (192, 192))
    assert result.filter.evaluations == coarse + whole
    assert coarse >= 1
    assert 2 <= whole <= 1 + CONFIRMED


def targets_with(*numbers: int) -> list[Target]:
    return [target(number) for number in numbers]


def mirrored(target: Target) -> int | None:
    """Return 7 for 3, 3 for 7, and so on; 5 is the same, and from 10 on nothing is known."""
    return 10 - target.id if target.id < 10 else None


def test_most_ids_decide() -> None:
    assert is_mirrored(targets_with(7, 8, 9), {1, 2, 3}, mirrored)
    assert is_mirrored(targets_with(7, 8, 9, 3, 20), {1, 2, 3}, mirrored)
    assert not is_mirrored(targets_with(1, 2, 3), {1, 2, 3}, mirrored)
    assert not is_mirrored(targets_with(1, 2, 8, 9), {1, 2, 3}, mirrored)


def test_what_cannot_tell_does_not() -> None:
    assert not is_mirrored(targets_with(7, 8, 9), (), mirrored)  # any ID may be there
    assert not is_mirrored(targets_with(7, 8), {2, 3}, mirrored)  # too few
    assert not is_mirrored(targets_with(11, 12, 13), {1, 2, 3}, mirrored)  # others
    assert not is_mirrored(targets_with(9, UNDECODED, UNDECODED), {1, 11}, mirrored)
    assert not is_mirrored([], {1, 2, 3}, mirrored)


def test_a_mirrored_image_of_expected_targets_is_said_to_be_one() -> None:
    rendering = render(SceneSettings(width=640, height=480, targets=8, dot_radius=10, seed=3))
    ids = ','.join(str(target.id) for target in rendering.targets)
    identifier = create_identifier(family='metashape12', expected_ids=ids, ahf=False)
    assert not identifier.identify(rendering.image).mirrored
    mirrored = rendering.image[:, ::-1].copy()
    found = identifier.identify(mirrored)
    assert found.mirrored
    assert found.count < 4 and found.expected == 8
    assert not create_identifier(family='metashape12').identify(mirrored).mirrored
    assert not identifier.identify(rendering.image[::-1, ::-1].copy()).mirrored  # upside down
