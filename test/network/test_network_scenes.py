"""Adjusted networks as scenes of other programs: points are projected by the formulas of each.

The formulas are those of the manuals or sources that the modules name; nothing is shared with what
writes the files.
"""

import csv
import json
import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from ahf_ros.files.tables import read_points
from ahf_ros.network.camera import project
from ahf_ros.network.export.formats import network_remark, write_network_export
from ahf_ros.network.solution import Solution
from support import ROOT
from support.networks import SIZE, solution

WHOLE = solution()
SHEAR, AFFINITY = 9, 8  # in calibrations
RC = '{http://www.capturingreality.com/ns/xcr/1.1#}'


def exact(*lacking: int, fisheye: bool = False) -> Solution:
    """Return the network without some parameters, its image points as they are computed."""
    seen, start = WHOLE.network.observations, WHOLE.state
    calibrations = start.calibrations.copy()
    calibrations[0, list(lacking)] = 0
    if fisheye:
        calibrations[0, 3:8] = 0.03, -0.01, 0.004, -0.002, 0
    poses = start.rotations[seen.photograph], start.positions[seen.photograph]
    xy = project(calibrations[0], *poses, start.points[seen.point], equidistant=fisheye)
    cameras = (replace(WHOLE.network.cameras[0], equidistant=fisheye),)
    network = replace(WHOLE.network, observations=replace(seen, xy=xy), cameras=cameras)
    return replace(WHOLE, network=network, state=replace(start, calibrations=calibrations))


def distorted(x: float, y: float, k: list[float], along_x: float, along_y: float) -> np.ndarray:
    """Return a place by Brown's model, with the tangential parameter of each axis."""
    r = x * x + y * y
    radial = 1 + k[0] * r + k[1] * r**2 + k[2] * r**3
    u = x * radial + along_x * (r + 2 * x * x) + 2 * along_y * x * y
    v = y * radial + along_y * (r + 2 * y * y) + 2 * along_x * x * y
    return np.array([u, v])


def equidistant(x: float, y: float, k: list[float]) -> np.ndarray:
    """Return a place by the fisheye model of OpenCV, whose angles are off the axis."""
    r = math.hypot(x, y)
    angle = math.atan(r)
    powers = 1 + sum(it * angle**power for it, power in zip(k, (2, 4, 6, 8), strict=True))
    return np.array([x, y]) * angle * powers / r


def agree(shown: list[np.ndarray], measured: list[np.ndarray]) -> None:
    """All 72 points are where they were measured, and nothing is there twice."""
    assert len(measured) == 72 and len(np.unique(np.round(measured, 3), axis=0)) == 72
    np.testing.assert_allclose(shown, measured, atol=2e-5)


def floats(texts: Any) -> np.ndarray:
    return np.array([float(it) for it in texts])


def test_blocks_exchange_projects_its_control_points(tmp_path: Path) -> None:
    """M_ij turns the world into the camera's frame, x right and y down; P1 is along x."""
    write_network_export('blocksexchange', tmp_path, exact(SHEAR))
    block = ElementTree.parse(tmp_path / 'blocks_exchange.xml').find('Block')
    (group,) = block.findall('Photogroups/Photogroup')
    size = group.findtext('ImageDimensions/Width'), group.findtext('ImageDimensions/Height')
    assert size == tuple(map(str, SIZE))
    assert group.findtext('CameraOrientation') == 'XRightYDown'
    focal, aspect = (float(group.findtext(it)) for it in ('FocalLengthPixels', 'AspectRatio'))
    middle = floats(group.findtext(f'PrincipalPoint/{it}') for it in 'xy')
    names = 'K1', 'K2', 'K3', 'P1', 'P2'
    *k, p1, p2 = floats(group.findtext(f'Distortion/{it}') for it in names)
    photos = {it.findtext('Id'): it for it in group.findall('Photo')}
    assert photos['1'].findtext('ImagePath') == 'view_1.jpg'
    shown, measured = [], []
    points = block.findall('ControlPoints/ControlPoint')
    assert [it.findtext('Name') for it in points] == list(WHOLE.network.targets)
    for point in points:
        world = floats(point.findtext(f'Position/{it}') for it in 'xyz')
        for seen in point.findall('Measurement'):
            pose = photos[seen.findtext('PhotoId')].find('Pose')
            matrix = floats(
                pose.findtext(f'Rotation/M_{row}{column}')
                for row in range(3)
                for column in range(3)
            )
            centre = floats(pose.findtext(f'Center/{it}') for it in 'xyz')
            x, y, z = matrix.reshape(3, 3) @ (world - centre)
            place = distorted(x / z, y / z, k, p1, p2)
            shown.append(middle + place * (focal, focal * aspect))
            measured.append(floats(seen.findtext(it) for it in 'xy'))
    agree(shown, measured)
    sigma = np.sqrt(np.diag(WHOLE.point_covariances[0]))
    accuracy = float(points[0].findtext('VerticalAccuracy'))
    assert accuracy == pytest.approx(sigma[2], rel=1e-6)


