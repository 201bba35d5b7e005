"""`ahf orient`: from results to a folder with coordinates."""

import csv
import json
import os
import re
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
import pytest
from ruamel.yaml import YAML

from ahf_ros.network.files.camera_files import ros_yaml
from ahf_ros.network.files.network_results import read_network
from ahf_ros.network.files.robot_files import read_robot_poses
from ahf_ros.network.network import CameraView
from ahf_ros.network.transform import Transform
from support import ROOT, environment
from support.command_line import status
from support.networks import CALIBRATION, SIZE, records, solution

pytest.importorskip('scipy')

TRUE = solution(photographs=8, targets=24)
CAMERA_FRAME = 'camera_1600_x_1200_optical_frame'


@pytest.fixture(scope='module')
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a file of results, in a folder with a calibration, scale bars and control points."""
    folder = tmp_path_factory.mktemp('results')
    lines = [json.dumps(it) for it in records(TRUE.network)]
    lines.append(json.dumps(json.loads(lines[0]) | {'image': 'empty.jpg', 'targets': []}))
    (folder / 'results.jsonl').write_text('\n'.join(lines))
    camera = ros_yaml(CameraView('camera', *SIZE), CALIBRATION, np.zeros((10, 10)))
    (folder / 'camera.yaml').write_bytes(camera)
    points = TRUE.state.points
    with (folder / 'bars.csv').open('w', newline='') as file:
        rows = [('id_1', 'id_2', 'length', 'sigma', 'role')]
        for first, second, role in ((0, 1, 'control'), (2, 3, 'check')):
            length = float(np.linalg.norm(points[first] - points[second]))
            rows.append((f'{first + 1}', f'{second + 1}', f'{length:.6f}', '0.01', role))
        csv.writer(file).writerows([*rows, ('1', '99', '5', '1', 'check')])
    with (folder / 'points.csv').open('w', newline='') as file:
        given = [(name, *xyz) for name, xyz in zip(TRUE.network.targets, points, strict=True)]
        csv.writer(file).writerows([('id', 'x', 'y', 'z'), *given[:6]])
    return folder / 'results.jsonl'


def distances(points: np.ndarray) -> np.ndarray:
    return np.asarray(np.linalg.norm(points[:, None] - points, axis=2))


def test_coordinates_come_from_results_alone(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With a calibration and a scale bar, all distances are right."""
    folder = tmp_path / 'network'
    exports = [f'--export={name}={tmp_path / name}' for name in ('colmap', 'metashape', 'mmvii')]
    known_lengths = '--scale-bars', results.parent / 'bars.csv'
    camera = '--calibration', results.parent / 'camera.yaml'
    assert status('orient', results, '-o', folder, *camera, *known_lengths, *exports) == 0
    found = read_network(folder)
    assert found.points.names == TRUE.network.targets and len(found.photographs) == 8
    assert found.points.unit == 'mm'
    error = distances(found.points.xyz) - distances(TRUE.state.points)
    assert np.abs(error).max() < 0.2
    np.testing.assert_allclose(found.calibrations[0], CALIBRATION, rtol=1e-6, atol=3e-5)
    told = capsys.readouterr()
    assert told.out == ''
    for text in (
        '8 of 9',
        'empty.jpg',
        'sigma0',
        '3 to 4',
        'check',
        'scale bar 1 to 99 is not used',
        'rays a target',
    ):
        assert text in told.err
    files = {it.name for it in folder.iterdir()}
    assert files >= {'network.json', 'points.csv', 'report.html', 'poses.csv', 'residuals.csv'}
    assert files >= {'camera_ros.yaml', 'camera_opencv.yaml', 'scale_bars.csv'}
    for name in ('colmap/cameras.txt', 'metashape/cameras.xml', 'mmvii/MMVII-PhgrProj'):
        assert (tmp_path / name).exists()
    with (folder / 'scale_bars.csv').open(newline='') as file:
        used, check = csv.DictReader(file)
    assert used['role'] == 'control' and abs(float(used['deviation'])) < 0.02
    assert abs(float(check['deviation'])) < 4 * float(check['sigma_deviation'])


