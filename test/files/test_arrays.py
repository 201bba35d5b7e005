"""Archives of arrays that are not what they are said to be."""

import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ahf_ros.files.arrays import read_arrays

EXPECTED = {'ids': ('U', (2,)), 'values': ('f', (2, 3))}


def member(array: np.ndarray) -> bytes:
    """Return an array as a file."""
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def archive(path: Path, **members: bytes) -> Path:
    whole = {'ids': member(np.array(['a', 'b'])), 'values': member(np.arange(6.0).reshape(2, 3))}
    with zipfile.ZipFile(path, 'w', zipfile.ZIP_DEFLATED) as file:
        for name, content in (whole | members).items():
            if content:
                file.writestr(f'{name}.npy', content)
    return path


@pytest.mark.parametrize('order', ['C', 'F'])
def test_arrays_are_read_in_either_order(tmp_path: Path, order: str) -> None:
    values = np.array(np.arange(6.0).reshape(2, 3), order=order)
    found = read_arrays(archive(tmp_path / 'a.npz', values=member(values)), EXPECTED)
    assert found['ids'].tolist() == ['a', 'b']
    np.testing.assert_array_equal(found['values'], values)


def encrypted(content: bytes) -> bytes:
    """Return an archive whose members say that they are encrypted."""
    changed = bytearray(content)
    for mark, place in ((b'PK\3\4', 6), (b'PK\1\2', 8)):
        start = -1
        while (start := content.find(mark, start + 1)) >= 0:
            changed[start + place] |= 1
    return bytes(changed)


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        (b'', 'has no array values, accepted are ids, values'),
        (member(np.arange(6.0)), r'values has the shape \(6,\), accepted is \(2, 3\)'),
        (member(np.arange(6).reshape(2, 3)), 'values is of int64, accepted are numbers of kind f'),
        (member(np.arange(6.0).reshape(2, 3))[:-8], 'values is cut or too long, accepted are 48'),
        (member(np.arange(6.0).reshape(2, 3)) + b'0', 'values is cut or too long'),
    ],
)
def test_an_array_that_is_another_one_is_named(tmp_path: Path, values: bytes, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        read_arrays(archive(tmp_path / 'a.npz', values=values), EXPECTED)


def test_an_object_is_not_read(tmp_path: Path) -> None:
    ids = member(np.array([{}, {}], object))
    with pytest.raises(ValueError, match='ids is of object, accepted are numbers of kind U'):
        read_arrays(archive(tmp_path / 'a.npz', ids=ids), EXPECTED)


@pytest.mark.parametrize(
    'harm', [encrypted, lambda content: content.replace(b'\x08\0', b'\x63\0')]
)
def test_an_archive_that_is_encrypted_or_packed_otherwise_is_named(
    tmp_path: Path, harm: Callable[[bytes], bytes]
) -> None:
    path = archive(tmp_path / 'a.npz')
    path.write_bytes(harm(path.read_bytes()))
    with pytest.raises(ValueError, match=r'a\.npz.* accepted is'):
        read_arrays(path, EXPECTED)
