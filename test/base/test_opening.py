"""The one way in: what no reader gets, and what becomes of what a parser raises."""

import os
import socket
from pathlib import Path

import pytest

from ahf_ros.base.opening import (
    LARGEST,
    check_regular,
    inside,
    opened,
    parsed_json,
    parsing,
    read_bytes,
    read_text,
)


def test_pipes_devices_sockets_and_folders_are_refused_by_name(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / 'pipe')
    with socket.socket(socket.AF_UNIX) as bound:
        bound.bind(str(tmp_path / 'socket'))
        places = {
            tmp_path / 'pipe': 'a named pipe',
            tmp_path / 'socket': 'a socket',
            Path('/dev/zero'): 'a device',
            tmp_path: 'a folder',
        }
        for path, kind in places.items():
            for read in (check_regular, read_bytes, read_text):
                with pytest.raises(ValueError) as error:
                    read(path, 100)
                assert str(error.value) == (
                    f'{path} cannot be read: it is {kind}, accepted is a regular file'
                )


def test_files_are_read_up_to_a_limit(tmp_path: Path) -> None:
    path = tmp_path / 'file'
    path.write_bytes(b'four')
    assert read_bytes(path, 4) == b'four'
    with opened(path, 4) as file:
        assert file.read() == b'four'
    with pytest.raises(ValueError, match='file has 4 bytes, accepted are at most 3'):
        read_bytes(path, 3)
    with pytest.raises(ValueError, match='missing cannot be read: No such file'):
        read_bytes(tmp_path / 'missing', 3)


@pytest.mark.parametrize(
    'encoding', ['utf-8', 'utf-8-sig', 'utf-16', 'utf-16-le', 'utf-16-be', 'utf_16']
)
def test_texts_are_in_utf_8_or_utf_16(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / 'text'
    path.write_text('a: größe', encoding)
    assert read_text(path, 100) == 'a: größe'
    path.write_bytes(b'a\xe9')
    with pytest.raises(ValueError, match='is not a text: byte 1 is wrong'):
        read_text(path, 100)


def test_links_do_not_lead_out_of_a_folder(tmp_path: Path) -> None:
    folder = tmp_path / 'folder'
    folder.mkdir()
    (tmp_path / 'outside').touch()
    (folder / 'link').symlink_to(tmp_path / 'outside')
    (folder / 'own').symlink_to(folder / 'file')
    assert inside(folder, 'own') == folder / 'own'
    for name in ('link', '../outside', '/etc/passwd', 'a/b'):
        with pytest.raises(ValueError, match='leads out of'):
            inside(folder, name)


def test_whatever_a_parser_raises_names_the_file() -> None:
    for error in (KeyError(1), OverflowError('big'), MemoryError(), RecursionError(), OSError(5)):
        with (
            pytest.raises(ValueError, match=r'^a\.b is damaged or .*, accepted is a list$'),
            parsing('a.b', 'a list'),
        ):
            raise error
    with pytest.raises(ValueError, match=r'^a\.b: x is 1$'), parsing('a.b', 'a list'):
        raise ValueError('x is 1')
    with pytest.raises(ValueError, match=r'^a\.b, line 1: x$'), parsing('a.b', 'a list'):
        raise ValueError('a.b, line 1: x')
    with pytest.raises(KeyboardInterrupt), parsing('a.b', 'a list'):
        raise KeyboardInterrupt


def test_integers_of_json_are_bounded() -> None:
    assert parsed_json('[1, 1.5, -12]', 'text') == [1, 1.5, -12]
    (found,) = parsed_json(f'[1{"0" * 5000}]', 'text')
    assert not abs(found) <= LARGEST