def test_control_points_give_their_frame(results: Path, tmp_path: Path) -> None:
    options = ('--calibration', results.parent / 'camera.yaml', '--quiet')
    control = ('--control', results.parent / 'points.csv', '--control-sigma', 0.01, '--unit', 'm')
    assert status('orient', results, '-o', tmp_path, *options, *control) == 0
    found = read_network(tmp_path)
    assert found.points.unit == 'm'
    assert np.abs(found.points.xyz - TRUE.state.points).max() < 0.2
    assert (tmp_path / 'control.csv').exists()


@pytest.mark.parametrize('keep', [False, True])
def test_a_wrong_bar_has_a_status_of_its_own(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], keep: bool
) -> None:
    points = TRUE.state.points
    lengths = [float(np.linalg.norm(points[2 * it] - points[2 * it + 1])) for it in range(3)]
    rows = [(2 * it + 1, 2 * it + 2, length, 0.01) for it, length in enumerate(lengths)]
    rows[1] = (*rows[1][:2], lengths[1] + 5, 0.01)
    with (tmp_path / 'bars.csv').open('w', newline='') as file:
        csv.writer(file).writerows([('id_1', 'id_2', 'length', 'sigma'), *rows])
    options = ['--scale-bars', tmp_path / 'bars.csv', *(['--keep-suspects'] if keep else [])]
    camera = '--calibration', results.parent / 'camera.yaml'
    assert status('orient', results, '-o', tmp_path / 'out', *camera, *options) == 3
    told = ' '.join(capsys.readouterr().err.split())
    assert 'scale bar 3-4 contradicts the rest by' in told
    assert ('kept' if keep else 'left out') in told
    found = read_network(tmp_path / 'out')
    assert not found.rejected
    error = distances(found.points.xyz) - distances(points)
    assert (np.abs(error).max() < 0.2) == (not keep)


