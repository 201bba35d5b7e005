"""Commands without the packages of extras: who needs one names it, and the others do without."""

import json
import re
import runpy
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from ahf_ros import Identification
from ahf_ros.base.extras import EXTRAS, REQUIRED, MissingExtra, missing
from ahf_ros.network.files.network_results import write_network
from ahf_ros.network.testing import unit_weight
from ahf_ros.prints.gsi import point_family, positions_of
from support import ROOT
from support.command_line import python, status
from support.epochs import epoch

GSI = point_family()
MODULES = {name for extra in EXTRAS.values() for name in extra.modules}

WITHOUT = f"""
import json, sys
for name in {sorted(MODULES)}:
    sys.modules[name] = None
from ahf_ros.cli import main
for line in json.loads(sys.argv[1]):
    if main(line):
        sys.exit(line)
"""

NEEDING = {
    'bag': 'bag {folder} out',
    'cluster': 'identify {folder}/none.png --scheduler tcp://127.0.0.1:1',
    'orient': 'orient {folder}/results.jsonl -o {folder}/network',
    'print': 'targets --ids 1 -o {folder}/sheet.pdf',
    'report': 'report {folder}/results.jsonl -o {folder}/page.html',
}


@pytest.fixture
def take_away(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], str]:
    """Return what takes the packages of an extra away, and returns what is said then."""

    def taken(extra: str) -> str:
        for name in EXTRAS[extra].modules:
            monkeypatch.setitem(sys.modules, name, None)
        said = missing(extra)
        assert said.endswith(f"needed for {EXTRAS[extra].purpose}: pip install 'ahf_ros[{extra}]'")
        return said

    return taken


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    record = {'image': 'a.png', 'targets': []}
    (tmp_path / 'results.jsonl').write_text(json.dumps(record) + '\n')
    return tmp_path


@pytest.mark.parametrize('extra', NEEDING)
def test_a_command_names_the_extra_that_it_needs(
    extra: str, folder: Path, take_away: Callable[[str], str], capsys: pytest.CaptureFixture[str]
) -> None:
    said = take_away(extra)
    words = NEEDING[extra].format(folder=folder).split()
    before = sorted(folder.iterdir())
    assert status(*words) == 2
    assert capsys.readouterr().err.splitlines() == [f'ahf {words[0]}: error: {said}']
    assert sorted(folder.iterdir()) == before


def test_so_does_a_comparison(
    tmp_path: Path, take_away: Callable[[str], str], capsys: pytest.CaptureFixture[str]
) -> None:
    for seed in (1, 2):
        write_network(tmp_path / f'{seed}', epoch(seed))
    take_away('orient')
    said = missing('orient', 'scipy')
    assert status('measure', tmp_path / '1') == 0  # which needs no extra
    capsys.readouterr()
    assert status('compare', tmp_path / '1', tmp_path / '2') == 2
    assert capsys.readouterr().err == f'ahf compare: error: {said}\n'


def test_a_url_does_so_with_its_name(
    take_away: Callable[[str], str], capsys: pytest.CaptureFixture[str]
) -> None:
    said = take_away('urls')
    assert status('identify', 'http://127.0.0.1:1/a.png') == 1
    assert f'http://127.0.0.1:1/a.png cannot be read: MissingExtra: {said}' in (
        capsys.readouterr().err
    )


def test_so_does_an_image_of_a_phone(
    tmp_path: Path, take_away: Callable[[str], str], capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / 'a.heic'
    path.write_bytes(b'\0\0\0\x18ftypheic' + bytes(100))
    said = take_away('heic')
    assert status('identify', path) == 1
    error = capsys.readouterr().err
    assert f'{path} is HEIC, accepted is' in error
    assert f'; {said}' in error


def test_so_do_completion_and_tables(
    take_away: Callable[[str], str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    said = take_away('completion')
    with monkeypatch.context() as patch:
        patch.setenv('COMP_LINE', 'ahf ide')
        assert status('ide') == 1
    assert capsys.readouterr().err == f'{said}\n'
    said = take_away('dataframe')
    with pytest.raises(MissingExtra, match=re.escape(said)):
        Identification(()).to_dataframe()


def surveyed(path: Path) -> Path:
    """Return a point list of three point-distributed targets, as a survey gives it."""
    rows = []
    for number in (1, 2, 18):
        word = GSI.word(number)
        dots = dict(zip(GSI.template_names, GSI.template, strict=True))
        dots |= zip(positions_of(word), GSI.positions[GSI.decoding_dots(word)], strict=True)
        for name, (x, y) in dots.items():
            label = f'CODE{number}' if name == 'E' else f'NUGGET{number}_{name}'
            rows.append(f'{label},{x + 100 * number},{y},0')
    path.write_text('\n'.join(rows))
    return path


def test_identification_needs_no_extra(tmp_path: Path) -> None:
    scene, results = tmp_path / 'scene', tmp_path / 'out'
    lines = [
        ['render', scene, '--width', 800, '--height', 600, '--targets', 3],
        ['identify', scene, '--output', results, '--quiet'],
        ['evaluate', scene / 'truth.csv', results / 'results.jsonl'],
        ['export', results, f'metashape={tmp_path / "metashape"}'],
        ['learn-family', surveyed(tmp_path / 'list.csv'), '-o', tmp_path / 'mine.yaml'],
        ['targets', '--ids', '1', '-o', tmp_path / 'sheet.svg'],
    ]
    done = python('-c', WITHOUT, json.dumps([[str(it) for it in line] for line in lines]))
    assert done.returncode == 0, done.stderr


def test_extras_are_those_of_the_package() -> None:
    pytest.importorskip('tomllib', reason='Python is older than 3.11')
    script = runpy.run_path(str(ROOT / 'scripts' / 'write_packaging.py'))
    assert tuple(script['required']()) == REQUIRED
    assert set(script['extras']('all')) == set().union(*map(script['extras'], EXTRAS))
    for extra, (_, modules) in EXTRAS.items():
        brought = script['extras'](extra)
        assert {script['NAMES'].get(it, {}).get('import', it) for it in brought} == {
            {'pillow_heif': 'pillow-heif'}.get(it, it) for it in modules
        }


def test_the_library_needs_no_more_of_an_extra_than_it_uses(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip('scipy')
    monkeypatch.setitem(sys.modules, 'jinja2', None)
    assert unit_weight(1.0, 1).plausible
