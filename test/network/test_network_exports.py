"""Adjusted networks for other software, read back by readers that share nothing with them."""

import csv
import math
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from ahf_ros.files.cloud_files import read_cloud
from ahf_ros.network.export.formats import NETWORK_FORMATS, write_network_export
from ahf_ros.network.solution import Solution
from support.networks import SIZE, solution

WHOLE = solution()
XY = WHOLE.network.observations.xy - WHOLE.residuals  # computed


def exact() -> Solution:
    """Return the network with computed image points, and without shear, which COLMAP lacks."""
    calibration = WHOLE.state.calibrations.copy()
    calibration[0, 9] = 0
    shear = XY.copy()
    for row in range(len(XY)):
        shear[row] = brown(calibration[0], WHOLE, row)
    observations = replace(WHOLE.network.observations, xy=shear)
    network = replace(WHOLE.network, observations=observations)
    return replace(WHOLE, network=network, state=replace(WHOLE.state, calibrations=calibration))


def local(of: Solution, row: int) -> np.ndarray:
    """Return the direction of an observation in the frame of its camera, z = 1."""
    seen, start = of.network.observations, of.state
    index = seen.photograph[row]
    x = start.rotations[index] @ (start.points[seen.point[row]] - start.positions[index])
    return np.asarray(x / x[2])


def brown(calibration: np.ndarray, of: Solution, row: int) -> np.ndarray:
    """Return an image point by the formulas of the manuals, p1 and p2 as OpenCV has them."""
    f, cx, cy, k1, k2, k3, p1, p2, affinity, shear = calibration
    x, y, _ = local(of, row)
    r = x * x + y * y
    radial = 1 + k1 * r + k2 * r**2 + k3 * r**3
    u = x * radial + 2 * p1 * x * y + p2 * (r + 2 * x * x)
    v = y * radial + p1 * (r + 2 * y * y) + 2 * p2 * x * y
    return np.array([cx + f * ((1 + affinity) * u + shear * v), cy + f * v])


def rows_of(path: Path) -> list[list[str]]:
    lines = path.read_text().splitlines()
    return [line.split() for line in lines if not line.startswith('#')]


def test_colmap_projects_its_points_onto_its_image_points(tmp_path: Path) -> None:
    """With (0, 0) at the corner of the first pixel, as COLMAP documents."""
    write_network_export('colmap', tmp_path, exact())
    (camera,) = rows_of(tmp_path / 'cameras.txt')
    assert camera[:4] == ['1', 'FULL_OPENCV', *map(str, SIZE)]
    fx, fy, cx, cy, *lens = map(float, camera[4:])
    assert (cx, cy) == (803.5, 596.5)
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    points = {row[0]: np.array(row[1:4], float) for row in rows_of(tmp_path / 'points3D.txt')}
    with (tmp_path / 'point_labels.csv').open(newline='') as file:
        labels = {row['point3D_id']: row['id'] for row in csv.DictReader(file)}
    assert list(labels.values()) == list(WHOLE.network.targets) and list(labels) == list(points)
    images = rows_of(tmp_path / 'images.txt')
    assert len(images) == 2 * len(WHOLE.network.photographs)
    for pose, seen in zip(images[::2], images[1::2], strict=True):
        w, x, y, z = np.array(pose[1:5], float)
        angle = 2 * math.acos(w)
        turn = cv2.Rodrigues(np.array([x, y, z]) / math.sin(angle / 2) * angle)[0]
        found = np.array(seen, float).reshape(-1, 3)
        known = np.array([points[str(int(number))] for number in found[:, 2]])
        there = known @ turn.T + np.array(pose[5:8], float)
        none = np.zeros(3)
        shown = cv2.projectPoints(there, none, none, matrix, np.array(lens))[0][:, 0]
        np.testing.assert_allclose(shown, found[:, :2], atol=1e-5)


