"""`ahf bag --register`: the scans of a bag in one frame."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rosbags', reason='rosbags is not installed')

from ahf_ros.bag.definitions import IMAGE, typestore
from ahf_ros.bag.registration import POINT_CLOUD
from ahf_ros.files.cloud_files import read_cloud
from ahf_ros.scenes.scene import render
from support import bags
from support.command_line import status
from support.wall import SCENE, SHIFT, as_cloud, moved

SECOND = 10**9
FAMILY = ('--family', SCENE.family)


@cache
def picture() -> np.ndarray:
    return render(SCENE).image


def shot(number: int, points: np.ndarray | None = None, **changes: Any) -> list[bags.Recorded]:
    """Return the image and the cloud of a scan, which is recorded first every second time."""
    store, time = typestore(), (1 + number) * SECOND
    image = ('/image', IMAGE, time, bags.image(store, picture(), time))
    cloud = bags.cloud(store, as_cloud(moved(number) if points is None else points), time)
    for name, value in changes.items():
        setattr(cloud, name, value)
    clouds = [('/points', POINT_CLOUD, time + 10**7 * (-1) ** number, cloud)]
    return [image, *clouds] if number % 2 == 0 else [*clouds, image]


def register(folder: Path, recorded: list[bags.Recorded], *options: object) -> int:
    """Return the status of the command for a bag, whose scans go to `folder`/scans."""
    source = folder / 'in'
    if not source.exists():
        bags.write_ros2(source, recorded)
    where = folder / 'out', '--register', folder / 'scans'
    return status('bag', source, *where, *FAMILY, *options)


def contents(folder: Path) -> dict[str, bytes]:
    return {it.name: it.read_bytes() for it in sorted(folder.iterdir())}


def test_scans_are_registered_again_from_a_finished_bag(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    bad = shot(3, 1000 * moved(3))
    recorded = [*shot(0), *shot(1), *shot(2), *bad]
    recorded.append(('/image', IMAGE, 9 * SECOND, bags.image(typestore(), picture(), 9 * SECOND)))
    assert register(tmp_path, recorded) == 1
    errors = capsys.readouterr().err
    assert '/points at 3.990000000 s: targets are 1000 times as far apart' in errors
    assert '/points at 1.990000000 s: scan_2, 6 of 6 targets in common, residuals 0.0' in errors
    assert '3 scans registered, 1 image without a cloud, 0 clouds without an image' in errors
    found = json.loads((tmp_path / 'scans' / 'transforms.json').read_text())['scans']
    assert [it['name'] for it in found] == ['scan_1', 'scan_2', 'scan_3']
    assert [it['stamp'] for it in found] == [(1 + it) * SECOND - 10**6 for it in range(3)]
    assert {it['frame_id'] for it in found} == {'scanner'}
    assert found[1]['translation'] == pytest.approx(SHIFT.tolist(), abs=1e-3)
    first, last = (read_cloud(tmp_path / 'scans' / f'scan_{it}.ply') for it in (1, 3))
    assert last['x'] == pytest.approx(first['x'], abs=1e-3)

    before = contents(tmp_path / 'scans')
    for file in (tmp_path / 'scans').iterdir():
        file.unlink()
    assert register(tmp_path, recorded) == 1
    assert contents(tmp_path / 'scans') == before
    assert register(tmp_path, recorded, '--adjust', '--frame', 'object') == 1
    assert '3 scans and 6 targets adjusted, sigma0 ' in capsys.readouterr().err
    adjusted = json.loads((tmp_path / 'scans' / 'transforms.json').read_text())
    assert adjusted['frame'] == 'object'
    assert adjusted['scans'][2]['translation'] != found[2]['translation']

    known = tmp_path / 'known.csv'
    known.write_bytes(before['targets.csv'])
    assert register(tmp_path, recorded, '--coordinates', known) == 1
    assert 'scan_1, 6 of 6 targets in common' in capsys.readouterr().err
    assert register(tmp_path, recorded, '--coordinates', known, '--unit', 'mm') == 1
    assert "unit is 'mm', accepted is that of" in capsys.readouterr().err


def test_bad_clouds_are_named_and_the_others_are_registered(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    points = moved(1)
    flat = {'height': 1, 'width': 640 * 480, 'row_step': 640 * 480 * 12}
    late = shot(5)
    recorded = [
        *shot(0),
        *shot(1, **flat),
        *shot(2, points[:, 1:]),
        *shot(3, np.full_like(points, np.nan)),
        *shot(4),
        *[(topic, kind, time + 2 * SECOND, it) for topic, kind, time, it in shot(3)],
        *[(topic, kind, time + 2 * SECOND, it) for topic, kind, time, it in late],
    ]
    late[0][3].header.frame_id = 'other'
    assert register(tmp_path, recorded) == 1
    errors = capsys.readouterr().err
    for words in (
        '/points at 1.990000000 s: height is 1, accepted is an integer of at least 2',
        '/points at 3.010000000 s: cloud has 639 x 480 points, accepted is 640 x 480',
        '/points at 3.990000000 s: ',
        '/points at 5.990000000 s: stamp is 3.999000000 s, before that of the last scan, 4.999',
        '3 scans registered, 1 image without a cloud',
    ):
        assert words in errors
    found = json.loads((tmp_path / 'scans' / 'transforms.json').read_text())['scans']
    assert [it['frame_id'] for it in found] == ['scanner', 'scanner', 'other']


def test_an_interrupted_run_registers_all_scans(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from ahf_ros.bag import run

    recorded = [*shot(0), *shot(1), *shot(2)]
    assert register(tmp_path, recorded) == 0
    (tmp_path / 'again').mkdir()
    appended = run.Journal.append
    answered: list[None] = []

    def killed(self: run.Journal, *arguments: Any) -> None:
        if len(answered) == 2:
            raise KeyboardInterrupt
        answered.append(None)
        appended(self, *arguments)

    monkeypatch.setattr(run.Journal, 'append', killed)
    assert register(tmp_path / 'again', recorded) == 130
    assert not (tmp_path / 'again' / 'scans').exists()
    monkeypatch.undo()
    assert register(tmp_path / 'again', recorded) == 0
    assert contents(tmp_path / 'again' / 'scans') == contents(tmp_path / 'scans')


@pytest.mark.parametrize(
    ('topics', 'options', 'words'),
    [
        ((), (), 'has no clouds, accepted is a topic of sensor_msgs/msg/PointCloud2'),
        (('/a', '/b'), (), 'has clouds on /a, /b, accepted is a cloud_topic'),
        (('/a',), ('--cloud-topic', '/image'), 'cloud_topic /image is of sensor_msgs/msg/Image'),
        (('/a',), ('--cloud-topic', '/b'), 'cloud_topic /b does not exist, accepted is one of /a'),
        (('/a',), ('--coordinates', 'none.csv'), 'none.csv'),
    ],
)
def test_what_cannot_be_registered_is_refused_before_anything_is_identified(
    topics: tuple[str, ...],
    options: tuple[str, ...],
    words: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture,
) -> None:
    image, (_, kind, time, cloud) = shot(0)
    recorded = [image, *((topic, kind, time, cloud) for topic in topics)]
    assert register(tmp_path, recorded, *options) == 1
    assert words in capsys.readouterr().err
    assert not (tmp_path / 'out').exists()


def test_stamps_beyond_the_tolerance_and_folders_in_a_bag_are_said(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    recorded = shot(0)
    recorded[1][3].header.stamp.nanosec += 2 * 10**6
    _, kind, time, cloud = shot(0, 1000 * moved(0))[1]
    recorded.append(('/other', kind, time, cloud))
    chosen = '--cloud-topic', '/points'
    assert register(tmp_path, recorded, *chosen) == 1
    assert (
        'no scan is registered, 1 image without a cloud, 1 cloud without an image; their stamps '
        'are 0.002000000 s apart or more, accepted is cloud_tolerance, 1e-06 s'
    ) in capsys.readouterr().err
    assert register(tmp_path, recorded, *chosen, '--cloud-tolerance', '0.01') == 0
    for inside, words in (('in', 'in the recording'), ('other', 'in the new bag')):
        folder = tmp_path / inside / 'scans'
        assert status('bag', tmp_path / 'in', tmp_path / 'other', '--register', folder) == 1
        assert f'register is {folder}, which is {words}' in capsys.readouterr().err
    assert status('bag', tmp_path / 'in', tmp_path / 'other', '--adjust') == 2
    assert 'accepted with them is register' in capsys.readouterr().err
