"""Networks from files: image points, cameras, scale bars and control points."""

import json
import struct
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from ahf_ros.base.target import Identification, Target
from ahf_ros.files.exif import FILM_DIAGONAL, Exif, read_exif
from ahf_ros.files.target_json import to_json
from ahf_ros.network.camera import project
from ahf_ros.network.files.camera_files import opencv_yaml, read_camera, ros_yaml
from ahf_ros.network.files.control_files import read_control, read_scale_bars
from ahf_ros.network.files.network_files import CameraKnowledge, make_network, read_cameras
from ahf_ros.network.files.observation_files import ObservedPhotograph, read_observations
from ahf_ros.network.network import CameraView, Network
from ahf_ros.network.read import NetworkFiles, read_network_inputs
from support.networks import CALIBRATION

NOTHING = CameraKnowledge({}, {}, {})
COVARIANCE = (4e-4, 1e-5, 1e-5, 9e-4)


def target(number: int, x: float = 10.0, family: str = 'cct12', **changes: Any) -> Target:
    values: dict[str, Any] = {'covariance': COVARIANCE} | changes
    return Target(number, 19, x, 20.0, 4.0, 3.5, family=family, **values)


def record(image: str, *targets: Target, size: tuple[int, int] = (1600, 1200)) -> dict[str, Any]:
    return to_json(Identification(targets), image, size[::-1], 'cct12', 'ring')


def saved(path: Path, *records: Mapping[str, Any] | str) -> Path:
    lines = [it if isinstance(it, str) else json.dumps(it) for it in records]
    path.write_text('\n'.join(lines))
    return path


def read(path: Path, *records: Mapping[str, Any] | str) -> tuple[ObservedPhotograph, ...]:
    return read_observations(saved(path, *records))


@pytest.fixture()
def results(tmp_path: Path) -> Path:
    return tmp_path / 'results.jsonl'


def table(folder: Path, *lines: str) -> Path:
    return saved(folder / 'table.csv', *lines)


def test_results_become_a_network(results: Path) -> None:
    undecoded = target(-1)
    found = read(
        results,
        record('p/b.png', target(12), target(3, 30.5), undecoded),
        record('p/a.png', target(3)),
    )
    network, notes = make_network(found, NOTHING)
    assert network.photographs == ('b.png', 'a.png') and network.targets == ('3', '12')
    seen = network.observations
    assert seen.photograph.tolist() == [0, 0, 1] and seen.point.tolist() == [1, 0, 0]
    np.testing.assert_array_equal(seen.xy, [[10, 20], [30.5, 20], [10, 20]])
    np.testing.assert_array_equal(seen.covariance[0], np.reshape(COVARIANCE, (2, 2)))
    (camera,) = network.cameras
    assert (camera.name, camera.width, camera.height) == ('1600 x 1200', 1600, 1200)
    assert camera.focal_length is None and camera.calibration is None
    assert (network.unit, network.set_aside, notes) == ('', (), [])


def test_several_families_name_their_targets(results: Path) -> None:
    found = read(results, record('a.png', target(3), target(3, family='aicon14')))
    assert make_network(found, NOTHING)[0].targets == ('aicon14:3', 'cct12:3')


def test_an_id_twice_and_a_singular_covariance_are_set_aside(results: Path) -> None:
    line = target(7, covariance=(1e-4, 1e-4, 1e-4, 1e-4))
    found = read(results, record('a.png', target(3), target(3, 50.0), target(5), line))
    network, _ = make_network(found, NOTHING)
    assert network.targets == ('3', '5', '7') and network.observations.point.tolist() == [1]
    told = [(it.photograph, it.target, it.xy[0], it.reason) for it in network.set_aside]
    assert told == [
        ('a.png', '3', 10.0, 'its ID is more than once in the photograph'),
        ('a.png', '3', 50.0, 'its ID is more than once in the photograph'),
        ('a.png', '7', 10.0, 'its covariance is singular'),
    ]


def test_an_unknown_covariance_is_assumed_and_said(results: Path) -> None:
    found = read(results, record('a.png', target(3, covariance=(0.0,) * 4), target(4)))
    network, notes = make_network(found, NOTHING, sigma=0.2)
    np.testing.assert_allclose(network.observations.covariance[0], 0.04 * np.eye(2))
    assert notes == ['1 image point without covariance: 0.2 px assumed']


def test_images_of_one_name_are_named_by_their_paths(results: Path) -> None:
    found = read(results, record('x/a.png', target(3)), record('y/a.png', target(3)))
    assert make_network(found, NOTHING)[0].photographs == ('x/a.png', 'y/a.png')


