"""The search of one image by workers."""

from __future__ import annotations

import itertools
import json
import signal
from pathlib import Path

import pytest

from ahf_ros import ending
from ahf_ros.batch.identification import identify_images
from ahf_ros.batch.task import ImageTask
from ahf_ros.cli import main
from ahf_ros.interchange.image_files import write_image
from ahf_ros.session_settings import IdentificationSettings
from ahf_ros.settings.nested import updated
from ahf_ros.synthetic.scene import SceneSettings, render

SCENE = SceneSettings(
    width=320, height=240, targets=3, dot_radius=10, light='stripe', ambient=0.04, seed=2, phases=2
)


def test_a_search_by_workers_is_that_of_one_thread(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    images = [tmp_path / f'{phase}.png' for phase in range(2)]
    for phase, path in enumerate(images):
        write_image(path, render(SCENE, phase).image)
    command = ['identify', *map(str, images), '--stack', '2', '--detector', 'traditional']
    command += ['--expected-targets', '5', '--population', '4', '--max-evaluations', '6', '--json']
    found = []
    for more in (['--threads', '1'], ['--spread', '--jobs', '2']):
        assert main([*command, *more, '--coarse']) == 0
        found.append({**json.loads(capsys.readouterr().out), 'elapsed_s': 0})
    assert found[0] == found[1]
    assert found[0]['filter']['evaluations'] > 6
    images[1].write_bytes(b'not an image')
    assert main([*command, '--spread', '--jobs', '1']) == 1
    assert '1.png is not an image' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('number', 'ends'), [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, SystemExit)]
)
def test_a_search_ends_with_its_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, ends: type[BaseException]
) -> None:
    write_image(tmp_path / 'image.png', render(SCENE).image)
    settings = updated(IdentificationSettings(), {'expected_targets': 5, 'threads': 2})
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