def test_pycolmap_reads_the_model(tmp_path: Path) -> None:
    pycolmap = pytest.importorskip('pycolmap', reason='pycolmap is a large download')
    wanted = exact()
    write_network_export('colmap', tmp_path, wanted)
    model = pycolmap.Reconstruction(str(tmp_path))
    assert len(model.images) == 6 and len(model.points3D) == 12
    for index, point in model.points3D.items():
        np.testing.assert_allclose(point.xyz, wanted.state.points[index - 1], rtol=1e-9)
        assert point.track.length() == 6
    for index, image in model.images.items():
        centre = image.projection_center()
        np.testing.assert_allclose(centre, wanted.state.positions[index - 1], atol=1e-9)
        for seen in image.points2D:
            shown = image.project_point(model.points3D[seen.point3D_id].xyz)
            np.testing.assert_allclose(shown, seen.xy, atol=1e-5)


def test_metashape_projects_its_markers_onto_their_places(tmp_path: Path) -> None:
    """By the formulas of its manual, appendix C, from the corner of the first pixel."""
    write_network_export('metashape', tmp_path, WHOLE)
    lens = {it.tag: it.text or '' for it in ElementTree.parse(tmp_path / 'camera.xml').getroot()}
    assert (lens.pop('projection'), lens.pop('width'), lens.pop('height')) == (
        'frame',
        '1600',
        '1200',
    )
    value = {name: float(text) for name, text in lens.items()}
    document = ElementTree.parse(tmp_path / 'cameras.xml')
    own = document.findall('.//sensors/sensor/calibration/*')
    assert {it.tag: it.text for it in own if it.tag != 'resolution'} == lens
    poses = {
        camera.attrib['id']: np.array((camera.findtext('transform') or '').split(), float)
        for camera in document.findall('chunk/cameras/camera')
    }
    points = {
        marker.attrib['id']: [float(marker.find('reference').attrib[it]) for it in 'xyz']  # type: ignore[union-attr]
        for marker in document.findall('chunk/markers/marker')
    }
    count = 0
    for marker in document.findall('.//frame/markers/marker'):
        for place in marker.findall('location'):
            pose = poses[place.attrib['camera_id']].reshape(4, 4)
            world = np.array([*points[marker.attrib['marker_id']], 1.0])
            x, y, z, _ = np.linalg.inv(pose) @ world
            x, y = x / z, y / z
            r = x * x + y * y
            radial = 1 + value['k1'] * r + value['k2'] * r**2 + value['k3'] * r**3
            p1, p2 = value['p1'], value['p2']
            u = x * radial + p1 * (r + 2 * x * x) + 2 * p2 * x * y
            v = y * radial + p2 * (r + 2 * y * y) + 2 * p1 * x * y
            shown = (
                1600 * 0.5 + value['cx'] + u * value['f'] + u * value['b1'] + v * value['b2'],
                1200 * 0.5 + value['cy'] + v * value['f'],
            )
            expected = XY[count_of(marker, place)] + 0.5
            np.testing.assert_allclose(shown, expected, atol=1e-5)
            measured = float(place.attrib['x']), float(place.attrib['y'])
            np.testing.assert_allclose(measured, expected, atol=0.2)
            count += 1
    assert count == len(XY)


def count_of(marker: ElementTree.Element, place: ElementTree.Element) -> int:
    """Return the row of an observation: photographs in their order, each with all targets."""
    targets = len(WHOLE.network.targets)
    return int(place.attrib['camera_id']) * targets + int(marker.attrib['marker_id'])


