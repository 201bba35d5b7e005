"""`ahf measure` and `ahf compare`, on networks that were adjusted and written."""

import csv
import json
import shutil
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from ahf_ros.network.files.network_results import write_network
from support.command_line import status as run
from support.epochs import epoch

MOVED = {'5': (0.2, 0.0, 0.1)}


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of networks: two epochs of one object, one of which has moved targets."""
    made = tmp_path_factory.mktemp('epochs')
    write_network(made / 'first', epoch(1))
    write_network(made / 'second', epoch(2, MOVED))
    write_network(made / 'free', epoch(3, unit=''))
    return made


def rows(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


def test_compare_names_what_moved(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table, picture = folder / 'movements.csv', folder / 'movements.svg'
    epochs = folder / 'first', folder / 'second'
    assert run('compare', *epochs, '-o', table, '-o', picture, '--json') == 0
    printed = capsys.readouterr()
    found = json.loads(printed.out)
    assert (found['congruent'], found['moved'], found['unit']) == (False, ['5'], 'mm')
    assert 'moved: 5' in printed.err
    written = {it['id']: it for it in rows(table)}
    assert len(written) == 12
    assert [name for name, it in written.items() if it['moved'] == '1'] == ['5']
    for item in found['movements']:
        row = written[item['id']]
        step = [float(row[name]) for name in ('dx', 'dy', 'dz')]
        assert step == pytest.approx(item['movement'], rel=1e-8)
        assert float(row['covariance_xz']) == pytest.approx(item['covariance'][0][2], rel=1e-8)


def test_the_picture_shows_every_target_twice(folder: Path) -> None:
    picture = folder / 'shown.svg'
    assert run('compare', folder / 'first', folder / 'second', '-o', picture, '--quiet') == 0
    root = ElementTree.fromstring(picture.read_text())
    space = {'svg': 'http://www.w3.org/2000/svg'}
    groups = root.findall('svg:g', space)
    kinds = [it.get('class') for it in groups]
    assert (len(groups), kinds.count('moved')) == (24, 2)
    assert {
        it.findtext('svg:title', '', space) for it in groups if it.get('class') == 'moved'
    } == {'5'}
    # An ellipse that does not hold its target: the movement is longer than it in its direction.
    ellipse = next(it for it in groups if it.get('class') == 'moved').find('svg:ellipse', space)
    circle = next(it for it in groups if it.get('class') == 'moved').find('svg:circle', space)
    across, down = (float(it) for it in ellipse.get('transform')[10:].split(')')[0].split())
    far = np.hypot(across - float(circle.get('cx')), down - float(circle.get('cy')))
    assert far > float(ellipse.get('rx'))


def test_compare_without_scale_says_so(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run('compare', folder / 'first', folder / 'free') == 0
    assert 'shape only' in capsys.readouterr().err
    assert run('compare', folder / 'first', folder / 'free', '--scale', 'fixed') == 1
    assert 'free_scale is False' in capsys.readouterr().err


def test_compare_takes_stable_targets(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = '--stable', '1,2,3,4', '--json', '--quiet'
    assert run('compare', folder / 'first', folder / 'second', *options) == 0
    found = json.loads(capsys.readouterr().out)
    assert found['tests'][0]['targets'] == 4
    assert found['moved'] == ['5']


def test_all_distances_are_measured(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run('measure', folder / 'first', '--json', '-o', folder / 'out') == 0
    printed = capsys.readouterr()
    found = json.loads(printed.out)['distances']
    assert len(found) == 66 and 'and 36 more' in printed.err
    written = rows(folder / 'out' / 'distances.csv')
    assert float(written[0]['distance']) == pytest.approx(found[0]['distance'])
    assert float(written[0]['sigma']) == pytest.approx(0.005, rel=1e-3)  # the scale bar


@pytest.fixture
def nominal(folder: Path) -> Path:
    """Return a table of the first epoch's coordinates in another frame, one changed by 1 mm."""
    path = folder / 'nominal.csv'
    lines = ['id,x,y,z']
    for row in rows(folder / 'first' / 'points.csv'):
        x, y, z = (float(row[axis]) for axis in 'xyz')
        lines.append(f'{row["id"]},{y + 100},{-x},{z - (row["id"] == "9")}')
    path.write_text('\n'.join(lines))
    return path


@pytest.mark.parametrize(
    'options',
    [
        ('--align-on', '1,2,3,4,5,6,7,8'),
        ('--align', 'similarity', '--align-on', '1,2,3,4,5,6,7,8', '--weights', 'equal'),
        ('--align', '3-2-1', '--align-on', '1,2,3'),
        ('--align', '3-2-1', '--align-on', '1,2,3,4,5,6'),
    ],
)
def test_deviations_after_an_alignment(
    folder: Path, nominal: Path, capsys: pytest.CaptureFixture[str], options: tuple[str, ...]
) -> None:
    command = 'measure', folder / 'first', '--nominal', nominal, '--json', '-o', folder / 'aligned'
    assert run(*command, *options) == 0
    found = {it['id']: it for it in json.loads(capsys.readouterr().out)['deviations']}
    assert found['9']['deviation'] == pytest.approx([0, 0, 1], abs=1e-6)
    assert not found['9']['aligned'] and found['2']['aligned']
    assert max(abs(it) for it in found['12']['deviation']) < 1e-6
    assert len(rows(folder / 'aligned' / 'deviations.csv')) == 12