def test_realitycapture_projects_its_ground_control(tmp_path: Path) -> None:
    """By its camera math: film of 36 mm, (0, 0) in the middle of the image, t1 along x."""
    write_network_export('realitycapture', tmp_path, exact(SHEAR, AFFINITY))
    poses = {}
    for path in tmp_path.glob('*.xmp'):
        (about,) = ElementTree.parse(path).iter(
            '{http://www.w3.org/1999/02/22-rdf-syntax-ns#}Description'
        )
        value = {it.tag.removeprefix(RC): floats(it.text.split()) for it in about}
        poses[path.stem + '.jpg'] = value | {
            name.removeprefix(RC): text for name, text in about.attrib.items()
        }
    with (tmp_path / 'ground_control.csv').open() as file:
        ground = {row['#point']: floats(row[it] for it in 'xyz') for row in csv.DictReader(file)}
    with (tmp_path / 'control_points.csv').open() as file:
        rows = list(csv.DictReader(file))
    shown, measured = [], []
    for row in rows:
        pose = poses[row['#image']]
        assert pose['DistortionModel'] == 'brown3t2'
        camera = pose['Rotation'].reshape(3, 3) @ (ground[row['point']] - pose['Position'])
        x, y = camera[:2] / camera[2]
        k1, k2, k3, k4, t1, t2 = pose['DistortionCoeficients']
        assert k4 == 0
        place = distorted(x, y, [k1, k2, k3], t1, t2) * float(pose['FocalLength35mm']) / 36
        place += (float(pose['PrincipalPointU']), float(pose['PrincipalPointV']))
        shown.append(max(SIZE) * place + np.array(SIZE) / 2)  # from the corner
        measured.append(floats((row['x'], row['y'])))
    agree(shown, measured)
    first = exact(SHEAR, AFFINITY).network.observations.xy[0]
    np.testing.assert_allclose(measured[0], first + 0.5, atol=1e-5)


def test_files_beside_photographs_must_not_meet(tmp_path: Path) -> None:
    names = ('a.jpg', 'a.png', *WHOLE.network.photographs[2:])
    same = replace(WHOLE, network=replace(WHOLE.network, photographs=names))
    with pytest.raises(ValueError, match='two photographs have the file a'):
        write_network_export('realitycapture', tmp_path, same)
    assert not list(tmp_path.iterdir())


def opf_rotation(degrees: list[float]) -> np.ndarray:
    """Return R_x(omega) R_y(phi) R_z(kappa)."""
    (so, sp, sk), (co, cp, ck) = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    x = np.array([[1, 0, 0], [0, co, -so], [0, so, co]])
    y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    z = np.array([[ck, -sk, 0], [sk, ck, 0], [0, 0, 1]])
    return np.asarray(x @ y @ z)


def test_opf_projects_its_calibrated_points(tmp_path: Path) -> None:
    """The image's x is right, y up, z from the scene to the camera; (0, 0) is the corner."""
    write_network_export('opf', tmp_path, exact(SHEAR, AFFINITY))

    def read(name: str) -> Any:
        return json.loads((tmp_path / f'{name}.json').read_text())

    calibrated = read('calibrated_cameras')
    cameras = {it['id']: it for it in calibrated['cameras']}
    lenses = {it['id']: it['internals'] for it in calibrated['sensors']}
    points = {it['id']: it['coordinates'] for it in read('calibrated_control_points')['points']}
    shown, measured = [], []
    for point in read('input_control_points')['mtps']:
        for mark in point['marks']:
            camera = cameras[mark['camera_id']]
            lens = lenses[camera['sensor_id']]
            ray = np.array(points[point['id']]) - camera['position']
            x, y, z = opf_rotation(camera['orientation_deg']).T @ ray
            t1, t2 = lens['tangential_distortion']
            place = distorted(x / -z, -y / -z, lens['radial_distortion'], t2, t1)
            shown.append(lens['principal_point_px'] + lens['focal_length_px'] * place)
            measured.append(np.array(mark['position_px']))
            assert mark['accuracy'] == pytest.approx(0.02)
    agree(shown, measured)
    assert '"millimetre",0.001]' in read('scene_reference_frame')['crs']['definition']