@pytest.mark.parametrize('field', ['image', 'width', 'targets', 'covariance'])
def test_results_of_another_version_are_refused(results: Path, field: str) -> None:
    content = record('a.png', target(3))
    del (content if field in content else content['targets'][0])[field]
    with pytest.raises(ValueError, match=f"line 1 has no '{field}', accepted.*this version"):
        read(results, content)


def test_what_is_no_result_is_refused(results: Path) -> None:
    for text, message in (
        ('', 'has no identified target'),
        ('[1]', "line 1 has no 'image'"),
        ('no JSON', 'line 1 is not JSON'),
    ):
        with pytest.raises(ValueError, match=message):
            read(results, text)
    with pytest.raises(ValueError, match=r'a\.png is there twice'):
        read(results, record('a.png', target(3)), record('a.png', target(4)))
    content = record('a.png', target(3))
    content['targets'][0]['x'] = float('nan')
    with pytest.raises(ValueError, match='x is nan, accepted is a number'):
        read(results, content)


@pytest.mark.parametrize(
    ('columns', 'values', 'covariance'),
    [
        ('sigma', '0.1', np.diag([0.01, 0.01])),
        ('sigma_x,sigma_y', '0.1,0.2', np.diag([0.01, 0.04])),
        ('variance_x,covariance_xy,variance_y', '2,-1,4', [[2, -1], [-1, 4]]),
    ],
)
def test_tables_of_other_programs_are_read(
    tmp_path: Path, columns: str, values: str, covariance: Any
) -> None:
    for separator in ',;':
        lines = f'image,id,x,y,{columns},width,height', f'a.tif,P7,5.5,6.5,{values},800,600'
        path = table(tmp_path, *(line.replace(',', separator) for line in lines))
        (photograph,) = read_observations(path, origin=0.5)
        (point,) = photograph.points
        assert (photograph.path, photograph.width, photograph.height) == ('a.tif', 800, 600)
        assert (point.name, point.xy) == ('P7', (5.0, 6.0))
        assert point.covariance is not None
        np.testing.assert_allclose(point.covariance, covariance)


