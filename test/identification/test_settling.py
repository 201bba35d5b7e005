"""Evidence for families where all are looked for: of one image, and of images together."""

import json
import math
from collections import Counter
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from ahf_ros.base.target import Target
from ahf_ros.families import create_detector
from ahf_ros.families.explained import without_targets
from ahf_ros.files.image_files import write_image
from ahf_ros.identification.session import create_identifier, identify
from ahf_ros.identification.settling import FIRST, evident, evident_together, memory_of
from ahf_ros.scenes.scene import SceneSettings, render
from support.calls import calls_of
from support.command_line import status
from support.square_markers import needs_square_markers

SOFT = (1, 2, 4, 6)
"""Seeds of photographs whose one target is read, but is not certain."""


@cache
def soft(seed: int) -> tuple[np.ndarray, int]:
    """Return a noisy photograph of one small target out of focus, and its ID."""
    scene = render(SceneSettings(width=320, height=240, targets=1, dot_radius=4.6, seed=seed))
    blurred = cv2.GaussianBlur(scene.image.astype(float), (0, 0), 1.0)
    noise = np.random.default_rng(seed).normal(0, 8, scene.image.shape)
    image = np.clip(blurred + noise, 0, 255).astype(np.uint8)
    return image, scene.targets[0].id


def target(number: int, confidence: float, family: str = 'cct12') -> Target:
    return Target(number, 1, 9.0, 9.0, 5.0, 5.0, confidence=confidence, family=family)


@pytest.mark.parametrize(
    ('confidences', 'shown'),
    [
        ((0.989,), False),
        ((0.991,), True),
        ((0.98, 0.98), False),
        ((0.986, 0.986), True),
        ((0.76,) * 5, False),
        ((0.76,) * 6, True),
    ],
)
def test_several_need_less_each_than_one(confidences: tuple[float, ...], shown: bool) -> None:
    targets = [target(number, it) for number, it in enumerate(confidences, start=1)]
    assert evident(targets) == (targets if shown else [])


def test_words_of_texture_in_many_images_are_no_evidence() -> None:
    """Where words turn up at random, as often as in the worst texture."""
    generator = np.random.default_rng(8)
    words = [
        [('gsi', int(number), float(1 - 10 ** -generator.exponential(1 / math.log(10)) / 10))]
        if generator.random() < 0.05
        else []
        for number in generator.integers(0, 1484, 2000)
    ]
    assert sum(map(len, words)) > 70
    assert not any(evident_together(words[first : first + 12]) for first in range(0, 2000, 12))
    assert evident_together(words) == set()
    assert evident_together([[('gsi', 7, 0.98)]] * 12) == set()  # what repeats


@pytest.mark.parametrize('seed', SOFT)
def test_a_target_that_one_image_does_not_settle_is_named_in_its_result(seed: int) -> None:
    image, number = soft(seed)
    found = identify(image)
    (one,) = found.unsettled
    assert (len(found), one.reason) == (0, 'unsettled')
    assert (one.likely_family, one.likely_id) == ('metashape12', number)
    assert 0.9 < one.confidence < 0.99
    assert identify(image, family='metashape12').unsettled == ()
    (undecoded,) = identify(image, report_undecoded=True)
    assert (undecoded.id, undecoded.likely_id) == (-1, number)


@pytest.mark.lasting
@pytest.mark.parametrize('empty', [0, 4])
def test_photographs_of_one_target_each_settle_its_family_together(
    tmp_path: Path, capsys: pytest.CaptureFixture, empty: int
) -> None:
    grey = np.random.default_rng(5).normal(128, 3, (240, 320)).astype(np.uint8)
    images = [*[grey] * empty, *(soft(seed)[0] for seed in SOFT)]
    for number, image in enumerate(images):
        write_image(tmp_path / f'{number}.png', image)
    assert status('identify', tmp_path, '--json') == 0
    said = capsys.readouterr()
    records = [json.loads(line) for line in said.out.splitlines()]
    shown = [[(it['family'], it['id']) for it in record['targets']] for record in records]
    assert shown == [[]] * empty + [[('metashape12', soft(seed)[1])] for seed in SOFT]
    assert 'families: metashape12\n' in said.err
    assert status('identify', tmp_path / f'{empty}.png', '--json') == 0
    (alone,) = map(json.loads, capsys.readouterr().out.splitlines())
    assert (alone['targets'], len(alone['unsettled'])) == ([], 1)


