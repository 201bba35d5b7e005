"""`ahf export` and `ahf identify --export`: one way from results to files."""

import json
from pathlib import Path

import pytest

from ahf_ros.network.export.formats import FORMATS
from support.command_line import ahf, status
from support.exported import READERS

SCENE = ('--width', 320, '--height', 240, '--targets', 3, '--dot-radius', 10, '--seed', 4)


@pytest.fixture(scope='module')
def identified(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str, str]:
    """Return a folder with exports, and what `ahf identify` printed."""
    folder = tmp_path_factory.mktemp('exports')
    assert status('render', folder, *SCENE) == 0
    (image,) = folder.glob('*.png')
    exports = [option for name in FORMATS for option in ('--export', f'{name}={folder / name}')]
    points = [f'{number},{number}.5,0,-1\n' for number in range(1000)]
    (folder / 'points.csv').write_text('label,x,y,z\n' + ''.join(points))
    control = ('--control', folder / 'points.csv', '--control-crs', 'EPSG:25832')
    options = (*exports, *control, '--control-sigma', 0.01)
    done = ahf('identify', image, '--detector', 'traditional', '--json', *options)
    assert done.returncode == 0, done.stderr
    (folder / 'results.jsonl').write_text(done.stdout)
    return folder, done.stdout, done.stderr


@pytest.mark.parametrize('name', FORMATS)
def test_identify_writes_what_it_prints(identified: tuple[Path, str, str], name: str) -> None:
    folder, printed, _ = identified
    result = json.loads(printed)
    expected = {str(it['id']): (it['x'], it['y']) for it in result['targets'] if it['id'] >= 0}
    found = {label: place for (_, label), place in READERS[name](folder / name).items()}
    assert found.keys() == expected.keys() and len(found) >= 3
    for label, place in found.items():
        assert place == pytest.approx(expected[label], abs=0.001)


def test_what_was_exported_is_said(identified: tuple[Path, str, str]) -> None:
    folder, _, messages = identified
    assert f'{folder / "mmvii"}: mmvii, 1 image, 2 files' in messages
    assert f'{folder / "colmap"}: colmap has no control points' in messages
    assert 'control points that no image shows: 0, 1, ' in messages


def test_export_of_results_gives_the_same_files(
    identified: tuple[Path, str, str], tmp_path: Path
) -> None:
    folder = identified[0]
    exports = [f'{name}={tmp_path / name}' for name in FORMATS]
    control = ('--control', folder / 'points.csv', '--control-crs', 'EPSG:25832')
    given = (folder / 'results.jsonl', *exports, *control, '--control-sigma', 0.01)
    assert status('export', *given) == 0
    files = [it.relative_to(tmp_path) for it in tmp_path.rglob('*') if it.is_file()]
    assert len(files) >= 12
    for file in files:
        assert (tmp_path / file).read_bytes() == (folder / file).read_bytes()


@pytest.mark.parametrize(
    ('rows', 'message'),
    [
        ('7,1,2\n', "has no column id, x, y, z, its columns are '7, 1, 2'"),
        ('7,1,2,3\n9,1,2,inf\n', "line 2: z is 'inf', accepted is a finite number"),
        ('\n', 'is empty, accepted is a table with id, x, y, z'),
        ('nugget,1,2,3\n', 'no control point is a target of the images: the list has nugget'),
    ],
)
def test_damaged_control_points_are_named(
    identified: tuple[Path, str, str],
    rows: str,
    message: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / 'points.csv').write_text(rows)
    given = (identified[0] / 'results.jsonl', f'csv={tmp_path / "out"}')
    assert status('export', *given, '--control', tmp_path / 'points.csv') == 1
    assert message in capsys.readouterr().err
    assert not (tmp_path / 'out').exists()


def test_an_export_that_fails_leaves_the_others(
    identified: tuple[Path, str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'file').write_text('')
    results = identified[0] / 'results.jsonl'
    exports = [f'odm={tmp_path}', f'csv={tmp_path / "file"}', f'mmvii={tmp_path / "out"}']
    assert status('export', results, *exports) == 1
    messages = capsys.readouterr().err
    assert 'ahf export: odm: odm has only control points, accepted are results with' in messages
    assert f'ahf export: csv: {tmp_path}/file/targets.csv cannot be written: ' in messages
    assert len(list((tmp_path / 'out').rglob('*.xml'))) == 1


@pytest.mark.parametrize(
    ('options', 'expected', 'message'),
    [
        ('--export photomodeler=out', 2, "export is 'photomodeler=out', accepted is FORMAT=D"),
        ('--export odm=out', 2, "odm knows images by their names, 'other/a.png' and 'a.png'"),
        ('--control points.csv', 2, 'control is given without export, accepted is both'),
        ('--export csv=out --control-crs EPSG:4326', 2, 'given without control, accep'),
        ('--export csv=out --upright', 2, 'upright is given with export, accepted is one'),
        ('--export csv=out --control missing', 1, 'missing cannot be read: No such'),
        ('--export csv=out --control-sigma -1', 2, 'control_sigma is '),
    ],
)
def test_what_does_not_fit_is_refused_before_any_image(
    options: str, expected: int, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert status('identify', 'a.png', 'other/a.png', *options.split()) == expected
    assert message in capsys.readouterr().err