@pytest.mark.parametrize(
    ('lines', 'message'),
    [
        (
            ['image,id,x', 'a,1,2'],
            r"has no column y, its columns are 'image, id, x', accepted is a header",
        ),
        (['image,id,x,y,sigma,sigma_x,sigma_y', 'a,1,2,3,1,1,1'], 'accepted is one of them'),
        (['image,id,x,y,sigma_x', 'a,1,2,3,1'], 'has sigma_x and no sigma_y'),
        (['image,id,x,y,x', 'a,1,2,3,4'], 'has the column x twice'),
        (['image,id,x,y', 'a,1,nan,3'], "line 2: x is 'nan', accepted is a finite number"),
        (['image,id,x,y', 'a,1,2,3,4'], 'line 2 has 5 cells, accepted are as many as columns'),
        (['image,id,x,y'], 'has a header and no rows'),
        ([''], 'is empty'),
        (['image,id,x,y,sigma', 'a,1,2,3,0'], 'sigma is 0, accepted is a number above 0'),
        (['image,id,x,y,variance_x,covariance_xy,variance_y', 'a,1,2,3,1,1,1'], 'definite'),
        (['image,id,x,y,width,height', 'a,1,2,3,8,6', 'a,2,2,3,6,8'], 'above it was 8 x 6'),
    ],
)
def test_bad_tables_are_refused(tmp_path: Path, lines: list[str], message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        read_observations(table(tmp_path, *lines))
    assert 'table.csv' in str(caught.value)


def test_a_photograph_of_unknown_size_is_refused(tmp_path: Path) -> None:
    found = read_observations(table(tmp_path, 'image,id,x,y', 'a.tif,1,2,3'))
    with pytest.raises(ValueError, match=r'the size of a\.tif is not known'):
        make_network(found, NOTHING)
    known = replace(NOTHING, sizes={'a.tif': (800, 600)})
    assert make_network(found, known)[0].cameras[0].width == 800


def sized_network(results: Path, known: CameraKnowledge, *sizes: tuple[int, int]) -> Network:
    records = [record(f'{i}.png', target(3), size=size) for i, size in enumerate(sizes)]
    return make_network(read(results, *records), known)[0]


def test_portrait_and_landscape_are_two_cameras(results: Path) -> None:
    records = [record(f'{size}.png', target(3), size=size) for size in ((16, 12), (12, 16))]
    network, notes = make_network(read(results, *records), NOTHING)
    assert [it.name for it in network.cameras] == ['16 x 12', '12 x 16']
    assert network.camera_of.tolist() == [0, 1]
    assert len(notes) == 1 and 'identified without --upright they are one' in notes[0]


def test_exif_tells_cameras_and_focal_lengths_apart(results: Path) -> None:
    exif = {
        '0.png': Exif('Nikon', '1', 24.0, 1000.0),
        '1.png': Exif('Nikon', '1', 35.0, 1500.0),
        '2.png': Exif('Nikon', '1', 24.0, 1000.0),
    }
    network = sized_network(results, replace(NOTHING, exif=exif), *[(16, 12)] * 3)
    named = [(it.name, it.focal_length) for it in network.cameras]
    assert named == [('Nikon 1 24 mm', 1000.0), ('Nikon 1 35 mm', 1500.0)]
    assert network.camera_of.tolist() == [0, 1, 0]


def test_a_table_tells_cameras_apart(results: Path, tmp_path: Path) -> None:
    names = read_cameras(table(tmp_path, 'image,camera', '0.png,left', '1.png,right'))
    known = replace(NOTHING, names=names)
    network = sized_network(results, known, (16, 12), (16, 12))
    assert [it.name for it in network.cameras] == ['left', 'right']
    with pytest.raises(ValueError, match=r'2\.png has no camera in the table'):
        sized_network(results, known, *[(16, 12)] * 3)
    one = replace(NOTHING, names={'0.png': 'one', '1.png': 'one'})
    with pytest.raises(ValueError, match='camera one has photographs of 16 x 12 px'):
        sized_network(results, one, (16, 12), (12, 16))
    with pytest.raises(ValueError, match='has two cameras'):
        read_cameras(table(tmp_path, 'image,camera', '0.png,left', '0.png,right'))


@pytest.mark.parametrize('write', [ros_yaml, opencv_yaml])
def test_a_calibration_is_used_as_it_is(results: Path, tmp_path: Path, write: Any) -> None:
    path = tmp_path / 'camera.yaml'
    path.write_bytes(write(CameraView('left "1"', 1600, 1200), CALIBRATION, np.eye(10)))
    file = read_camera(path)
    assert (file.name, file.width, file.height) == ('left "1"', 1600, 1200)
    np.testing.assert_allclose(file.calibration[:9], CALIBRATION[:9], rtol=1e-6, atol=1e-12)
    assert file.calibration[9] == 0  # neither ROS nor OpenCV has a shear
    known = replace(NOTHING, calibrations=[file])
    (camera,) = sized_network(results, known, (1600, 1200)).cameras
    assert camera.fixed and camera.calibration is file.calibration
    (camera,) = sized_network(results, replace(known, adjusted=True), (1600, 1200)).cameras
    assert not camera.fixed
    with pytest.raises(ValueError, match=r'of 1600 x 1200 px, 0\.png has 800 x 600 px'):
        sized_network(results, known, (800, 600))
    with pytest.raises(ValueError, match=r'1200 x 1600 px.*without --upright'):
        sized_network(results, known, (1200, 1600))


@pytest.mark.parametrize('write', [ros_yaml, opencv_yaml])
def test_a_fisheye_calibration_is_read_as_it_was_written(tmp_path: Path, write: Any) -> None:
    calibration = np.array([700, 803, 596, 0.05, 0.01, -0.004, 0.0005, 0, 1e-4, 0])
    path = tmp_path / 'camera.yaml'
    view = CameraView('wide', 1600, 1200, equidistant=True)
    path.write_bytes(write(view, calibration, np.eye(10)))
    assert 'distortion_model: equidistant' in path.read_text()
    file = read_camera(path)
    assert file.equidistant
    np.testing.assert_allclose(file.calibration, calibration, rtol=1e-6, atol=1e-12)


def test_opencv_reads_its_yaml(tmp_path: Path) -> None:
    covariance = np.diag(np.arange(1.0, 11.0) ** 2)
    covariance[0, 1] = covariance[1, 0] = -1.0
    covariance[9, 9] = 0
    path = tmp_path / 'camera.yaml'
    path.write_bytes(opencv_yaml(CameraView('left', 1600, 1200), CALIBRATION, covariance))
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert file.getNode('image_width').real() == 1600
    assert file.getNode('camera_name').string() == 'left'
    matrix = file.getNode('camera_matrix').mat()
    np.testing.assert_allclose(matrix[[0, 0, 1, 1], [0, 2, 1, 2]], [1500.15, 803, 1500, 596])
    (distortion,) = file.getNode('distortion_coefficients').mat()
    np.testing.assert_allclose(distortion, CALIBRATION[[3, 4, 6, 7, 5]])
    (deviations,) = file.getNode('standard_deviations').mat()
    np.testing.assert_allclose(deviations, [*range(1, 10), 0])
    correlations = file.getNode('correlations').mat()
    assert correlations[0, 1] == -0.5 and correlations[9, 9] == 1


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('', 'has no fields'),
        ('[', 'line 1: .*accepted is JSON or YAML'),
        ('{image_height: 6}', 'image_width is None'),
        ('{image_width: 8, image_height: 6}', r'camera_matrix is None'),
        ('{image_width: 8, image_height: 6, K: [1, 2]}', 'has 2 numbers, accepted are 9'),
        ('{image_width: 8, image_height: 6, K: [.nan, 0, 1, 0, 1, 1, 0, 0, 1]}', 'finite'),
        ('{image_width: 8, image_height: 6, K: [0, 0, 1, 0, 1, 1, 0, 0, 1]}', 'above 0'),
    ],
)
def test_bad_calibrations_are_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / 'camera.yaml'
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        read_camera(path)
    assert 'camera.yaml' in str(caught.value)


