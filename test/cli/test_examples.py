"""Programs of docs/examples on photographs, a recording and a network."""

import csv
import math
import re
import runpy
from pathlib import Path

import pytest

from ahf_ros.files.truth_files import read_truth
from support import ROOT
from support.command_line import status
from support.photographs import PANEL, needs_photographs

PHOTOGRAPHS = ('043_0005.png', '043_0021.png')


EXAMPLES = ROOT / 'docs' / 'examples'


def run(name: str, *arguments: object) -> None:
    """Run a program in this process."""
    runpy.run_path(str(EXAMPLES / name))['main']([str(it) for it in arguments])


def test_every_program_is_on_the_page_of_examples() -> None:
    page = (ROOT / 'docs' / 'examples.rst').read_text()
    shown = re.findall(r'^\.\. literalinclude:: examples/(\w+\.py)$', page, re.M)
    # That of Metashape is for its console, and on the page of detectors.
    others = {it.name for it in EXAMPLES.glob('*.py')} - {'metashape_detector.py'}
    assert sorted(shown) == sorted(others)
    first = (ROOT / 'docs' / 'index.rst').read_text()
    assert [it for it in shown if f'examples/{it}' not in first] == []


def test_a_network(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip('scipy')
    run('network.py', EXAMPLES / 'panel.csv', '--scale-bars', EXAMPLES / 'panel_bars.csv')
    printed = capsys.readouterr()
    rows = {it['id']: it for it in csv.DictReader(printed.out.splitlines())}
    assert len(rows) == 73
    assert '73 targets, sigma0 ' in printed.err
    assert printed.err.endswith(', mm\n')
    with (EXAMPLES / 'panel_bars.csv').open() as file:
        bars = [it for it in csv.DictReader(file) if it['role'] == 'control']
    for bar in bars:
        ends = [[float(rows[bar[it]][axis]) for axis in 'xyz'] for it in ('id_1', 'id_2')]
        assert math.dist(*ends) == pytest.approx(float(bar['length']), abs=0.05)
    assert all(0 < float(it['sigma_z']) < 0.1 for it in rows.values())


def test_a_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip('rosbags', reason='rosbags is not installed')
    from ahf_ros.bag.definitions import typestore
    from support import bags

    recorded = bags.recorded(typestore(), bags.scenes(2, light='normal'))
    recording = bags.write_ros2(tmp_path / 'recording', recorded)
    assert status('bag', recording, tmp_path / 'answered') == 0
    capsys.readouterr()
    run('recording.py', tmp_path / 'answered')
    printed = capsys.readouterr()
    rows = list(csv.DictReader(printed.out.splitlines()))
    assert len(rows) == 8
    assert len({it['stamp'] for it in rows}) == 2
    assert printed.err == '/image/coded_targets: 2 images, 4.0 targets in each\n'


@needs_photographs
def test_photographs(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    for name in PHOTOGRAPHS:
        (tmp_path / name).symlink_to(PANEL / name)
    (tmp_path / 'notes.txt').touch()
    output = tmp_path / 'results'
    run('photographs.py', tmp_path, '--family=aicon14', '--network-ids=1-200', '--output', output)
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