def test_nominal_coordinates_in_another_unit_are_remarked(
    folder: Path, nominal: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    head, *lines = nominal.read_text().splitlines()
    cells = [line.split(',') for line in lines]
    small = [','.join([name, *(str(float(it) / 1000) for it in xyz)]) for name, *xyz in cells]
    nominal.write_text('\n'.join([head, *small]))
    run('measure', folder / 'first', '--nominal', nominal, '--align', 'none')
    said = capsys.readouterr().err
    assert f'{nominal}: given coordinates spread over' in said and 'are those in m?' in said


def test_no_alignment(folder: Path, nominal: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = 'measure', folder / 'first', '--nominal', nominal, '--json', '--quiet'
    assert run(*command, '--align', 'none') == 0
    found = json.loads(capsys.readouterr().out)['deviations']
    assert max(it['distance'] for it in found) > 100


def test_lengths_are_tested(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lengths = folder / 'lengths.csv'
    bar = json.loads((folder / 'first' / 'network.json').read_text())['points'][:2]
    length = np.linalg.norm(np.subtract(*([it[axis] for axis in 'xyz'] for it in bar)))
    lengths.write_text(f'id_1,id_2,length,sigma,line\n1,2,{length - 0.03},0.01,A\n')
    command = 'measure', folder / 'first', '--lengths', lengths, '--json'
    assert run(*command, '--permissible', '0.02,20000,0.05', '-o', folder / 'out') == 0
    printed = capsys.readouterr()
    (found,) = json.loads(printed.out)['lengths']
    assert found['error'] == pytest.approx(0.03) and found['within']
    assert 'VDI/VDE 2634-1 wants 7' in printed.err
    assert rows(folder / 'out' / 'lengths.csv')[0]['line'] == 'A'
    assert run(*command, '--permissible', '0.02') == 1
    assert 'NOT all are permissible' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('options', 'text'),
    [
        (('--align', 'none'), 'align is given without nominal'),
        (('--permissible', '0.1'), 'permissible is given without lengths'),
        (('--nominal', 'x', '--align', '3-2-1', '--align-on', '1,2'), 'align_on has 2 IDs'),
        (
            ('--nominal', 'x', '--align', '3-2-1', '--weights', 'equal'),
            'weights is given with 3-2-1',
        ),
        (('--nominal', 'x', '--align', 'none', '--align-on', '1'), 'align_on is given with none'),
    ],
)
def test_options_of_measure_that_contradict(
    folder: Path, capsys: pytest.CaptureFixture[str], options: tuple[str, ...], text: str
) -> None:
    assert run('measure', folder / 'first', *options) == 2
    assert text in capsys.readouterr().err


@pytest.mark.parametrize(
    ('options', 'text'),
    [
        (('compare', 'first', 'second', '--level', '2'), 'level is'),
        (('compare', 'first', 'second', '-o', 'x.pdf'), 'x.pdf has another ending'),
        (('compare', 'first', 'second', '--stable', '1,,2'), 'is no list of IDs'),
        (('measure', 'first', '--distance', '1,2,3'), 'is 3 IDs, accepted are two'),
        (('measure', 'first', '--lengths', 'x', '--permissible', 'a'), 'is no permissible error'),
        (('measure', 'first', '--lengths', 'x', '--permissible', '-1'), 'permissible error is -1'),
    ],
)
def test_values_that_are_not_accepted(
    capsys: pytest.CaptureFixture[str], options: tuple[str, ...], text: str
) -> None:
    assert run(*options) == 2
    assert text in capsys.readouterr().err


@pytest.mark.parametrize(
    ('damage', 'text'),
    [
        ('covariance', 'covariance_of_points.npz cannot be read'),
        ('names', '0 common targets'),
        ('unit', "unit is 'mm' in the first and 'm' in the second"),
    ],
)
def test_networks_that_cannot_be_compared_are_named(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], damage: str, text: str
) -> None:
    other = tmp_path / 'other'
    shutil.copytree(folder / 'second', other)
    file = other / 'network.json'
    record = json.loads(file.read_text())
    del record['files']  # as in earlier versions
    if damage == 'covariance':
        (other / 'covariance_of_points.npz').unlink()
    elif damage == 'names':
        archive = other / 'covariance_of_points.npz'
        with np.load(archive) as content:
            changed = {**content, 'ids': np.array([f'other:{it}' for it in content['ids']])}
        np.savez(archive, **changed)
        for point in record['points']:
            point['id'] = f'other:{point["id"]}'
    elif damage == 'unit':
        record['unit'] = 'm'
    file.write_text(json.dumps(record))
    assert run('compare', folder / 'first', other) == 1
    assert text in capsys.readouterr().err


def test_targets_that_are_not_there_are_named(
    folder: Path, nominal: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run('measure', folder / 'first', '--distance', '1,99') == 1
    assert 'targets 99 are not among the measured ones' in capsys.readouterr().err
    assert run('measure', folder / 'free', '--nominal', nominal, '--align', 'best-fit') == 1
    assert 'the network has no scale' in capsys.readouterr().err
    lengths = folder / 'other_lengths.csv'
    lengths.write_text('id_1,id_2,length\n1,2,100\n')
    assert run('measure', folder / 'free', '--lengths', lengths) == 1
    assert 'the network has no scale' in capsys.readouterr().err
    for line, text in (('1,1,3', 'both ends are 1'), ('1,2,-3', 'length is -3')):
        lengths.write_text(f'id_1,id_2,length\n{line}\n')
        assert run('measure', folder / 'first', '--lengths', lengths) == 1
        assert text in capsys.readouterr().err
