"""Adjusted networks as files, written and read back."""

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ahf_ros.network.export.formats import write_network_export
from ahf_ros.network.files.network_results import read_network, write_network
from ahf_ros.network.network import Rejection
from ahf_ros.network.solution import Solution
from support.networks import solution

KEYS = {
    '': 'sigma0 redundancy unit cameras images points covariance_of_points rejected warnings '
    'files',
    'cameras': 'name width height fx fy cx cy distortion_model distortion covariance',
    'images': 'image camera rotation position covariance',
    'points': 'id x y z rays',
    'rejected': 'image id reason normalised_residual',
}


def incomplete() -> Solution:
    """Return a network with a photograph without a pose, a target without a place, a wrong ID."""
    whole = solution()
    start = whole.state
    photographs, points = start.positions.copy(), start.points.copy()
    photographs[4] = points[2] = np.nan
    covariance = whole.covariance_of_points.copy()
    covariance[6:9] = covariance[:, 6:9] = np.nan
    used = ~np.isin(whole.network.observations.photograph, [4])
    used &= whole.network.observations.point != 2
    return replace(
        whole,
        state=replace(start, positions=photographs, points=points, used=used),
        covariance_of_points=covariance,
        rejected=(Rejection('view_1.jpg', '9', (1.0, 2.0), 'another target', -7.25),),
        warnings=('no scale',),
        scaled=True,
    )


def test_a_network_is_read_back_as_it_was_written(tmp_path: Path) -> None:
    wanted = incomplete()
    write_network(tmp_path, wanted)
    for place in (tmp_path, tmp_path / 'network.json'):
        found = read_network(place)
        points, ours = found.points, wanted.measured_points
        assert points.names == ours.names and len(ours.names) == 11 and '3' not in ours.names
        np.testing.assert_array_equal(points.xyz, ours.xyz)
        np.testing.assert_array_equal(points.covariance, ours.covariance)
        assert (points.sigma0, points.redundancy, points.unit) == (0.98, ours.redundancy, 'mm')
        assert points.scaled
        kept = [0, 1, 2, 3, 5]
        assert found.photographs == tuple(wanted.network.photographs[index] for index in kept)
        np.testing.assert_array_equal(found.rotations, wanted.state.rotations[kept])
        np.testing.assert_array_equal(found.positions, wanted.state.positions[kept])
        np.testing.assert_array_equal(found.pose_covariances, wanted.pose_covariances[kept])
        np.testing.assert_allclose(found.calibrations, wanted.state.calibrations, rtol=1e-12)
        np.testing.assert_array_equal(found.camera_covariances, wanted.camera_covariances)
        assert found.rays.tolist() == [5] * 11
        assert [(it.target, it.normalised_residual) for it in found.rejected] == [('9', -7.25)]
        assert found.warnings == (
            'no scale',
            'photographs without a pose: view_4.jpg',
            'targets without coordinates: 3',
        )


def test_backward_distortion_is_not_written(tmp_path: Path) -> None:
    """Whoever reads the files takes k1 to p2 for those of OpenCV."""
    backward = replace(solution(), backward=True)
    with pytest.raises(ValueError, match='backward is True, accepted is'):
        write_network(tmp_path, backward)
    with pytest.raises(ValueError, match='backward is True, accepted is'):
        write_network_export('colmap', tmp_path, backward)
    assert not list(tmp_path.iterdir())


def test_the_json_has_the_documented_keys_and_no_others(tmp_path: Path) -> None:
    write_network(tmp_path, incomplete())
    content = json.loads((tmp_path / 'network.json').read_text())
    for name, keys in KEYS.items():
        for item in content[name] if name else [content]:
            assert list(item) == keys.split()


def test_the_table_of_points_has_standard_deviations_and_covariances(tmp_path: Path) -> None:
    wanted = solution()
    write_network(tmp_path, wanted)
    with (tmp_path / 'points.csv').open(newline='') as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 12
    for index, row in enumerate(rows):
        block = wanted.covariance_of_points[3 * index : 3 * index + 3, 3 * index : 3 * index + 3]
        sigmas = [float(row[f'sigma_{axis}']) for axis in 'xyz']
        np.testing.assert_allclose(sigmas, np.sqrt(np.diag(block)), rtol=1e-8)
        assert float(row['covariance_xz']) == pytest.approx(block[0, 2], rel=1e-8)
        assert int(row['rays']) == 6


CHANGES: dict[str, tuple[Callable[[Any], Any], str]] = {
    'no points': (lambda it: it.pop('points'), "has no 'points'.*of this version"),
    'no redundancy': (lambda it: it.pop('redundancy'), "has no 'redundancy'.*of this version"),
    'NaN': (lambda it: it['points'][1].update(x=float('nan')), 'points 2: x is nan'),
    'text': (lambda it: it['points'][1].update(x='1'), "points 2: x is '1'.*a number"),
    'twice': (lambda it: it['points'][1].update(id='1'), "points have '1' twice"),
    'fewer': (lambda it: it['points'].pop(), 'ids has the shape'),
    'shape': (lambda it: it['images'][0].update(rotation=[[1, 0], [0, 1]]), r'\(3, 3\)'),
    'camera': (lambda it: it['images'][0].update(camera='other'), "'other', not in cameras"),
}


@pytest.mark.parametrize('name', CHANGES)
def test_a_damaged_network_is_named(tmp_path: Path, name: str) -> None:
    write_network(tmp_path, solution())
    change, text = CHANGES[name]
    path = tmp_path / 'network.json'
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    with pytest.raises(ValueError, match=text) as caught:
        read_network(tmp_path)
    assert str(tmp_path) in str(caught.value)


def test_a_covariance_that_is_none_is_named(tmp_path: Path) -> None:
    write_network(tmp_path, solution())
    record = json.loads((tmp_path / 'network.json').read_text())
    del record['files']  # as in earlier versions
    (tmp_path / 'network.json').write_text(json.dumps(record))
    path = tmp_path / 'covariance_of_points.npz'
    path.write_bytes(b'')
    with pytest.raises(ValueError, match='damaged'):
        read_network(tmp_path)
    ids = np.array([str(number) for number in range(1, 13)])
    np.savez(path, ids=ids, covariance=np.full((36, 36), np.nan), scaled=False)
    with pytest.raises(ValueError, match='covariance has 1296 entries that'):
        read_network(tmp_path)
    path.unlink()
    with pytest.raises(ValueError, match='cannot be read'):
        read_network(tmp_path)


def test_a_folder_without_a_network_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r'network\.json cannot be read'):
        read_network(tmp_path)