def test_mmvii_projects_its_points_onto_its_measures(tmp_path: Path) -> None:
    """By its formulas: axes of the camera in the world, and the centre of the first pixel at 0."""
    write_network_export('mmvii', tmp_path, WHOLE)
    folder = tmp_path / 'MMVII-PhgrProj'
    points, covariances = {}, {}
    for item in ElementTree.parse(folder / 'ObjMesInstr/ahf/MesGCP-ahf.xml').iter('el'):
        name = (item.findtext('Name') or '').strip('"')
        points[name] = numbers(item, 'Pt')
        covariances[name] = numbers(item, '__Opt__Sigma2')
    np.testing.assert_allclose(points['3'], WHOLE.state.points[2], rtol=1e-12)
    block = WHOLE.covariance_of_points[6:9, 6:9]
    np.testing.assert_allclose(covariances['3'], block[[0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]])
    for index, image in enumerate(WHOLE.network.photographs):
        pose = ElementTree.parse(folder / f'Ori/ahf/Ori-PerspCentral-{image}.xml').getroot()
        name = (pose.findtext('.//NameInternalCalib') or '').strip('"')
        lens = ElementTree.parse(folder / f'Ori/ahf/{name}.xml').getroot()
        (f,) = numbers(lens, './/F')
        k1, k2, k3, p1, p2, b1, b2 = (
            numbers(lens, f'.//{tag}')[0] for tag in ('K1', 'K2', 'K3', 'p1', 'p2', 'b1', 'b2')
        )
        axes = [numbers(pose, f'.//Axe{it}') for it in 'IJK']
        measures = ElementTree.parse(folder / f'ObjMesInstr/ahf/MesIm-{image}.xml').iter('el')
        for number, item in enumerate(measures):
            label = (item.findtext('Name') or '').strip('"')
            ray = points[label] - numbers(pose, './/Center')
            x, y, z = (float(axis @ ray) for axis in axes)
            x, y = x / z, y / z
            r = x * x + y * y
            radial = k1 * r + k2 * r**2 + k3 * r**3
            u = x + x * radial + p1 * (3 * x * x + y * y) + p2 * 2 * x * y + b1 * x + b2 * y
            v = y + y * radial + p1 * 2 * x * y + p2 * (x * x + 3 * y * y)
            shown = numbers(lens, './/PP') + f * np.array([u, v])
            # The polynomial is of x and y without distortion: second order of the difference.
            np.testing.assert_allclose(shown, XY[12 * index + number], atol=0.02)
            measured = WHOLE.network.observations.xy[12 * index + number]
            np.testing.assert_allclose(numbers(item, 'Pt'), measured, atol=1e-9)
            assert numbers(item, 'Sigma2').tolist() == [0.02**2, 0, 0.02**2]


def numbers(element: ElementTree.Element, path: str) -> np.ndarray:
    return np.array((element.findtext(path) or '').split(), float)


def test_what_has_no_place_is_left_out(tmp_path: Path) -> None:
    start = WHOLE.state
    points, positions = start.points.copy(), start.positions.copy()
    points[0] = positions[1] = np.nan
    used = (WHOLE.network.observations.point != 0) & (WHOLE.network.observations.photograph != 1)
    part = replace(WHOLE, state=replace(start, points=points, positions=positions, used=used))
    for name in NETWORK_FORMATS:
        for path in write_network_export(name, tmp_path / name, part):
            text = path.read_bytes().decode('latin-1')
            assert 'view_1.jpg' not in text and 'view_1.xmp' not in str(path)
            if path.suffix == '.ply':
                assert np.isfinite(read_cloud(path)['x']).all()
            else:
                assert 'nan' not in text.lower()


def test_names_that_a_format_cannot_hold_are_refused(tmp_path: Path) -> None:
    names = ('x/a.png', 'y/a.png', *WHOLE.network.photographs[2:])
    same = replace(WHOLE, network=replace(WHOLE.network, photographs=names))
    for name in ('metashape', 'mmvii', 'blocksexchange', 'bundler'):
        with pytest.raises(ValueError, match='knows images by their names'):
            write_network_export(name, tmp_path, same)
    targets = ('"', *WHOLE.network.targets[1:])
    quoted = replace(WHOLE, network=replace(WHOLE.network, targets=targets))
    with pytest.raises(ValueError, match='quotation mark'):
        write_network_export('mmvii', tmp_path, quoted)