@pytest.mark.parametrize('more', [[], [1e-5, 0.0, -2e-5, 0.0]])
def test_browns_model_stands_for_more_coefficients(tmp_path: Path, more: list[float]) -> None:
    path = tmp_path / 'camera.yaml'
    distortion = [0.42, 0.1, 3e-4, -2e-4, 0.0, 0.5, 0.1, 0.0, *more]
    matrix = np.array([[3000, 0, 2010.5], [0, 3000, 1492.5], [0, 0, 1]])
    data = f'K: {matrix.tolist()}\nD: {distortion}'
    path.write_text(f'image_width: 4000\nimage_height: 3000\n{data}\n')
    lens = read_camera(path).calibration
    points = np.array([[0.0, 0.0, 1], [-0.5, 0.3, 1], [0.66, 0.49, 1]])
    seen = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, np.array(distortion))[0][
        :, 0
    ]
    turned = np.tile(np.eye(3), (3, 1, 1))
    ours = project(np.tile(lens, (3, 1)), turned, np.zeros((3, 3)), points)
    assert np.abs(ours - seen).max() < 0.1


@pytest.mark.parametrize(
    ('more', 'message'),
    [
        ('distortion_model: omni', "distortion_model is 'omni'"),
        ('distortion_model: equidistant\nD: [1, 2, 3]', 'are 4 numbers: k1, k2, k3, k4'),
        ('D: [1, 2, 3]', r'accepted are 4 or 5 numbers'),
        ('D: [1, 2, 3, 4, 5, 6, 7, 8]', r'of the rational model, from which k1, k2'),
        ('D: [1, 2, 3, 4, 5, 0, 0, 0, 1, 0, 0, 0]', r'of a thin prism, from which k1'),
    ],
)
def test_other_lenses_are_refused(tmp_path: Path, more: str, message: str) -> None:
    path = tmp_path / 'camera.yaml'
    matrix = '[9, 0, 4, 0, 9, 3, 0, 0, 1]'
    path.write_text(f'image_width: 8\nimage_height: 6\nK: {matrix}\n{more}\n')
    with pytest.raises(ValueError, match=message):
        read_camera(path)


KALIBR = """cam0:
  camera_model: {camera}
  intrinsics: [3000.0, 3010.0, 2010.5, 1492.5]
  distortion_model: {model}
  distortion_coeffs: [-0.08, 0.06, 0.0003, -0.0002]
  resolution: [4000, 3000]
  rostopic: /cam0/image_raw
"""


def test_a_calibration_of_kalibr_is_read(tmp_path: Path) -> None:
    path = tmp_path / 'camchain.yaml'
    path.write_text(KALIBR.format(camera='pinhole', model='radtan'))
    file = read_camera(path)
    assert (file.width, file.height) == (4000, 3000)
    expected = [3010, 2010.5, 1492.5, -0.08, 0.06, 0, 0.0003, -0.0002, 3000 / 3010 - 1, 0]
    np.testing.assert_allclose(file.calibration, expected, atol=1e-15)
    path.write_text(KALIBR.format(camera='pinhole', model='equidistant'))
    file = read_camera(path)
    assert file.equidistant
    expected[3:8] = [-0.08, 0.06, 0.0003, -0.0002, 0]
    np.testing.assert_allclose(file.calibration, expected, atol=1e-15)
    path.write_text(KALIBR.format(camera='omni', model='radtan'))
    with pytest.raises(ValueError, match="camera_model is 'omni'"):
        read_camera(path)
    path.write_text(KALIBR.format(camera='pinhole', model='radtan') + 'cam1: {}')
    with pytest.raises(ValueError, match='cam0, cam1, accepted is one camera a file'):
        read_camera(path)


