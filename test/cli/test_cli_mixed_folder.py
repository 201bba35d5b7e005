"""Folders as people have them: broken files, other families, one photograph twice, mirrors."""

import json
from pathlib import Path
from typing import Any

import pytest

from ahf_ros.files.image_files import write_image
from ahf_ros.scenes.scene import Rendering, SceneSettings
from support.command_line import status
from support.scenes import rendered


def scene(family: str, seed: int = 3) -> Rendering:
    usual = dict(width=360, height=300, targets=4, dot_radius=9)
    return rendered(SceneSettings(**usual, family=family, seed=seed))


def records_of(folder: Path, capsys: pytest.CaptureFixture, *options: object) -> Any:
    """Return the exit status, the records by the names of files, and what is said."""
    done = status('identify', folder, '--json', '--jobs', 1, *options)
    output, said = capsys.readouterr()
    records = [json.loads(line) for line in output.splitlines()]
    return done, {Path(it['image']).name: it for it in records}, said


def ids(record: dict[str, Any]) -> list[tuple[str, int]]:
    return sorted((it['family'], it['id']) for it in record['targets'])


@pytest.mark.parametrize('broken', ['a.png', 'c.png'])  # the first, and one in the middle
def test_a_folder_with_a_broken_file_another_family_and_one_photograph_twice(
    broken: str, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    of = {'b.png': 'metashape12', 'd.png': 'aicon14', 'e.png': 'metashape12'}
    for name, family in of.items():
        write_image(tmp_path / name, scene(family).image)
    (tmp_path / broken).write_bytes((tmp_path / 'b.png').read_bytes()[:3000])
    done, records, said = records_of(tmp_path, capsys)
    assert done == 1
    (problem,) = [line for line in said.splitlines() if line.startswith('ahf identify: ')]
    assert str(tmp_path / broken) in problem
    assert 'families: aicon14, metashape12\n' in said
    assert records.keys() == of.keys()
    for name, family in of.items():
        assert ids(records[name]) == sorted((family, it.id) for it in scene(family).targets)
    assert records['b.png']['targets'] == records['e.png']['targets']


def test_a_mirrored_print_is_said_where_ids_are_expected(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    right = scene('metashape14')  # most words of 12 bits are their own mirror images
    write_image(tmp_path / 'a.png', right.image)
    write_image(tmp_path / 'b.png', right.image[:, ::-1].copy())
    expected = ','.join(str(it.id) for it in right.targets)
    options = ('--expected-ids', expected, '--no-ahf')
    done, records, said = records_of(tmp_path, capsys, *options)
    assert done == 0
    assert [records[name]['mirrored'] for name in ('a.png', 'b.png')] == [False, True]
    (line,) = [line for line in said.splitlines() if 'seems to be mirrored' in line]
    assert 'b.png' in line
