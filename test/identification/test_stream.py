"""A sequence of images that is identified in order."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ahf_ros.families import create_detector
from ahf_ros.families.contract import DetectorSettings, Unavailable
from ahf_ros.identification.session import create_identifier
from ahf_ros.identification.session_settings import IdentificationSettings
from ahf_ros.identification.stream import (
    SLIDING,
    Answer,
    Frame,
    Kind,
    Remark,
    StackSettings,
    Stream,
    Window,
    identify_parts,
    unmoved_parts,
)
from ahf_ros.scenes.scene import SceneSettings, render

SCENE = SceneSettings(
    width=480, height=360, targets=4, dot_radius=12, light='stripe', ambient=0.02, phases=4, seed=2
)


def gathered(window: Window[str], *added: tuple[str, str, int]) -> list[tuple[str, int, str]]:
    return [
        (''.join(stack.items), stack.fresh, stack.reason)
        for item in added
        for stack in window.add(*item)
    ]


def stream(names: str) -> list[tuple[str, str, int]]:
    return [(name, 'mono8', number) for number, name in enumerate(names)]


def test_a_tumbling_window_gives_each_image_to_one_stack() -> None:
    window: Window[str] = Window(StackSettings(stack=3))
    assert gathered(window, *stream('abcdefg')) == [('abc', 3, ''), ('def', 3, '')]
    assert window.fresh == 1
    assert [(stack.items, stack.reason) for stack in window.end('the bag ends')] == [
        (('g',), '1 of 3 images: the bag ends')
    ]
    assert window.end('the bag ends') == []


def test_a_sliding_window_answers_every_image_once_it_is_full() -> None:
    window: Window[str] = Window(StackSettings(stack=3, stack_window=SLIDING))
    assert gathered(window, *stream('abcde')) == [('abc', 3, ''), ('bcd', 1, ''), ('cde', 1, '')]
    assert window.end('no more') == []


@pytest.mark.parametrize('window', ['tumbling', SLIDING])
@pytest.mark.parametrize(
    ('third', 'reason'),
    [
        (('c', 'mono16', 2), '2 of 3 images: the next image is mono16, these are mono8'),
        (('c', 'mono8', -2_000_000_000), '2 of 3 images: the stamp of the next image is 2'),
    ],
)
def test_images_that_do_not_belong_together_begin_a_new_stack(
    window: Any, third: tuple[str, str, int], reason: str
) -> None:
    gathering: Window[str] = Window(StackSettings(stack=3, stack_window=window))
    _, kind, time = third
    rest = [('d', kind, time), ('e', kind, time)]
    (first, full) = gathered(gathering, *stream('ab'), third, *rest)
    assert first[:2] == ('ab', 2)
    assert first[2].startswith(reason)
    assert full == ('cde', 3, '')


def test_single_images_are_never_held_back() -> None:
    window: Window[str] = Window(StackSettings())
    added = [('a', 'mono8', 5), ('b', 'rgb8', 3)]
    assert gathered(window, *added) == [('a', 1, ''), ('b', 1, '')]


def test_a_stack_identifies_what_no_image_does() -> None:
    images = [render(SCENE, phase).image for phase in range(4)]
    truth = {target.id for target in render(SCENE).targets}
    settings = StackSettings(stack=4)
    identifier = create_identifier(family='metashape12', expected_targets=4)
    ((part, stack, found),) = identify_parts(identifier, images, settings)
    assert (part.images, part.split, stack.shape) == (range(4), '', (360, 480))
    assert {target.id for target in found.targets} == truth


def test_a_stack_is_split_where_the_scene_moved() -> None:
    scene = replace(SCENE, light='normal', phases=1)
    still = render(scene).image
    images = [still, still, np.roll(still, 4, axis=1), np.roll(still, 4, axis=1)]
    first, second = unmoved_parts(images)
    assert (first.images, second.images) == (range(2), range(2, 4))
    assert second.split.startswith('the scene moved by 4.0')
    assert second.split.endswith('before image 3 of the stack')
    assert [part.images for part in unmoved_parts(images, look_for_movement=False)] == [range(4)]
    identifier = create_identifier(family='metashape12', expected_targets=4)
    parts = list(identify_parts(identifier, images, StackSettings(stack=4)))
    places = [found.targets[0].x for _, _, found in parts]
    assert abs(places[1] - places[0] - 4) < 0.02
    fresh = identify_parts(identifier, images, StackSettings(stack=4), fresh=1)
    assert [part.images for part, _, _ in fresh] == [range(2, 4)]


@pytest.mark.parametrize(('shift', 'expected', 'parts'), [(0, 8, 1), (3, 8, 2), (0, 0, 2)])
def test_a_fine_pattern_that_moves_is_no_scene_that_moved(
    shift: int, expected: int, parts: int
) -> None:
    scene = replace(SCENE, targets=8, dot_radius=6.0, light='fine_stripe', light_scale=0.3)
    scene = replace(scene, tilt=20.0, ambient=0.12, phases=4, seed=7)
    images = [np.roll(render(scene, it).image, shift * it, axis=1) for it in range(2)]
    assert len(unmoved_parts(images)) == 2
    identifier = create_identifier(detector='traditional', expected_targets=expected, ahf=False)
    found = list(identify_parts(identifier, images, StackSettings(stack=2)))
    assert len(found) == parts


def test_images_of_another_type_are_a_part_of_their_own() -> None:
    image = render(SCENE).image
    parts = unmoved_parts([image, image.astype(np.uint16), image.astype(np.uint16)])
    assert [part.images for part in parts] == [range(1), range(1, 3)]
    assert 'pixels of type uint16' in parts[1].split


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        ({'stack': 0}, 'stack is 0, accepted is an integer from 1 to 64'),
        ({'stack_window': 'rolling'}, "stack_window is 'rolling'"),
    ],
)
def test_bad_settings_are_named(values: dict[str, int] | dict[str, str], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        StackSettings(**values)


class Searched:
    """A detector that finds nothing, or fails as it is told."""

    name = family = 'searched'

    def __init__(self, error: Exception | None = None) -> None:
        self.error = error

    def __call__(self, image: np.ndarray) -> Any:
        if self.error:
            raise self.error
        return []


def said(events: Any) -> list[tuple[str, int, bool] | Kind]:
    return [
        it.kind if isinstance(it, Remark) else (''.join(it.items), it.fresh, it.stack.shape[1] > 0)
        for it in events
    ]


def frame(name: str, width: int = 40, stamp: int = 0) -> Frame[str]:
    image = np.tile(np.arange(width, dtype=np.uint8), (30, 1))
    return Frame(item=name, image=image, kind=f'{width} px', stamp=stamp)


def test_a_stream_answers_and_says_why_it_does_not() -> None:
    stream = Stream(IdentificationSettings(), StackSettings(stack=3), Searched())
    events = [said(stream.add(lambda it=it: frame(*it))) for it in (('a',), ('b',), ('c', 50))]
    assert events == [[], [], [Kind.INCOMPLETE, ('ab', 2, True)]]
    assert said(stream.add(lambda: {}['no image'])) == [Kind.REFUSED]
    assert said(stream.end('no image follows')) == [Kind.INCOMPLETE, ('c', 1, True)]
    assert said(stream.end('no image follows')) == []


@pytest.mark.parametrize(
    ('error', 'text'),
    [(ValueError('bad\x00'), 'bad\\x00'), (MemoryError('large'), 'MemoryError: large')],
)
def test_what_a_detector_raises_is_why_an_image_is_refused(error: Any, text: str) -> None:
    stream = Stream(IdentificationSettings(), StackSettings(), Searched(error))
    (remark,) = stream.add(lambda: frame('a'))
    assert remark == Remark(Kind.FAILED, text)
    assert remark.items == ('a',)


def test_a_detector_that_cannot_be_used_is_no_fault_of_an_image() -> None:
    stream = Stream(IdentificationSettings(), StackSettings(), Searched(Unavailable('gone')))
    (remark,) = stream.add(lambda: frame('a'))
    assert (remark.kind, remark.items) == (Kind.FAILED, ('a',))
    assert isinstance(remark.error, Unavailable)


def test_every_image_that_gets_no_answer_is_in_a_remark() -> None:
    detector = Searched()
    stream = Stream(IdentificationSettings(), StackSettings(stack=2), detector)
    assert [it.items for it in stream.add(lambda: {}['no image'], 'a')] == [('a',)]
    constant = Frame(item='b', image=np.zeros((30, 40), np.uint8), kind='', stamp=0)
    (remark,) = Stream(IdentificationSettings(), StackSettings(), detector).add(lambda: constant)
    assert (remark.kind, remark.items) == (Kind.REFUSED, ('b',))
    assert said(stream.add(lambda: frame('c'))) == []
    assert (stream.forget(), stream.forget()) == (('c',), ())
    detector.error = ValueError('bad')
    assert said(stream.add(lambda: frame('d'))) == []
    (remark,) = stream.add(lambda: frame('e'))
    assert (remark.kind, remark.items) == (Kind.FAILED, ('d', 'e'))


def test_a_stream_that_is_resumed_goes_on_as_if_it_had_not_ended() -> None:
    settings = IdentificationSettings(
        expected_targets=4, detection=DetectorSettings(family='metashape12')
    )
    stacking = StackSettings(stack=3, stack_window=SLIDING)
    frames = [Frame(str(it), render(SCENE, it).image, 'mono8', it) for it in range(4)]

    def made() -> Stream[str]:
        detector = create_detector(settings=settings.detection)
        return Stream(settings, stacking, detector, timed=False)

    whole, broken = made(), made()
    answers: list[Answer[str]] = []
    for number, it in enumerate(frames):
        answers = [event for event in whole.add(lambda it=it: it) if isinstance(event, Answer)]
        if number < 3:
            broken.resume(whole.memory, lambda it=it: it)
    (resumed,) = broken.add(lambda: frames[3])
    (answer,) = answers
    assert answer.items == resumed.items == ('1', '2', '3')
    assert answer.identification == resumed.identification
    assert answer.identification.filter.duration == 0.0
    assert whole.memory == broken.memory