def test_a_calibration_of_another_camera_makes_the_status_3(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """All is written; sigma0 and the status say that it does not agree."""
    wrong = CALIBRATION.copy()
    wrong[1] += 60  # cx
    path = tmp_path / 'camera.yaml'
    path.write_bytes(ros_yaml(CameraView('camera', *SIZE), wrong, np.zeros((10, 10))))
    assert status('orient', results, '-o', tmp_path / 'out', '--calibration', path) == 3
    assert read_network(tmp_path / 'out').points.sigma0 > 3
    told = ' '.join(capsys.readouterr().err.split())
    assert 'Not to be trusted yet' in told and 'image points do not fit' in told


def test_groups_are_written_each_by_itself(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Photographs of other targets are another network."""
    lines = [json.loads(line) for line in results.read_text().splitlines()[:8]]
    others = json.loads(json.dumps(lines[:6]))
    for record in others:
        record['image'] = f'other_{record["image"]}'
        for target in record['targets']:
            target['id'] += 100
    path = tmp_path / 'results.jsonl'
    path.write_text('\n'.join(json.dumps(it) for it in lines + others))
    camera = '--calibration', results.parent / 'camera.yaml'
    assert status('orient', path, '-o', tmp_path / 'out', *camera) == 0
    large, small = (read_network(tmp_path / name) for name in ('out', 'out/group_2'))
    assert [len(it.photographs) for it in (large, small)] == [8, 6]
    assert small.points.names == tuple(str(100 + int(name)) for name in large.points.names)
    assert small.photographs[0] == 'other_view_0.jpg'
    told = ' '.join(capsys.readouterr().err.split())
    assert 'group 2 of 2' in told and 'no pose' not in told


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        (['--datum', 'free'], "datum is 'free', accepted is inner"),
        (['--datum', 'fixed:1,2'], "datum is 'fixed:1,2'"),
        (['--focal-length', '35 cm'], "focal_length is '35 cm', accepted is a length such as"),
        (['--focal-length', '0mm'], "focal_length is '0mm'"),
        (
            ['--export', 'odm=x'],
            "export is 'odm=x', accepted is FORMAT=DIR with a format of colmap",
        ),
        (['--sigma', '0'], "sigma is '0'"),
    ],
)
def test_options_that_are_not_accepted(
    results: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    options: list[str],
    message: str,
) -> None:
    assert status('orient', results, '-o', tmp_path / 'out', *options) == 2
    assert message in ' '.join(capsys.readouterr().err.split())
    assert not (tmp_path / 'out').exists()


def test_files_that_cannot_be_used(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each of them is named, nothing is written, and the exit status is 1."""
    (tmp_path / 'empty.jsonl').touch()
    (tmp_path / 'other.yaml').write_bytes(
        ros_yaml(CameraView('camera', 800, 600), CALIBRATION, np.zeros((10, 10)))
    )
    (tmp_path / 'bars.csv').write_text('id_1,id_2,length,sigma\n98,99,5,1\n')
    (tmp_path / 'two.jsonl').write_text('\n'.join(results.read_text().splitlines()[:1]))
    for arguments, message in (
        ([tmp_path / 'empty.jsonl'], 'has no identified target'),
        ([tmp_path / 'gone.jsonl'], 'cannot be read'),
        ([results, '--calibration', tmp_path / 'other.yaml'], 'of 800 x 600 px'),
        ([results, '--scale-bars', tmp_path / 'bars.csv'], 'no scale bar has both ends'),
        ([tmp_path / 'two.jsonl'], ''),
    ):
        assert status('orient', *arguments, '-o', tmp_path / 'out') == 1
        told = capsys.readouterr().err
        assert told.startswith('ahf orient: ') and message in told
        assert not (tmp_path / 'out').exists()


def test_coordinates_do_not_depend_on_the_threads_of_blas(tmp_path: Path) -> None:
    panel = tmp_path / 'half.csv'
    with (ROOT / 'docs' / 'examples' / 'panel.csv').open(newline='') as file:
        header, *rows = csv.reader(file)
    half = sorted({row[0] for row in rows})[::2]
    with panel.open('w', newline='') as file:
        csv.writer(file).writerows([header, *(row for row in rows if row[0] in half)])
    given = str(panel), '--focal-length', '2100px'
    command = [sys.executable, '-m', 'ahf_ros.cli', 'orient', *given]
    command += ['--quiet', '-o']
    tables = []
    for threads in '12':
        variables = environment(OPENBLAS_NUM_THREADS=threads)
        subprocess.run([*command, str(tmp_path / threads)], env=variables, cwd=ROOT, check=True)
        tables.append((tmp_path / threads / 'points.csv').read_bytes())
    assert tables[0] == tables[1]


def test_a_robot_says_where_its_camera_is(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Poses in millimetres are recognised; files are in metres, as ROS has them."""
    mount = Transform(np.asarray(cv2.Rodrigues((0.1, -0.2, 1.5))[0]), np.array([0.02, -0.05, 0.1]))
    base = Transform(np.asarray(cv2.Rodrigues((3.0, 0.1, 0.2))[0]), np.array([0.8, 0.1, -0.2]))
    rows = [('image', 'x', 'y', 'z', 'rx', 'ry', 'rz')]
    for name, rotation, position in zip(
        TRUE.network.photographs, TRUE.state.rotations, TRUE.state.positions, strict=True
    ):
        robot = base @ Transform(rotation.T, 1e-3 * position) @ mount.inverse
        rows.append(
            (name, *(f'{1e3 * it:.6f}' for it in robot.translation), *map(str, robot.turn))
        )
    with (tmp_path / 'robot.csv').open('w', newline='') as file:
        csv.writer(file).writerows(rows)
    folder = results.parent
    known = '--calibration', folder / 'camera.yaml', '--control', folder / 'points.csv'
    robot = '--robot-poses', tmp_path / 'robot.csv'
    assert status('orient', results, '-o', tmp_path / 'network', *known, *robot) == 0
    record = json.loads((tmp_path / 'network' / 'mounting.json').read_text())
    camera, targets = record['transforms']
    assert (camera['parent'], camera['child']) == ('tool0', CAMERA_FRAME)
    assert (targets['parent'], targets['child']) == ('base', 'targets')
    np.testing.assert_allclose(camera['translation'], mount.translation, atol=1e-3)
    np.testing.assert_allclose(targets['translation'], base.translation, atol=1e-3)
    assert min(np.diag(camera['covariance'])) > 0
    launch = YAML(typ='safe').load(tmp_path / 'network' / 'static_transforms.launch.yaml')
    arguments = launch['launch'][0]['node']['args'].split()
    assert arguments[-4:] == ['--frame-id', 'tool0', '--child-frame-id', CAMERA_FRAME]
    values = dict(zip(arguments[:-4:2], map(float, arguments[1:-4:2]), strict=True))
    quaternion = [values[f'--q{it}'] for it in 'xyzw']
    np.testing.assert_allclose(quaternion, camera['rotation'], atol=1e-9)
    assert f'tool0 to {CAMERA_FRAME}' in capsys.readouterr().err
    metres = '--robot-unit', 'm', *robot
    assert status('orient', results, '-o', tmp_path / 'wrong', *known, *metres) == 1
    assert 'the poses of the robot are in mm' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('content', 'message'),
    [
        ('image,x,y,z\na.jpg,1,2,3\n', 'has no rotations, accepted are qx, qy, qz, qw'),
        ('image,x,y,z,qx,qy,qz,qw\na.jpg,1,2,3,0,0,0,2\n', 'the quaternion has the length 2'),
        ('image,x,y,z,rx,ry,rz\na.jpg,1,2,3,90,0,0\n', 'accepted is one in rad'),
        ('image,x,y,z,rx,ry,rz\na,1,2,3,1,0,0\na,1,2,3,1,0,0\n', 'a is there twice'),
    ],
)
def test_wrong_poses_of_a_robot_are_refused(tmp_path: Path, content: str, message: str) -> None:
    (tmp_path / 'robot.csv').write_text(content)
    with pytest.raises(ValueError, match=message):
        read_robot_poses(tmp_path / 'robot.csv')


def test_all_tables_are_read_before_anything_is_computed(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'table.csv').write_text('image,x\na.jpg,1\n')
    for option in ('robot-poses', 'stations'):
        given = f'--{option}', tmp_path / 'table.csv'
        assert status('orient', results, '-o', tmp_path / 'network', *given) == 1
        assert 'table.csv' in capsys.readouterr().err
    assert not (tmp_path / 'network').exists()


def test_progress_is_lines_where_it_is_asked_for_and_no_terminal(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert status('orient', results, '-o', tmp_path, '--quiet', '--progress') == 0
    lines = [it.removeprefix('ahf orient: ') for it in capsys.readouterr().err.splitlines()]
    assert lines[0] == 'start values: a beginning among 8 photographs'
    assert 'start values: 8 of 8 photographs' in lines
    stages = list(dict.fromkeys(it.split(':')[0] for it in lines))
    assert stages == [
        'start values',
        'robust adjustment',
        'test of image points',
        'scale bars, control points and frame',
        'adjustment',
    ]
    assert not any('iteration' in it for it in lines)


def test_progress_is_a_line_that_renews_itself_on_a_terminal(
    results: Path, tmp_path: Path
) -> None:
    pty = pytest.importorskip('pty')
    ours, theirs = pty.openpty()
    command = [sys.executable, '-m', 'ahf_ros.cli', 'orient', str(results), '-o', str(tmp_path)]
    shown = b''
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=theirs, stderr=theirs, env=environment()
    ) as process:
        os.close(theirs)
        with suppress(OSError):  # its end, on Linux
            while more := os.read(ours, 4096):
                shown += more
        os.close(ours)
    assert process.returncode == 0
    assert re.search(rb'start values: \d of 8 photographs, iteration \d', shown)
    assert b'\r\x1b[2K' in shown  # the line is taken back
    assert shown.index(b'start values') < shown.index(b'relative precision')
