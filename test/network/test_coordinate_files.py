"""Known coordinates from files: what is in them, in which unit, and what is refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from ahf_ros.network.files.coordinate_files import read_coordinates
from ahf_ros.network.files.network_results import write_network
from support.networks import solution


def test_a_network_is_read_in_metres_with_its_whole_covariance(tmp_path: Path) -> None:
    of = solution(unit='mm')
    write_network(tmp_path, of)
    for path in (tmp_path, tmp_path / 'network.json'):
        points = read_coordinates(path)
        assert (points.unit, points.names) == ('m', of.measured_points.names)
        assert np.allclose(points.xyz, of.measured_points.xyz / 1000)
        assert np.allclose(points.covariance, of.covariance_of_points / 1e6)
    table = read_coordinates(tmp_path / 'points.csv', 'mm')
    assert np.allclose(table.xyz, points.xyz)
    assert np.allclose(table.covariance[:3, :3], points.covariance[:3, :3])


def test_a_network_without_scale_needs_a_unit(tmp_path: Path) -> None:
    write_network(tmp_path, solution(unit=''))
    with pytest.raises(ValueError, match=r"unit is '' and .* has none, accepted is one of m, dm"):
        read_coordinates(tmp_path)
    assert read_coordinates(tmp_path, 'cm').unit == 'm'


def test_tables_and_json_say_their_unit(tmp_path: Path) -> None:
    table, record = tmp_path / 'a.csv', tmp_path / 'a.json'
    table.write_text('id,x,y,z,sigma_x,sigma_y,sigma_z,unit\ncct12:7,1,2,3,0.1,0.1,0.2,mm\n')
    point = {'id': 'cct12:7', 'x': 1, 'y': 2, 'z': 3}
    point |= {f'sigma_{axis}': sigma for axis, sigma in zip('xyz', (0.1, 0.1, 0.2), strict=True)}
    record.write_text(json.dumps({'unit': 'mm', 'points': [point]}))
    for path in (table, record):
        points = read_coordinates(path)
        assert points.names == ('cct12:7',)
        assert np.allclose(points.xyz, [[0.001, 0.002, 0.003]])
        assert np.allclose(np.sqrt(np.diag(points.covariance)), [1e-4, 1e-4, 2e-4])


@pytest.mark.parametrize(
    ('name', 'text', 'unit', 'words'),
    [
        ('a.csv', 'id,x,y,z\n1,0,0,0\n', '', "unit is '' and .*a.csv has none, accepted is one"),
        ('a.csv', 'id,x,y,z,unit\n1,0,0,0,mm\n', 'm', "unit is 'm', accepted is that of .*'mm'"),
        ('a.csv', 'id,x,y,z,unit\n1,0,0,0,px\n', '', "unit of .*a.csv is 'px', accepted is one"),
        ('a.csv', 'id,x,y,z,unit\n1,0,0,0,m\n2,0,0,0,mm\n', '', 'has the units m, mm, accepted'),
        ('a.csv', 'id,x,y,z\n1,0,0,0\n1,0,0,1\n', 'm', '1 is there twice, accepted is one row'),
        ('a.csv', 'id,x,y,z\n1,0,zero,0\n', 'm', "y is 'zero', accepted is a finite number"),
        ('a.json', '[]', 'm', 'accepted'),
        ('a.json', '{"unit": "m", "points": []}', '', 'has no points, accepted is an object'),
        ('a.json', '{"unit": "m", "points": [{"id": 1}]}', '', 'accepted is an object with id, x'),
        (
            'a.json',
            '{"unit": "m", "points": [{"id": 1, "x": 0, "y": 0, "z": 0}, '
            '{"id": 2, "x": 0, "y": 0, "z": 0, "unit": 1}]}',
            '',
            'points 2: accepted are the fields of the first point',
        ),
        ('a.json', '{"unit": "m", "points": [{"id": 1, "x": null, "y": 0, "z": 0}]}', '', 'x is'),
    ],
)
def test_bad_files_are_named(tmp_path: Path, name: str, text: str, unit: str, words: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=words):
        read_coordinates(tmp_path / name, unit)