def test_pyopf_reads_the_calibration(tmp_path: Path) -> None:
    load = pytest.importorskip('pyopf.io', reason='pyopf is not installed').load
    resolve = pytest.importorskip('pyopf.resolve').resolve
    write_network_export('opf', tmp_path, WHOLE)
    found = resolve(load(str(tmp_path / 'project.opf')))
    assert found.scene_reference_frame is not None and found.input_control_points is not None
    (sensor,) = found.calibration.calibrated_cameras.sensors
    assert sensor.internals.focal_length_px == pytest.approx(1500.0, abs=0.1)
    assert tuple(found.input_cameras.sensors[0].image_size_px) == SIZE
    cameras = found.calibration.calibrated_cameras.cameras
    np.testing.assert_allclose([it.position for it in cameras], WHOLE.state.positions)
    points = found.calibration.calibrated_control_points.points
    np.testing.assert_allclose([it.coordinates for it in points], WHOLE.state.points)


def test_the_converter_of_pix4d_has_our_poses(tmp_path: Path) -> None:
    reason = 'tqdm, which it needs, is not installed'
    converter = pytest.importorskip('opf_tools.opf2colmap.converter', reason=reason)
    write_network_export('opf', tmp_path, WHOLE)
    calibrated = json.loads((tmp_path / 'calibrated_cameras.json').read_text())
    start = WHOLE.state
    for camera, rotation, position in zip(
        calibrated['cameras'], start.rotations, start.positions, strict=True
    ):
        degrees, place = np.array(camera['orientation_deg']), np.array(camera['position'])
        (w, x, y, _), translation = converter.orient_pos_computation(degrees, place)
        np.testing.assert_allclose(translation, -rotation @ position, atol=1e-6)
        if np.isfinite(w) and w > 0.1:  # it divides by it
            skew = [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0]]
            np.testing.assert_allclose(skew, [4 * w * x, 4 * w * y], atol=1e-6)


def alicevision(folder: Path) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield places by AliceVision's formulas, and those that it observed."""
    scene = json.loads((folder / 'cameras.sfm').read_text())
    assert scene['version'] == ['1', '2', '6']
    views = {it['viewId']: it for it in scene['views']}
    poses = {it['poseId']: it['pose']['transform'] for it in scene['poses']}
    (lens,) = scene['intrinsics']
    assert lens['type'] in ('brown', 'fisheye4')
    width, height = float(lens['width']), float(lens['height'])
    fx = float(lens['focalLength']) / float(lens['sensorWidth']) * width
    focal = np.array([fx, fx * float(lens['pixelRatio'])])
    middle = floats(lens['principalPoint']) + np.array([width, height]) / 2
    *k, t1, t2 = floats(lens['distortionParams'])  # of Brown's model
    for landmark in scene['structure']:
        for seen in landmark['observations']:
            pose = poses[views[seen['observationId']]['poseId']]
            rotation = floats(pose['rotation']).reshape(3, 3).T  # column after column
            x, y, z = rotation @ (floats(landmark['X']) - floats(pose['center']))
            if lens['type'] == 'brown':
                place = distorted(x / z, y / z, k, t2, t1)
            else:
                place = equidistant(x / z, y / z, floats(lens['distortionParams']))
            yield middle + focal * place, floats(seen['x'])


@pytest.mark.parametrize('fisheye', [False, True])
def test_alicevision_projects_its_landmarks(tmp_path: Path, fisheye: bool) -> None:
    wanted = exact(SHEAR, fisheye=fisheye)
    write_network_export('alicevision', tmp_path, wanted)
    shown, measured = zip(*alicevision(tmp_path), strict=True)
    agree(list(shown), list(measured))
    np.testing.assert_allclose(measured[0], wanted.network.observations.xy[0], atol=1e-9)