def exif_block(equivalent: int) -> bytes:
    """Return Exif data of a 24 mm lens on a camera of Make 'Maker' and Model 'M1'."""
    first = [(271, 2, 6, 100), (272, 2, 3, b'M1\0\0'), (34665, 4, 1, 60)]
    second = [(37386, 5, 1, 110), (41989, 3, 1, struct.pack('<HH', equivalent, 0))]
    block = bytearray(b'II*\0' + struct.pack('<L', 8)).ljust(120, b'\0')
    for place, entries in ((8, first), (60, second)):
        struct.pack_into('<H', block, place, len(entries))
        for number, (tag, kind, count, value) in enumerate(entries):
            content = value if isinstance(value, bytes) else struct.pack('<L', value)
            at = place + 2 + 12 * number
            block[at : at + 12] = struct.pack('<HHL', tag, kind, count) + content
    block[100:106] = b'Maker\0'
    struct.pack_into('<LL', block, 110, 240, 10)
    return bytes(block)


def photograph(path: Path, exif: bytes) -> Path:
    _, encoded = cv2.imencode('.jpg', np.zeros((60, 80), np.uint8))
    marker = b'\xff\xe1' + struct.pack('>H', len(exif) + 8) + b'Exif\0\0' + exif
    path.write_bytes(encoded.tobytes()[:2] + marker + encoded.tobytes()[2:])
    return path


def test_a_photograph_says_its_camera_and_focal_length(tmp_path: Path) -> None:
    found, size = read_exif(photograph(tmp_path / 'a.jpg', exif_block(36)))
    assert size == (80, 60)
    assert (found.camera, found.focal_length) == ('Maker M1', 24.0)
    assert found.pixels == pytest.approx(36 / np.hypot(36, 24) * 100)
    assert read_exif(photograph(tmp_path / 'b.jpg', exif_block(0)))[0].pixels is None
    assert read_exif(photograph(tmp_path / 'c.jpg', exif_block(36)[:50]))[0].pixels is None
    with pytest.raises(ValueError, match='cannot be read'):
        read_exif(tmp_path / 'gone.jpg')


def known_network(results: Path, **known: Any) -> tuple[Network, list[str]]:
    found = read(results, record('a.png', target(3), target(4), target(5)))
    return make_network(found, NOTHING, **known)


def test_bars_and_control_are_found_by_id(results: Path, tmp_path: Path) -> None:
    lines = ('id_1,id_2,length,sigma,role', '003,4,100,0.1,', '4,5,50,0.2,check', '3,9,1,1,check')
    bars = read_scale_bars(table(tmp_path, *lines))
    control = read_control(table(tmp_path, 'id,x,y,z', '5,1,2,3', '8,1,2,3'), 0.5)
    network, notes = known_network(results, bars=bars, control=control, unit='m')
    assert [(it.ends, it.length, it.sigma, it.check) for it in network.bars] == [
        (('3', '4'), 100.0, 0.1, False),
        (('4', '5'), 50.0, 0.2, True),
    ]
    assert [it.name for it in network.control] == ['5'] and network.unit == 'm'
    np.testing.assert_array_equal(network.control[0].covariance, 0.25 * np.eye(3))
    assert notes == [
        'scale bar 3 to 9 is not used: no photograph shows 9',
        'control points that no photograph shows: 8',
    ]


def test_what_is_never_seen_is_refused(results: Path, tmp_path: Path) -> None:
    bars = read_scale_bars(table(tmp_path, 'id_1,id_2,length,sigma', '8,9,1,1'))
    with pytest.raises(ValueError, match=r'no scale bar has both ends.*shows 8 or 9'):
        known_network(results, bars=bars)
    control = read_control(table(tmp_path, 'id,x,y,z', '8,1,2,3'))
    with pytest.raises(ValueError, match=r'no control point is in a photograph.*: 8'):
        known_network(results, control=control)


