"""The example of docs/examples for photographs, on some."""

from __future__ import annotations

import csv
import runpy
from pathlib import Path

import pytest

from ahf_ros.interchange.truth_files import read_truth
from support import ROOT
from support.photographs import PANEL, needs_photographs

PHOTOGRAPHS = ('043_0005.png', '043_0021.png')


@needs_photographs
def test_photographs(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    for name in PHOTOGRAPHS:
        (tmp_path / name).symlink_to(PANEL / name)
    (tmp_path / 'notes.txt').touch()
    output = tmp_path / 'results'
    main = runpy.run_path(str(ROOT / 'docs' / 'examples' / 'photographs.py'))['main']
    main([str(tmp_path), '--family', 'aicon14', '--output', str(output)])
    with (output / 'targets.csv').open() as file:
        rows = list(csv.DictReader(file))
    truth = read_truth(PANEL / 'truth.csv')
    for name in PHOTOGRAPHS:
        own = [row for row in rows if row['image'] == name]
        places = {int(row['id']): complex(float(row['x']), float(row['y'])) for row in own}
        known = {it.id: complex(it.x, it.y) for it in truth[name]}
        assert {it.id for it in truth[name] if it.confirmed} <= set(places) <= set(known)
        assert all(abs(place - known[number]) < 4 for number, place in places.items())
    pictures = sorted(path.name for path in output.glob('*.jpg'))
    assert pictures == [f'{Path(name).stem}_targets.jpg' for name in PHOTOGRAPHS]
    *lines, last = capsys.readouterr().out.splitlines()
    assert [line.split(':')[0] for line in lines] == list(PHOTOGRAPHS)
    assert 'fewer than three photographs: [' in last
