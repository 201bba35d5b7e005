"""Files that are whole or not there."""

import csv
import os
import re
from pathlib import Path

import numpy as np
import pytest

from ahf_ros.base.target import TrueTarget
from ahf_ros.base.writing import write_whole
from ahf_ros.files.files import csv_table
from ahf_ros.files.image_files import write_image
from ahf_ros.files.tables import read_table
from ahf_ros.files.truth_files import write_truth
from support.disk import room_for


def test_a_file_is_replaced_and_its_folder_made(tmp_path: Path) -> None:
    file = tmp_path / 'new' / 'sheet.pdf'
    write_whole(file, b'first')
    write_whole(file, b'second')
    assert file.read_bytes() == b'second'
    assert [it.name for it in file.parent.iterdir()] == ['sheet.pdf']


def test_a_link_stays_one(tmp_path: Path) -> None:
    (tmp_path / 'link').symlink_to(tmp_path / 'file')
    write_whole(tmp_path / 'link', b'content')
    assert (tmp_path / 'link').is_symlink() and (tmp_path / 'file').read_bytes() == b'content'


@pytest.mark.parametrize('name', ['sheet.pdf', 'truth.csv', 'image.png'])
def test_what_does_not_fit_leaves_the_old_file(tmp_path: Path, name: str) -> None:
    file = tmp_path / name

    def write(count: int) -> None:
        if name == 'truth.csv':
            write_truth(file, {'a.png': [TrueTarget(it, 1.0, 2.0) for it in range(count)]})
        elif name == 'image.png':
            write_image(file, np.random.default_rng(0).integers(0, 255, (count, 90), np.uint8))
        else:
            write_whole(file, bytes(50 * count))

    write(4)
    before = file.read_bytes()
    message = f'{re.escape(str(file))} cannot be written: File too large'
    with room_for(1000), pytest.raises(ValueError, match=message):
        write(100)
    assert file.read_bytes() == before
    assert list(tmp_path.iterdir()) == [file]


def test_what_a_killed_process_of_the_same_number_left_is_replaced(tmp_path: Path) -> None:
    (tmp_path / f'.page.html.{os.getpid()}.part').write_bytes(b'half')
    write_whole(tmp_path / 'page.html', b'whole')
    assert [it.read_bytes() for it in tmp_path.iterdir()] == [b'whole']


def test_a_device_is_written_to_and_stays_one() -> None:
    write_whole('/dev/null', b'content')
    with pytest.raises(ValueError, match='/dev/full cannot be written: No space left on device'):
        write_whole('/dev/full', b'content')
    assert Path('/dev/null').is_char_device() and Path('/dev/full').is_char_device()


def test_tables_hold_no_formula_and_read_back(tmp_path: Path) -> None:
    names = ['=1+1', '+a', '-a', '@a', "'=1", "''-x", "'a", 'a=', '-1.5', '+2', 'a,b', '']
    path = tmp_path / 'table.csv'
    path.write_bytes(csv_table([('id', 'x'), *((name, '-0.25') for name in names)]))
    cells = [line[0] for line in csv.reader(path.read_text().splitlines())][1:]
    assert cells[:6] == ["'=1+1", "'+a", "'-a", "'@a", "''=1", 3 * "'" + '-x']
    assert cells[6:] == names[6:]
    assert [row.cells['id'] for row in read_table(path, ('id', 'x'))[1]] == names
    assert '\t' not in csv_table([('\t=1',)]).decode()