def openmvg(folder: Path) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield places by OpenMVG's formulas, and those that it observed."""
    scene = json.loads((folder / 'sfm_data.json').read_text())
    views = {it['key']: it['value']['ptr_wrapper']['data'] for it in scene['views']}
    poses = {it['key']: it['value'] for it in scene['extrinsics']}
    (intrinsic,) = (it['value'] for it in scene['intrinsics'])
    lens = intrinsic['ptr_wrapper']['data']
    kind = {'pinhole_brown_t2': 'disto_t2', 'fisheye': 'fisheye'}[intrinsic['polymorphic_name']]
    for landmark in scene['structure']:
        for seen in landmark['value']['observations']:
            pose = poses[views[seen['key']]['id_pose']]
            ray = np.array(landmark['value']['X']) - pose['center']
            x, y, z = np.array(pose['rotation']) @ ray
            if kind == 'fisheye':
                place = equidistant(x / z, y / z, lens[kind])
            else:
                *k, t1, t2 = lens[kind]
                place = distorted(x / z, y / z, k, t2, t1)
            shown = lens['principal_point'] + lens['focal_length'] * place
            yield shown, np.array(seen['value']['x'])


@pytest.mark.parametrize('fisheye', [False, True])
def test_openmvg_projects_its_landmarks(tmp_path: Path, fisheye: bool) -> None:
    write_network_export('openmvg', tmp_path, exact(SHEAR, AFFINITY, fisheye=fisheye))
    shown, measured = zip(*openmvg(tmp_path), strict=True)
    agree(list(shown), list(measured))
    scene = json.loads((tmp_path / 'sfm_data.json').read_text())
    pointers = [
        it['value']['ptr_wrapper']['id'] for part in ('views', 'intrinsics') for it in scene[part]
    ]
    assert len(set(pointers)) == 7 and min(pointers) > 2**31
    labels = json.loads((tmp_path / 'landmark_labels.json').read_text())
    assert list(labels.values()) == list(WHOLE.network.targets)


def test_bundler_projects_its_points_into_undistorted_photographs(tmp_path: Path) -> None:
    """P = R X + t, p = -P / P.z, f p, from the middle of the image, y up; the whole lens."""
    wanted = exact()
    write_network_export('bundler', tmp_path, wanted)
    lines = iter((tmp_path / 'bundle.out').read_text().splitlines())
    assert next(lines) == '# Bundle file v0.3'
    cameras, points = map(int, next(lines).split())
    names = (tmp_path / 'list.txt').read_text().split()
    assert (cameras, points, names) == (6, 12, list(wanted.network.photographs))
    poses = [[floats(next(lines).split()) for _ in range(5)] for _ in range(cameras)]
    shown, measured, keys = [], [], set()
    for _ in range(points):
        world, _, views = (floats(next(lines).split()) for _ in range(3))
        for camera, key, x, y in views[1:].reshape(-1, 4):
            (f, k1, k2), *rotation, translation = poses[int(camera)]
            assert (k1, k2) == (0, 0)
            there = np.array(rotation) @ world + translation
            shown.append(-f * there[:2] / there[2])
            measured.append(np.array([x, y]))
            keys.add((int(camera), int(key)))
    agree(shown, measured)
    assert next(lines, None) is None and keys == {(i, j) for i in range(6) for j in range(12)}
    blank = ('a b.jpg', *WHOLE.network.photographs[1:])
    named = replace(WHOLE, network=replace(WHOLE.network, photographs=blank))
    with pytest.raises(ValueError, match="accepted is a name without: 'a b"):
        write_network_export('bundler', tmp_path / 'blank', named)


def test_what_a_lens_lacks_is_said_with_its_size() -> None:
    lens = WHOLE.state.calibrations[0]
    seen = np.array([[0.0, 0.0], [1599.0, 0.0], [0.0, 1199.0], [1599.0, 1199.0]])
    y = (seen[:, 1] - lens[2]) / lens[0]
    largest = np.abs(lens[0] * lens[SHEAR] * y).max()
    assert 0 < largest < 0.02
    assert network_remark('colmap', WHOLE) == network_remark('metashape', WHOLE) == ''
    assert network_remark('openmvg', WHOLE).startswith('openmvg has no affinity and shear: its ')
    calibrations = WHOLE.state.calibrations.copy()
    calibrations[0, SHEAR] *= 100
    sheared = replace(WHOLE, state=replace(WHOLE.state, calibrations=calibrations))
    expected = f'colmap has no shear: its image points differ by up to {100 * largest:.2f} px'
    assert network_remark('colmap', sheared) == expected