def test_check_bars_give_no_scale(results: Path, tmp_path: Path) -> None:
    bars = read_scale_bars(table(tmp_path, 'id_1,id_2,length,sigma,role', '3,4,1,1,check'))
    assert known_network(results, bars=bars)[0].unit == ''


@pytest.mark.parametrize(
    ('columns', 'values', 'covariance'),
    [
        ('', '', np.zeros((3, 3))),
        (',sigma_x,sigma_y,sigma_z', ',1,2,3', np.diag([1, 4, 9])),
        (
            ',sigma_x,sigma_y,sigma_z,covariance_xy,covariance_xz,covariance_yz',
            ',1,2,3,0.1,0.2,0.3',
            [[1, 0.1, 0.2], [0.1, 4, 0.3], [0.2, 0.3, 9]],
        ),
        (
            ''.join(f',covariance_{it}' for it in ('xx', 'xy', 'xz', 'yy', 'yz', 'zz')),
            ',1,0.1,0.2,4,0.3,9',
            [[1, 0.1, 0.2], [0.1, 4, 0.3], [0.2, 0.3, 9]],
        ),
    ],
)
def test_covariances_of_control_points(
    tmp_path: Path, columns: str, values: str, covariance: Any
) -> None:
    (point,) = read_control(table(tmp_path, f'id,x,y,z{columns}', f'7,1,2,3{values}'))
    np.testing.assert_array_equal(point.xyz, [1, 2, 3])
    np.testing.assert_allclose(point.covariance, covariance)


@pytest.mark.parametrize(
    ('lines', 'message'),
    [
        (['id,x,y,z', '1,1,2,inf'], "z is 'inf', accepted is a finite number"),
        (['id,x,y,z', '1,1,2,3', '1,1,2,3'], 'line 3: 1 is there twice'),
        (['id,x,y,z,role', '1,1,2,3,maybe'], "'maybe', accepted is control or check"),
        (['id,x,y,z,sigma_x', '1,1,2,3,1'], 'sigma_x and no sigma_y, sigma_z'),
        (
            [
                'id,x,y,z,sigma_x,sigma_y,sigma_z,covariance_xy,covariance_xz,covariance_yz',
                '1,1,2,3,1,1,1,2,0,0',
            ],
            'eigenvalue -1',
        ),
    ],
)
def test_bad_control_is_refused(tmp_path: Path, lines: list[str], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_control(table(tmp_path, *lines))


@pytest.mark.parametrize(
    ('row', 'message'),
    [
        ('3,3,1,1', 'both ends are 3'),
        ('3,4,0,1', 'length is 0, accepted is a number above 0'),
        ('3,4,1,0', 'sigma is 0, accepted is a number above 0'),
        ('3,,1,1', "id_2 is ''"),
    ],
)
def test_bad_bars_are_refused(tmp_path: Path, row: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_scale_bars(table(tmp_path, 'id_1,id_2,length,sigma', row))


def test_all_files_of_a_network_are_read_in_one_place(results: Path) -> None:
    saved(results, record('a.png', target(12), target(3, 30.5)), record('b.png', target(3)))
    folder = results.parent
    saved(folder / 'cameras.csv', 'image,camera', 'a.png,left', 'b.png,right')
    saved(folder / 'bars.csv', 'id_1,id_2,length,sigma', '3,12,250,0.1')
    saved(folder / 'stations.csv', 'image,station', 'a.png,1', 'b.png,1')
    saved(folder / 'robot.csv', 'image,x,y,z,rx,ry,rz', 'a.png,1,2,3,0,0,0')
    inputs = read_network_inputs(
        NetworkFiles(
            observations=str(results),
            cameras=str(folder / 'cameras.csv'),
            scale_bars=str(folder / 'bars.csv'),
            robot_poses=str(folder / 'robot.csv'),
            stations=str(folder / 'stations.csv'),
            unit='m',
            focal_length=(35.0, 'mm'),
        )
    )
    network = inputs.network
    assert [it.name for it in network.cameras] == ['left', 'right']
    assert network.cameras[0].focal_length == pytest.approx(35.0 * 2000 / FILM_DIAGONAL)
    assert (network.bars[0].length, network.unit, inputs.notes) == (250, 'm', [])
    assert inputs.stations == {'a.png': '1', 'b.png': '1'}
    np.testing.assert_array_equal(inputs.robot_poses['a.png'].translation, [1, 2, 3])
    plain = read_network_inputs(NetworkFiles(str(results)))
    assert (plain.network.bars, plain.robot_poses, plain.stations) == ((), {}, {})
