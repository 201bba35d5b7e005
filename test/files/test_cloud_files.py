from pathlib import Path

import numpy as np
import pytest

from ahf_ros.files.cloud_files import read_cloud, write_pcd, write_ply

WRITERS = {'.ply': write_ply, '.pcd': write_pcd}


def cloud() -> np.ndarray:
    """Return a cloud of 3 x 4 points with a colour, gaps between fields, and a missing point."""
    kind = np.dtype(
        {
            'names': ['x', 'y', 'z', 'rgb', 'time'],
            'formats': ['<f4', '>f4', '<f4', '<u4', '<f8'],
            'offsets': [0, 4, 8, 16, 24],
            'itemsize': 40,
        }
    )
    made = np.zeros((3, 4), kind)
    for axis, name in enumerate('xyz'):
        made[name] = np.arange(12).reshape(3, 4) + 0.1 * axis
    made['z'][1, 2] = np.nan
    made['rgb'] = 0xFF8000
    made['time'] = np.linspace(0, 1, 12).reshape(3, 4)
    return made


@pytest.mark.parametrize('suffix', WRITERS)
def test_organised_clouds_come_back(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f'a{suffix}'
    path.write_bytes(WRITERS[suffix](cloud()))
    read = read_cloud(path)
    assert read.shape == (3, 4)
    assert read.dtype.names == cloud().dtype.names
    for name in read.dtype.names:
        np.testing.assert_array_equal(read[name], cloud()[name])
    assert read.dtype['y'].str == '<f4'
    assert WRITERS[suffix](read) == path.read_bytes()


def test_headers_are_those_of_the_formats() -> None:
    ply, pcd = (write(cloud()).split(b'\n') for write in WRITERS.values())
    assert ply[:6] == [
        b'ply',
        b'format binary_little_endian 1.0',
        b'obj_info num_cols 4',
        b'obj_info num_rows 3',
        b'element vertex 12',
        b'property float x',
    ]
    assert pcd[2:8] == [
        b'FIELDS x y z rgb time',
        b'SIZE 4 4 4 4 8',
        b'TYPE F F F U F',
        b'COUNT 1 1 1 1 1',
        b'WIDTH 4',
        b'HEIGHT 3',
    ]


ASCII_PLY = (
    'ply\nformat ascii 1.0\ncomment by hand\nelement vertex 2\nproperty float32 x\n'
    'property float32 y\nproperty float32 z\nelement face 0\n'
    'property list uchar int vertex_indices\nend_header\n1 2 3\nnan 5 6\n'
)
ASCII_PCD = (
    'VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 2\nPOINTS 2\n'
    'DATA ascii\n1 2 3\nnan 5 6\n'
)


@pytest.mark.parametrize(
    ('name', 'text', 'shape'), [('a.ply', ASCII_PLY, (1, 2)), ('a.PCD', ASCII_PCD, (2, 1))]
)
def test_text_is_read(tmp_path: Path, name: str, text: str, shape: tuple[int, int]) -> None:
    (tmp_path / name).write_text(text)
    read = read_cloud(tmp_path / name)
    assert read.shape == shape
    np.testing.assert_array_equal(read['x'].ravel(), [1, np.nan])
    np.testing.assert_array_equal(read['z'].ravel(), [3, 6])


@pytest.mark.parametrize(
    ('name', 'text', 'words'),
    [
        ('a.stl', '', "ends in '.stl', accepted are .ply, .pcd"),
        ('a.ply', 'solid', 'the header has no line end_header'),
        ('a.ply', ASCII_PLY.replace('ascii', 'morse'), "format is 'morse'"),
        ('a.ply', ASCII_PLY.replace('vertex 2', 'vertex 2.5'), 'accepted is an integer'),
        ('a.ply', ASCII_PLY.replace('vertex 2', 'vertex 3'), '3 points are announced'),
        ('a.ply', ASCII_PLY.replace(' z', ' w'), 'has no field z'),
        ('a.ply', ASCII_PLY.replace(' z', ' x'), 'accepted is each name once'),
        ('a.ply', ASCII_PLY.replace('comment by hand', 'obj_info num_cols 4'), 'num_cols 4'),
        ('a.pcd', ASCII_PCD.replace('FIELDS', 'FELDER'), 'the header has no FIELDS'),
        ('a.pcd', ASCII_PCD.replace('ascii', 'binary_compressed'), 'accepted are binary and'),
        ('a.pcd', ASCII_PCD.replace('SIZE 4', 'SIZE 3'), "SIZE '3'"),
        ('a.pcd', ASCII_PCD.replace('SIZE 4 4 4', 'SIZE 4'), 'fewer entries than FIELDS'),
        ('a.pcd', ASCII_PCD.replace('ascii', 'binary'), 'the file is cut'),
        ('a.pcd', ASCII_PCD.replace('HEIGHT 2', 'HEIGHT -2'), 'accepted is an integer'),
    ],
)
def test_bad_files_are_named(tmp_path: Path, name: str, text: str, words: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(ValueError) as caught:
        read_cloud(tmp_path / name)
    assert str(tmp_path / name) in str(caught.value)
    assert words in str(caught.value)