def test_ply_has_targets_with_their_precision(tmp_path: Path) -> None:
    write_network_export('ply', tmp_path, WHOLE)
    header, body = (tmp_path / 'targets.ply').read_bytes().split(b'end_header\n')
    kinds = {'double': '<f8', 'float': '<f4', 'int': '<i4'}
    fields = [it.split()[1:] for it in header.decode().splitlines() if it.startswith('property')]
    vertices = np.frombuffer(body, [(name, kinds[kind]) for kind, name in fields])
    np.testing.assert_array_equal([vertices[it] for it in 'xyz'], WHOLE.state.points.T)
    sigmas = np.sqrt(np.diag(WHOLE.covariance_of_points)).reshape(-1, 3)
    written = [vertices[f'sigma_{it}'] for it in 'xyz']
    np.testing.assert_allclose(written, sigmas.T, rtol=1e-6)
    assert vertices['id'].tolist() == list(range(1, 13)) and set(vertices['rays']) == {6}
    names = ('aicon14:7', *WHOLE.network.targets[1:])
    named = replace(WHOLE, network=replace(WHOLE.network, targets=names))
    write_network_export('ply', tmp_path / 'named', named)
    assert (tmp_path / 'named/ply_labels.csv').read_text().split()[1] == '0,aicon14:7'


def test_dxf_has_points_and_their_names(tmp_path: Path) -> None:
    write_network_export('dxf', tmp_path, WHOLE)
    lines = (tmp_path / 'targets.dxf').read_bytes().decode('ascii').split('\r\n')[:-1]
    groups = list(zip(map(int, lines[::2]), lines[1::2], strict=True))
    starts = [index for index, (code, _) in enumerate(groups) if code == 0]
    entities = [dict(groups[a:b]) for a, b in zip(starts, [*starts[1:], None], strict=True)]
    assert groups[-1] == (0, 'EOF') and (1, 'AC1009') in groups
    points = [it for it in entities if it[0] == 'POINT']
    places = [[float(it[code]) for code in (10, 20, 30)] for it in points]
    np.testing.assert_allclose(places, WHOLE.state.points, rtol=1e-11)
    texts = [it for it in entities if it[0] == 'TEXT']
    assert [it[1] for it in texts] == list(WHOLE.network.targets)
    height = float(texts[0][40])
    beside = np.array([[float(it[code]) for code in (10, 20)] for it in texts])
    np.testing.assert_allclose(beside - np.array(places)[:, :2], height, rtol=1e-6)


def test_vstars_lists_have_the_form_of_its_own(tmp_path: Path, gsi_list: Path | None) -> None:
    write_network_export('vstars', tmp_path, WHOLE)
    path = tmp_path / 'vstars_xyz.csv'
    found = read_points(path)
    assert list(found) == [f'CODE{name}' for name in WHOLE.network.targets]
    np.testing.assert_allclose(list(found.values()), WHOLE.state.points, atol=1e-3)
    rows = [line.split(',') for line in path.read_bytes().decode().split('\r\n')[:-1]]
    sigmas = np.sqrt(np.diag(WHOLE.covariance_of_points)).reshape(-1, 3)
    np.testing.assert_allclose([floats(it[4:7]) for it in rows], sigmas, atol=1e-3)
    assert {len(it) for it in rows} == {8} and {float(it[7]) for it in rows} == {0.0}
    if gsi_list:
        theirs = gsi_list.read_bytes().decode().split('\r\n')[0].split(',')
        assert len(theirs) == 8 and theirs[0].startswith('CODE') and theirs[7] == '0.000'


@pytest.fixture
def gsi_list() -> Path | None:
    """Return the list that V-STARS wrote, where it is present."""
    path = ROOT.parent / 'shared' / 'gsi' / 'vstars_export.csv'
    return path if path.is_file() else None


