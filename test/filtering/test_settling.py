"""Evidence for families where all are looked for: of one image, and of images together."""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from ahf_ros.filtering.settling import evident, evident_together
from ahf_ros.interchange.image_files import write_image
from ahf_ros.session import identify
from ahf_ros.synthetic.scene import SceneSettings, render
from ahf_ros.target import Target
from support.command_line import status

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
    [((0.989,), False), ((0.991,), True), ((0.98, 0.98), False), ((0.986, 0.986), True)],
)
def test_two_targets_need_less_each_than_one(confidences: tuple[float, ...], shown: bool) -> None:
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
