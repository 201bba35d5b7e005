"""Stacks of images in bags."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('rosbags', reason='rosbags is not installed')

from ahf_ros.bag.definitions import IMAGE, typestore
from ahf_ros.bag.run import BagTask, answer_bag
from ahf_ros.cli import main
from ahf_ros.families import DetectorSettings
from ahf_ros.identification.session_settings import IdentificationSettings, StackSettings
from ahf_ros.scenes.scene import SceneSettings, render
from support import bags

SCENE = SceneSettings(**bags.SCENE, ambient=0.02, phases=4)
SETTINGS = IdentificationSettings(
    expected_targets=4, detection=DetectorSettings(family=SCENE.family)
)


@pytest.fixture(scope='module')
def phases() -> list[np.ndarray]:
    return [render(SCENE, phase).image for phase in range(4)]


@pytest.fixture(scope='module')
def recording(phases: list[np.ndarray], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a bag with seven images: a stack, and three of another one."""
    folder = tmp_path_factory.mktemp('phases')
    return bags.write_ros2(folder / 'in', bags.recorded(typestore(), phases + phases[:3]))


def stamps(path: Path) -> list[float]:
    """Return the stamps of the answers, in images."""
    headers = [message.header.stamp for _, message in bags.answers(path)]
    return [round((it.sec + it.nanosec / 1e9 + 1e-3) * 10) for it in headers]


def ids(path: Path) -> list[list[int]]:
    return [[target.id for target in message.targets] for _, message in bags.answers(path)]


def test_a_stack_has_one_answer_with_the_stamp_of_its_last_image(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / 'out'
    given = '--family', SCENE.family, '--stack', '4', '--expected', '4'
    assert main(['bag', str(recording), str(out), *given]) == 0
    assert stamps(out) == [4, 7]
    assert ids(out)[0] == [target.id for target in render(SCENE).targets]
    said = capsys.readouterr().err
    assert '/image at 0.700000000 s: a stack of 3 of 4 images: no image follows' in said


def test_a_run_that_was_broken_off_continues_within_a_stack(
    recording: Path, tmp_path: Path
) -> None:
    stacking = StackSettings(stack=4)
    tasks = [
        BagTask(recording, tmp_path / name / 'out', identification=SETTINGS, stacking=stacking)
        for name in ('whole', 'broken')
    ]

    def broken_off(done: int, *_: object) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        answer_bag(tasks[1], broken_off)
    for task in tasks:
        answer_bag(task, lambda *_: None)
    whole, broken = (bags.read(task.output) for task in tasks)
    assert whole == broken


def test_what_does_not_belong_together_is_said_and_answered(
    phases: list[np.ndarray], tmp_path: Path
) -> None:
    store = typestore()
    small = phases[2][:-20]
    messages = [
        ('/image', IMAGE, time, bags.image(store, pixels, stamp))
        for time, stamp, pixels in (
            (10**9, 10**9, phases[0]),
            (2 * 10**9, 2 * 10**9, phases[1]),
            (3 * 10**9, 3 * 10**9, small),
            (4 * 10**9, 10**9, small),
        )
    ]
    broken = bags.image(store, phases[3], 5 * 10**9, encoding='what')
    messages.append(('/image', IMAGE, 5 * 10**9, broken))
    said: list[str] = []
    task = BagTask(
        bags.write_ros2(tmp_path / 'in', messages),
        tmp_path / 'out',
        identification=SETTINGS,
        stacking=StackSettings(stack=3),
    )
    outcome = answer_bag(task, lambda done, total, remark: said.append(remark))
    assert stamps(task.output) == [20, 30, 50, 10]
    assert (outcome.images, outcome.refused) == (5, 1)
    about, *said = said
    assert 'checksums' in about
    assert said[:2] == ['', '']
    assert '2 of 3 images: the next image is 400 x 280 px, mono8, these are 400 x 300' in said[2]
    assert '1 of 3 images: the stamp of the next image is 2 s earlier' in said[3]
    assert 'what' in said[4]
    assert '1 of 3 images: no image follows' in said[4]