WALL = SceneSettings(width=1200, height=900, targets=12, dot_radius=9, seed=3)


def side_by_side(*families: str) -> np.ndarray:
    part = replace(WALL, width=400, height=500, targets=4)
    return np.hstack([render(replace(part, family=it)).image for it in families])


@pytest.mark.lasting
@pytest.mark.parametrize('light', ['normal', 'stripe'])
def test_a_clear_image_settles_its_family_at_once_and_later_ones_cost_less(light: str) -> None:
    image = render(replace(WALL, light=light)).image
    identifier = create_identifier(threads=1)
    named = create_identifier(family='metashape12', threads=1)
    for each in (identifier, named):
        each.identify(image[:300, :300])  # modules are imported, tables made
        each.reset()
    found = []
    first = calls_of(lambda: found.append(identifier.identify(image)))
    assert (found[0].looked_for, found[0].count) == ('auto', 12)
    assert (identifier.memory.families, identifier.memory.shown) == (('metashape12',), FIRST)
    later = calls_of(lambda: identifier.identify(image))
    by_name = calls_of(lambda: named.identify(image))
    assert first < (2.2 if light == 'normal' else 3.6) * by_name
    assert later < 2.6 * by_name
    # What the look at all families read is kept: it was read beside other dots, to the last bits.
    by_look, alone = found[0].targets, named.identify(image).targets
    assert [it.print for it in by_look] == [it.print for it in alone]
    for one, other in zip(by_look, alone, strict=True):
        assert (one.x, one.y) == pytest.approx((other.x, other.y), abs=1e-6)
    assert identifier.identify(image).targets == named.identify(image).targets


@pytest.mark.parametrize(
    ('first', 'second', 'light'),
    [
        pytest.param('metashape12', 'apriltag_36h11', 'stripe', marks=needs_square_markers),
        pytest.param('aruco_4x4_50', 'cct12', 'normal', marks=needs_square_markers),
        pytest.param('metashape12', 'aicon14', 'stripe', marks=pytest.mark.lasting),
        ('metashape12', 'gsi', 'normal'),
        pytest.param('metashape12', 'gsi', 'stripe', marks=pytest.mark.lasting),
        pytest.param('cct10', 'cctag3', 'normal', marks=pytest.mark.lasting),
    ],
)
def test_a_family_that_appears_in_a_stream_is_found(first: str, second: str, light: str) -> None:
    size = {'gsi': 5, 'cctag3': 14}.get(second, 12)
    half = replace(WALL, width=450, height=450, targets=4, light=light)
    own = render(replace(half, family=first))
    more = replace(half, dot_radius=size, seed=5)
    other = render(replace(more, family=second))
    alone = np.hstack([own.image, render(replace(more, targets=0)).image])
    both = np.hstack([own.image, other.image])
    identifier = create_identifier()
    for image in (alone, alone):
        assert {it.family for it in identifier.identify(image)} == {first}
    assert identifier.memory.families == (first,)
    found = identifier.identify(both)
    while identifier.memory.families == (first,) and identifier.memory.glanced <= 13:
        found = identifier.identify(both)
    assert [it.key for it in found if it.family == second] == [it.key for it in other.targets]
    assert set(identifier.memory.families) == {first, second}
    assert found.looked_for == 'auto'
    found = identifier.identify(both)
    assert set(found.looked_for.split(',')) == {first, second}