def test_jag3d_has_the_whole_covariance(tmp_path: Path) -> None:
    """Name, axis, coordinate and row; then the matrix; and what JUniForm reads of each point."""
    write_network_export('jag3d', tmp_path, WHOLE)
    rows = [line.split() for line in (tmp_path / 'jag3d.info').read_text().splitlines()]
    assert [it[0] for it in rows] == [name for name in WHOLE.network.targets for _ in range(3)]
    assert [it[1] for it in rows] == list('XYZ') * 12
    assert [int(it[3]) for it in rows] == list(range(36))
    np.testing.assert_allclose(floats(it[2] for it in rows), WHOLE.state.points.ravel())
    matrix = np.loadtxt(tmp_path / 'jag3d.cxx')
    np.testing.assert_allclose(matrix, WHOLE.covariance_of_points, rtol=1e-14)
    points = [line.split() for line in (tmp_path / 'jag3d_points.txt').read_text().splitlines()]
    assert {len(it) for it in points} == {10}
    xx, xy, xz, yy, yz, zz = floats(points[3][4:])
    own = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    np.testing.assert_allclose(own, WHOLE.covariance_of_points[9:12, 9:12], rtol=1e-8)
    names = ('two words', *WHOLE.network.targets[1:])
    named = replace(WHOLE, network=replace(WHOLE.network, targets=names))
    with pytest.raises(ValueError, match='a target without'):
        write_network_export('jag3d', tmp_path / 'named', named)


def test_lists_of_points_need_no_lens(tmp_path: Path) -> None:
    for name in ('ply', 'dxf', 'vstars', 'jag3d'):
        assert write_network_export(name, tmp_path / name, exact(fisheye=True))


@pytest.mark.parametrize('name', ['mmvii', 'blocksexchange', 'realitycapture', 'opf', 'bundler'])
def test_formats_without_fisheye_lenses_say_so(tmp_path: Path, name: str) -> None:
    message = f'has an equidistant fisheye lens, accepted by {name} are .*; colmap, metashape, '
    with pytest.raises(ValueError, match=message):
        write_network_export(name, tmp_path / name, exact(fisheye=True))


def test_colmap_has_the_fisheye_lens_of_opencv(tmp_path: Path) -> None:
    wanted = exact(SHEAR, fisheye=True)
    write_network_export('colmap', tmp_path, wanted)
    _, model, width, height, *lens = (tmp_path / 'cameras.txt').read_text().split('\n')[1].split()
    assert (model, int(width), int(height)) == ('OPENCV_FISHEYE', *SIZE)
    fx, fy, cx, cy, *k = floats(lens)
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    seen, start = wanted.network.observations, wanted.state
    turned = start.points[seen.point] - start.positions[seen.photograph]
    there = np.einsum('nij,nj->ni', start.rotations[seen.photograph], turned)
    none = np.zeros((1, 3))
    shown = cv2.fisheye.projectPoints(there[:, None], none, none, matrix, np.array(k))[0][:, 0]
    agree(list(shown), list(seen.xy + 0.5))


def test_metashape_has_a_distorted_equidistant_lens(tmp_path: Path) -> None:
    """Angles off the axis are distorted, by its manual, appendix D, Fisheye cameras."""
    wanted = exact(fisheye=True)
    write_network_export('metashape', tmp_path, wanted)
    lens = {it.tag: it.text for it in ElementTree.parse(tmp_path / 'camera.xml').getroot()}
    sensor = ElementTree.parse(tmp_path / 'cameras.xml').find('.//sensor')
    assert lens.pop('projection') == sensor.attrib['type'] == 'fisheye'
    value = {name: float(text) for name, text in lens.items()}
    seen, start = wanted.network.observations, wanted.state
    shown = []
    for photograph, point in zip(seen.photograph, seen.point, strict=True):
        ray = start.rotations[photograph] @ (start.points[point] - start.positions[photograph])
        x, y = ray[:2] / ray[2]
        r = math.hypot(x, y)
        x, y = x * math.atan(r) / r, y * math.atan(r) / r
        r = math.hypot(x, y)
        radial = 1 + sum(value[f'k{it}'] * r ** (2 * it) for it in (1, 2, 3, 4))
        u, v = x * radial, y * radial
        along = u * value['f'] + u * value['b1'] + v * value['b2']
        middle = SIZE[0] / 2 + value['cx'], SIZE[1] / 2 + value['cy']
        shown.append(np.array([middle[0] + along, middle[1] + v * value['f']]))
    agree(shown, list(seen.xy + 0.5))
