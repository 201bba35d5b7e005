"""Every detector and every kind of family gives the same answer by every way in."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import cache
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rosbags', reason='rosbags is not installed')

from ahf_ros import SceneSettings, create_detector, identify, render
from ahf_ros.bag.definitions import typestore
from ahf_ros.cli import main
from ahf_ros.files.image_files import write_image
from ahf_ros.files.target_json import targets_from_json
from support import bags
from support.packages import MINE, my_detector, write_package
from support.square_markers import needs_square_markers

pytestmark = pytest.mark.lasting

SCENE = {'width': 320, 'height': 240, 'targets': 3, 'dot_radius': 9.0}
SCENES = {
    'gsi': SCENE | {'width': 560, 'height': 420, 'dot_radius': 5.0},
    'aicon14': SCENE | {'targets': 4},  # fewer may be of `cct14`
    'cctag3': SCENE | {'dot_radius': 14.0},
}
SQUARES = ('aruco_4x4_50', 'apriltag_36h11')
BOTH = 'metashape12,aicon14'
SHOWN = {'auto': f'{BOTH},dots'}
COMMAND = f'{sys.executable} -m ahf_ros.cli identify --family metashape12 --json'


@dataclass(frozen=True)
class Case:
    """An image, and the settings of its identification."""

    family: str = 'metashape12'
    light: str = 'normal'
    detector: str = 'auto'
    command: str = ''
    expected_targets: int = 0

    @property
    def settings(self) -> dict[str, Any]:
        """Return the parameters, all of them, so that nothing of the case before is left."""
        names = 'family', 'detector', 'command', 'expected_targets'
        return {name: getattr(self, name) for name in names}

    def __str__(self) -> str:
        return self.family if self.detector == 'auto' else self.detector


CASES = (
    *(Case(family) for family in ('metashape12', 'aicon14', 'gsi', 'dots', 'cctag3')),
    *(Case(family) for family in SQUARES),
    *(Case(families) for families in (BOTH, 'auto')),
    Case(detector='traditional', light='stripe', expected_targets=3),
    Case(detector='command', command=COMMAND),
    Case(detector=MINE),
)
EVERY_CASE = pytest.mark.parametrize(
    'case',
    [
        pytest.param(it, id=str(it), marks=needs_square_markers if it.family in SQUARES else ())
        for it in CASES
    ],
)

Answer = tuple[str, list[tuple[Any, ...]]]
"""The family of targets, and what is exactly the same by every way."""


@cache
def image(case: Case) -> np.ndarray:
    names = SHOWN.get(case.family, case.family).split(',')
    light = {'light': case.light}
    scenes = [SCENES.get(name, SCENE) | {'family': name} | light for name in names]
    return np.hstack([render(SceneSettings(**scene, seed=1)).image for scene in scenes])


@cache
def by_library(case: Case) -> Answer:
    if case.detector == MINE:
        detector = my_detector()
        return answer(detector.family, identify(image(case), detector=detector).targets)
    found = identify(image(case), **case.settings)
    assert found.filter.applied == (case.light == 'stripe')
    made = create_detector(case.detector, family=case.family, command=case.command)
    return answer(made.family, found.targets)


def answer(family: str, targets: Any) -> Answer:
    """Return an answer from targets or from messages of targets."""
    return family, [(it.id, it.family, it.code, it.x, it.y, *it.covariance) for it in targets]


@pytest.fixture(scope='module', autouse=True)
def package_of_mine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Let processes that are started find a package that adds a detector."""
    folder = tmp_path_factory.mktemp('packages')
    write_package(folder, 'package_of_mine')
    paths = [str(folder), str(Path.cwd()), os.environ.get('PYTHONPATH', '')]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('PYTHONPATH', os.pathsep.join(filter(None, paths)))
        yield


def ahf(*words: object, case: Case) -> str:
    """Return what the command line prints; a detector that was added needs another process."""
    given = [f'--{name.replace("_", "-")}={value}' for name, value in case.settings.items()]
    arguments = [*map(str, words), *given]
    if case.detector == MINE:
        line = [sys.executable, '-m', 'ahf_ros.cli', *arguments]
        return subprocess.run(line, stdout=subprocess.PIPE, text=True, check=True).stdout
    with redirect_stdout(StringIO()) as printed:
        assert main(arguments) == 0
    return printed.getvalue()


@EVERY_CASE
def test_the_library_identifies_something(case: Case) -> None:
    _, targets = by_library(case)
    for family in SHOWN.get(case.family, case.family).split(','):
        assert len({number for number, of, *_ in targets if of in (family, '')}) >= 3


@EVERY_CASE
def test_the_command_line(case: Case, tmp_path: Path) -> None:
    path = tmp_path / 'image.png'
    write_image(path, image(case))
    printed = json.loads(ahf('identify', path, '--json', case=case))
    assert answer(printed['family'], targets_from_json(printed, 'ahf')) == by_library(case)


@EVERY_CASE
def test_a_bag(case: Case, tmp_path: Path) -> None:
    source = bags.write_ros2(tmp_path / 'in', bags.recorded(typestore(), [image(case)]))
    ahf('bag', source, tmp_path / 'out', case=case)
    ((_, found),) = bags.answers(tmp_path / 'out')
    assert answer(found.family, found.targets) == by_library(case)


@pytest.fixture(scope='module')
def nodes(graph: Any) -> Callable[[Case], Any]:
    """Return, by a case, its message, a node with its detector, and one that asks that node.

    What answers a service does not change how it is asked: two detectors are asked, one of which
    searches for a filter.
    """
    from std_msgs.msg import Header

    from ahf_ros.nodes.messages import image_message
    from support.detector import DetectorProcess

    @cache
    def with_detector(detector: str, command: str) -> tuple[DetectorProcess, ...]:
        own = f'detector:={detector}', f'command:={command!r}', f'allow_programs:={bool(command)}'
        other = 'detector:=service', f'service:=/{detector}/detector/identify'
        words, others = ([word for it in given for word in ('-p', it)] for given in (own, other))
        first = DetectorProcess(graph, f'/{detector}', *words)
        if detector not in ('auto', 'traditional'):
            return (first,)
        second = DetectorProcess(graph, f'/asks_{detector}', *others)
        second.until_served(image_message(image(Case()), Header()))
        return first, second

    def made(case: Case) -> Any:
        message = image_message(image(case), Header(frame_id=str(case)))
        return message, *with_detector(case.detector, case.command)

    return made


@EVERY_CASE
def test_the_node_and_its_service_and_a_node_that_calls_it(
    case: Case, nodes: Callable[[Case], Any]
) -> None:
    message, first, *others = nodes(case)
    free = ('family', case.family), ('expected_targets', case.expected_targets)
    assert first.set(*free) == (True, '')
    live = first.answer(message)
    assert answer(live.family, live.targets) == by_library(case)
    first.reset()
    response = first.identify(message)
    assert response.success, response.message
    served = response.coded_targets
    assert answer(served.family, served.targets) == by_library(case)
    for second in others:
        first.reset()
        assert second.set(('family', case.family)) == (True, '')
        asked = second.answer(message)
        assert answer('', asked.targets)[1] == by_library(case)[1]
        assert asked.family == case.family