@pytest.mark.lasting
def test_what_stands_still_is_rarely_looked_at_again_until_it_changes() -> None:
    half = replace(WALL, width=450, height=450, targets=4, full_well=0.0)
    alone = np.hstack([render(replace(half, targets=number)).image for number in (4, 0)])
    other = render(replace(half, family='gsi', dot_radius=5, seed=5))
    both = np.hstack([alone[:, :450], other.image])
    noise = np.random.default_rng(1).normal(0.0, 1.5, (44, *alone.shape))
    identifier = create_identifier(threads=1)
    named = create_identifier(family='metashape12', threads=1)

    def calls(image: np.ndarray) -> float:
        of_named = calls_of(lambda: named.identify(image))
        return calls_of(lambda: identifier.identify(image)) / of_named

    still = [calls(np.clip(np.rint(alone + it), 0, 255).astype(np.uint8)) for it in noise]
    assert sum(of > 1.5 for of in still) > 5
    assert max(still[-12:]) < 1.2
    assert identifier.memory.families == ('metashape12',)
    since = identifier.memory.glanced
    while 'gsi' not in identifier.memory.families and identifier.memory.glanced < since + 25:
        identifier.identify(both)
    assert identifier.memory.families == ('metashape12', 'gsi')


def test_small_images_are_looked_at_now_and_then() -> None:
    image = render(replace(WALL, width=400, height=300, targets=3)).image
    identifier = create_identifier(threads=1, follow=0)
    named = create_identifier(family='metashape12', threads=1, follow=0)
    for each in (identifier, named, identifier):
        each.identify(image)
    usual = calls_of(lambda: named.identify(image))
    calls = [calls_of(lambda: identifier.identify(image)) / usual for _ in range(10)]
    assert max(calls[::2]) < 1.1
    assert min(calls[1::2]) > 1.1 and max(calls[1::2]) < 1.7  # by one detector after the other


@needs_square_markers
def test_a_second_family_in_any_image_of_a_batch_is_found(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    alone, both = side_by_side('cct10', 'cct10'), side_by_side('cct10', 'aruco_5x5_50')
    for number, image in enumerate([alone, alone, alone, alone, both]):
        write_image(tmp_path / f'{number}.png', image)
    assert status('identify', tmp_path, '--json') == 0
    said = capsys.readouterr()
    last = json.loads(said.out.splitlines()[-1])
    assert Counter(it['family'] for it in last['targets']) == {'cct10': 4, 'aruco_5x5_50': 4}
    assert 'families: aruco_5x5_50, cct10\n' in said.err


def test_other_families_are_looked_for_in_clear_contrast_alone() -> None:
    """What is faint beside an image's own targets costs little; it took half as much again."""
    settings = SceneSettings(width=640, height=480, targets=4, dot_radius=12.0, seed=1)
    dots = render(replace(settings, family='gsi', dot_radius=5.0)).image
    faint, known = np.rint(200 + dots / 255 * 24).astype(np.uint8), memory_of(('metashape12',))
    identifier, calls = create_identifier(threads=1), list[int]()
    for beside in (np.full_like(faint, 220), faint):
        image = np.hstack([render(settings).image, beside])
        identifier.memory = known  # as each image of a batch begins
        identifier.identify(image)
        identifier.memory = known
        calls.append(calls_of(partial(identifier.identify, image)))
    assert calls[1] < 1.2 * calls[0]


@pytest.mark.parametrize('light', ['normal', 'stripe'])
@pytest.mark.parametrize(
    'family',
    ['metashape12', pytest.param('apriltag_36h11', marks=needs_square_markers), 'dots', 'cctag3'],
)
def test_nothing_is_left_of_targets_that_are_painted_over(family: str, light: str) -> None:
    size = {'width': 700, 'height': 520, 'dot_radius': 24 if family == 'cctag3' else 12}
    scene = render(replace(WALL, **size, family=family, light=light, targets=4))
    prints = {family: scene.settings.print}
    left = without_targets(scene.image, scene.targets, prints)
    assert create_detector()(left) == []
    assert not np.array_equal(left, scene.image)
    part = without_targets(scene.image, scene.targets, prints, (150, 90, 560, 400))
    assert np.array_equal(part, left[90:400, 150:560])
    again = without_targets(scene.image.astype(np.float32), scene.targets, prints)
    assert np.abs(again - left).max() <= 0.5
