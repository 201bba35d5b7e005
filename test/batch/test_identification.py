"""The identification of the images of a task."""

import itertools
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ahf_ros.base import ending
from ahf_ros.base.settings.nested import updated
from ahf_ros.batch import identification
from ahf_ros.batch.identification import identify_images
from ahf_ros.batch.task import ImageTask
from ahf_ros.files.image_files import write_image
from ahf_ros.identification.session_settings import IdentificationSettings
from ahf_ros.scenes.scene import SceneSettings, render

SCENE = SceneSettings(
    width=320, height=240, targets=3, dot_radius=10, light='stripe', ambient=0.04, seed=2
)


@pytest.mark.parametrize(
    ('number', 'ends'), [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, SystemExit)]
)
def test_a_search_ends_with_its_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, ends: type[BaseException]
) -> None:
    write_image(tmp_path / 'image.png', render(SCENE).image)
    values = {'family': SCENE.family, 'expected_targets': 5, 'threads': 2}
    settings = updated(IdentificationSettings(), values)
    calls, passed = itertools.count(1), []
    original = ending.check

    def check() -> None:
        call = next(calls)
        if call >= 3:
            monkeypatch.setattr(ending, '_number', number)
        original()
        passed.append(call)

    monkeypatch.setattr(ending, 'check', check)
    monkeypatch.setattr(ending, '_raised', False)  # as it is afterwards
    with pytest.raises(ends):
        identify_images(ImageTask((str(tmp_path / 'image.png'),), settings))
    assert len(passed) <= 2


def test_an_error_of_a_detector_costs_its_image_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_image(tmp_path / 'image.png', render(SCENE).image)
    task = ImageTask((str(tmp_path / 'image.png'),))

    def failing(*_: object) -> None:
        raise ZeroDivisionError('of a detector')

    monkeypatch.setattr(identification, 'identify_parts', failing)
    outcome = identify_images(task)
    assert outcome.failed and outcome.records == ()
    assert outcome.messages[0].text == f'{task.name}: ZeroDivisionError: of a detector'


def test_targets_that_are_not_decoded_have_their_reason(tmp_path: Path) -> None:
    image = render(replace(SCENE, light='normal')).image
    write_image(tmp_path / 'twice.png', np.hstack([image, image]))
    settings = updated(
        IdentificationSettings(), {'family': SCENE.family, 'report_undecoded': True}
    )
    outcome = identify_images(ImageTask((str(tmp_path / 'twice.png'),), settings))
    lines = [it.text for it in outcome.messages if 'contested' in it.text]
    assert len(lines) == 6
    assert all(', contested, likely ' in line and line.endswith(SCENE.family) for line in lines)
