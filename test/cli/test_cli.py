"""The command line as its users call it: processes, files, exit statuses."""

import json
import re
import struct
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ahf_ros.base.settings.nested import flat_parameters
from ahf_ros.files.image_files import read_image, write_image
from ahf_ros.files.truth_files import read_truth
from ahf_ros.identification.session_settings import IdentificationSettings
from ahf_ros.scenes.bent.settings import BentSettings
from ahf_ros.scenes.scene import SceneSettings
from support.command_line import ahf, status

SCENE = ['--width', '640', '--height', '480', '--targets', '6', '--dot-radius', '10']
KEYS = (
    'image width height upright family looked_for detector expected estimated expected_ids '
    'mirrored edge_shift codes reach targets repeated unsettled filter search elapsed_s',
    'id code x y semi_major semi_minor angle confidence covariance family '
    'edge_shift polarity followed bits',
    'applied gamma_high gamma_low cutoff attenuation evaluations generations log_offset '
    'black_percentile white_percentile',
)


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with two rendered images and their truth."""
    folder = tmp_path_factory.mktemp('rendered')
    done = ahf('render', folder, *SCENE, '--light', 'normal', 'shadow', '--seed', 4)
    assert (done.returncode, done.stdout) == (0, '')
    assert 'normal_0.3_4.png: 6 targets' in done.stderr
    return folder


@pytest.fixture(scope='module')
def results(folder: Path) -> str:
    images = (folder / 'normal_0.3_4.png', folder / 'shadow_0.3_4.png')
    done = ahf('identify', *images, '--detector', 'traditional', '--json')
    assert done.returncode == 0
    return done.stdout


@pytest.fixture
def identify(folder: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[Any, str]]:
    """Return a function from options to the result of the first image, and to what is said."""

    def identified(*options: object) -> tuple[Any, str]:
        assert status('identify', folder / 'normal_0.3_4.png', '--json', *options) == 0
        output, errors = capsys.readouterr()
        return json.loads(output), errors

    return identified


def test_rendered_images_have_their_truth(folder: Path) -> None:
    truth = read_truth(folder / 'truth.csv')
    numbers = {name: len(targets) for name, targets in truth.items()}
    assert numbers == {'normal_0.3_4.png': 6, 'shadow_0.3_4.png': 6}
    assert read_image(folder / 'shadow_0.3_4.png').shape == (480, 640)


def test_bent_sheets_are_rendered_and_identified(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / 'bent'
    scene = (*SCENE, '--maker', 'bent', '--sheets', 2, '--motion', 0.5, '--distortion', -0.1)
    assert status('render', folder, *scene, '--light', 'normal', '--seed', 5) == 0
    assert len(read_truth(folder / 'truth.csv')['normal_0.3_5.png']) == 6
    assert status('identify', folder / 'normal_0.3_5.png', '--json') == 0
    (tmp_path / 'results.jsonl').write_text(capsys.readouterr().out)
    table = ahf('evaluate', folder / 'truth.csv', tmp_path / 'results.jsonl')
    row = table.stderr.splitlines()[-1]
    assert row.split()[1:5] == ['6'] * 4, table  # expected, reported, found, right


def test_a_series_grows_and_keeps_what_was_there(tmp_path: Path) -> None:
    assert status('render', tmp_path, *SCENE, '--seed', 1) == 0
    first = (tmp_path / 'normal_0.3_1.png').read_bytes()
    assert status('render', tmp_path, *SCENE, '--seed', 2, '--count', 2) == 0
    assert (tmp_path / 'normal_0.3_1.png').read_bytes() == first
    names = [f'normal_0.3_{seed}.png' for seed in (1, 2, 3)]
    assert list(read_truth(tmp_path / 'truth.csv')) == names


def test_json_is_one_object_an_image(folder: Path, results: str) -> None:
    first, second = map(json.loads, results.splitlines())
    assert (' '.join(first), ' '.join(first['targets'][0]), ' '.join(first['filter'])) == KEYS
    assert first['image'] == str(folder / 'normal_0.3_4.png')
    assert second['image'] == str(folder / 'shadow_0.3_4.png')
    assert (first['width'], first['height'], first['expected']) == (640, 480, 0)
    assert (first['family'], first['detector']) == ('metashape12', 'traditional')
    assert first['filter']['applied'] is False
    assert 0 < first['elapsed_s'] < 100


def test_an_unknown_number_is_estimated_where_that_is_asked_for(
    identify: Callable[..., tuple[Any, str]],
) -> None:
    options = ((), ('--estimate-expected',), ('--estimate-expected', '--expected-targets', 6))
    found = [identify('--detector', 'traditional', *more)[0] for more in options]
    of = [(it['expected'], it['estimated']) for it in found]
    assert of == [(0, False), (6, True), (6, False)]
    assert found[0]['targets'] == found[1]['targets']


def test_without_json_standard_output_stays_empty(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert status('identify', folder / 'normal_0.3_4.png', '--detector', 'traditional') == 0
    output, errors = capsys.readouterr()
    assert output == ''
    head, *lines, hint = errors.splitlines()
    assert '6 identified, no filter' in head
    assert len(lines) == 6
    assert 'with --expected-targets N, AHF searches' in hint


def test_what_was_looked_for_is_said_where_nothing_is_found(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    image = tmp_path / 'empty.png'
    write_image(image, np.tile(np.arange(80, dtype=np.uint8), (60, 1)))
    for options, hint in (
        ((), 'targets of all families were looked for'),
        (('--expected-targets', 6, '--max-evaluations', 1), 'targets of all families were looked'),
        (('--family', 'aicon12'), 'targets of aicon12 were looked for; --family names others'),
        (('--detector', 'traditional'), 'targets of metashape12 were looked for; --family names'),
    ):
        assert status('identify', image, *options) == 0
        assert re.match(hint, capsys.readouterr().err.splitlines()[-1])
    status('identify', image, folder / 'normal_0.3_4.png', '--expected-ids', '1-600')
    said = capsys.readouterr().err
    assert 'looked for' not in said
    assert 'N is not given' not in said
    status('identify', image, '--quiet')
    assert capsys.readouterr().err == ''
    assert status('identify', tmp_path / 'missing.png') == 1
    (said,) = capsys.readouterr().err.splitlines()
    assert said.endswith('missing.png cannot be read: No such file or directory')


def test_targets_of_a_network_are_not_missed_where_they_are_not_in_view(
    identify: Callable[..., tuple[Any, str]], folder: Path
) -> None:
    every, _ = identify()
    ids = sorted(target['id'] for target in every['targets'])
    assert len(ids) == 6
    listed = ','.join(map(str, {*range(1, 162)} - {ids[0]}))
    found, errors = identify('--network-ids', listed, '--detector', 'traditional')
    assert [target['id'] for target in found['targets']] == ids[1:]
    assert (found['expected'], found['expected_ids'], found['search']) == (0, [], None)
    assert f'are not among those given: {ids[0]}' in errors
    assert 'missed' not in errors
    assert 'N is not given' not in errors


def test_the_former_name_of_the_number_of_targets_works_and_says_so(
    identify: Callable[..., tuple[Any, str]],
) -> None:
    for option in ('--expected-targets', '--expected'):
        found, errors = identify(option, 6, '--detector', 'traditional')
        assert found['expected'] == 6
        said = 'identify: --expected is called --expected-targets now' in errors
        assert said == (option == '--expected')


def tiff_with_unknown_tag(image: np.ndarray) -> bytes:
    """Return a TIFF file of gray values, as scanners write them."""
    height, width = image.shape
    tags = {256: width, 257: height, 258: 8, 259: 1, 262: 1, 273: 8, 277: 1, 278: height}
    tags |= {279: image.size, 51000: 5}
    entries = b''.join(struct.pack('<HHII', tag, 4, 1, value) for tag, value in tags.items())
    start, count = struct.pack('<I', 8 + image.size), struct.pack('<H', len(tags))
    return b'II*\0' + start + image.tobytes() + count + entries + bytes(4)


def test_warnings_of_image_libraries_are_not_for_users(folder: Path, tmp_path: Path) -> None:
    image = read_image(folder / 'normal_0.3_4.png')
    (tmp_path / 'scan.tif').write_bytes(tiff_with_unknown_tag(image))
    done = ahf('identify', tmp_path / 'scan.tif', '--quiet', '--detector', 'traditional')
    assert (done.returncode, done.stdout, done.stderr) == (0, '', '')


def test_evaluation_of_results_in_a_file_and_in_a_pipe(
    folder: Path, results: str, tmp_path: Path
) -> None:
    (tmp_path / 'results.jsonl').write_text(results)
    table = ahf('evaluate', folder / 'truth.csv', tmp_path / 'results.jsonl')
    assert (table.returncode, table.stdout) == (0, '')
    assert 'wrong  false' in table.stderr
    told = ahf('evaluate', folder / 'truth.csv', '-', '--json', stdin=results)
    *_, together = map(json.loads, told.stdout.splitlines())
    assert (together['image'], together['expected'], together['wrong']) == (None, 12, 0)
    assert together['right'] >= 6
    assert together['rmse_xy'] < 0.1


def test_evaluation_names_images_without_truth(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = json.dumps({'image': 'other.png', 'targets': [{'id': 1, 'x': 5, 'y': 5}]})
    (tmp_path / 'results.jsonl').write_text(line)
    assert status('evaluate', folder / 'truth.csv', tmp_path / 'results.jsonl', '--json') == 0
    output, errors = capsys.readouterr()
    assert 'other.png is not in' in errors
    *_, other, together = map(json.loads, output.splitlines())
    assert (other['image'], other['false_positives'], other['recall']) == ('other.png', 1, None)
    assert (together['expected'], together['recall']) == (12, 0.0)


def test_edges_that_are_not_where_they_should_be_are_reported(
    identify: Callable[..., tuple[Any, str]], tmp_path: Path
) -> None:
    found = {'targets': [{'id': 7, 'x': 1, 'y': 2, 'edge_shift': -0.75}]}
    (tmp_path / 'program.py').write_text(f'print({json.dumps(found)!r})')
    program = f'{sys.executable} {tmp_path}/program.py'
    result, errors = identify('--detector', 'command', '--command', program)
    assert result['edge_shift'] == -0.75
    said = 'normal_0.3_4.png: edges are 0.8 px too bright: the photograph is over-exposed'
    assert said in errors


def test_an_image_that_is_white_is_named_where_nothing_is_identified(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    image = np.full((200, 300), 255, np.uint8)
    image[:, :30] = 90
    write_image(tmp_path / 'white.png', image)
    status('identify', tmp_path / 'white.png', '--family', 'metashape12')
    said = 'white.png: 90 % of the image is white: gaps or bands of targets may have vanished'
    assert said in capsys.readouterr().err


def test_overlays_are_written(folder: Path, tmp_path: Path) -> None:
    drawn = tmp_path / 'drawn'
    arguments = ('--overlay', drawn, '--detector', 'traditional')
    assert status('identify', folder / 'normal_0.3_4.png', *arguments) == 0
    assert [path.name for path in drawn.iterdir()] == ['normal_0.3_4_overlay.png']
    overlay = read_image(drawn / 'normal_0.3_4_overlay.png')
    assert (overlay != read_image(folder / 'normal_0.3_4.png')).mean() > 0.001


def test_overlays_of_one_name_are_refused(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / 'normal_0.3_4.png'
    other.write_bytes((folder / 'normal_0.3_4.png').read_bytes())
    arguments = ('--overlay', tmp_path, '--detector', 'traditional')
    assert status('identify', folder / other.name, other, *arguments) == 2
    assert 'overlay would hold several images of the same name' in capsys.readouterr().err


def test_stripes_need_the_filter_and_a_search_repeats_itself(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    size = ('--width', 960, '--height', 720, '--targets', 6)
    assert status('render', tmp_path, *size, '--light', 'stripe', '--seed', 2) == 0
    image = tmp_path / 'stripe_0.3_2.png'
    search = ('--seed', 3, '--population', 10)
    found = []
    command = ('identify', image, '--detector', 'traditional', '--expected-targets', 6, '--json')
    for more in (('--no-ahf',), search, (*search, '--threads', 1)):
        assert status(*command, *more) == 0
        found.append(json.loads(capsys.readouterr().out))
    plain, first, second = found
    assert len(plain['targets']) < 6
    assert plain['filter']['applied'] is False
    assert len(first['targets']) == 6
    assert first['filter']['applied'] is True
    assert first['filter']['evaluations'] > 1
    assert {**first, 'elapsed_s': 0} == {**second, 'elapsed_s': 0}


def test_a_search_that_ended_early_says_so(identify: Callable[..., tuple[Any, str]]) -> None:
    found, said = identify('--expected-targets', 7, '--max-radius', 40)
    assert found['filter']['evaluations'] == 3
    text = f'{found["image"]}: the search ended early, 2 filters in a row show no more targets'
    assert text in said


def test_files_that_cannot_be_read_do_not_stop_the_others(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'text.png').write_text('not an image')
    write_image(tmp_path / 'flat.png', np.full((50, 50), 9, np.uint8))
    empty = tmp_path / 'empty'
    empty.mkdir()
    images = (empty, 'missing.png', tmp_path / 'text.png', tmp_path / 'flat.png')
    good = folder / 'normal_0.3_4.png'
    command = ('identify', *images, good, '--detector', 'traditional', '--json', '--jobs', 1)
    assert status(*command) == 1
    output, errors = capsys.readouterr()
    assert len(output.splitlines()) == 1
    told = [line for line in errors.splitlines() if line.startswith('ahf identify: ')]
    for line, name in zip(told, (str(empty), 'missing.png', 'text.png', 'flat.png'), strict=True):
        assert name in line
    assert 'constant' in told[3]


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (
            '--expected-targets=-1',
            "expected_targets is '-1', accepted is an integer from 0 to 100000",
        ),
        ('--expected-targets 4 --expected-ids 1-3', 'expected_targets is 4 and expected_ids'),
        ('--family ring', "family is 'ring', accepted is one of metashape12, metashape14"),
        ('--min-radius nan', "min_radius is 'nan', accepted is a number from 0"),
        ('--magic', 'unrecognized arguments: --magic'),
    ],
)
def test_bad_options_are_named(
    capsys: pytest.CaptureFixture[str], arguments: str, message: str
) -> None:
    given = ('--detector', 'traditional', *arguments.split())
    assert status('identify', 'image.png', *given) == 2
    out, errors = capsys.readouterr()
    assert (out, message in errors) == ('', True), errors


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ('--light dark', "light is 'dark', accepted is one of normal, "),
        ('--count 0', "count is '0', accepted is an integer of at least 1"),
        ('--targets 100000', 'targets is 100000, accepted is an integer from 0 to'),
        ('--maker film', "maker is 'film', accepted is one of wall, bent"),
        ('--motion 2', "motion is 2.0 and maker is 'wall'; accepted with motion is the maker"),
        ('--maker bent --phases 4', "phases is 4 and maker is 'bent'; accepted with phases is"),
        ('--maker bent --bend-radius 10', 'bend_radius is 10.0, accepted is a number of at le'),
    ],
)
def test_bad_scenes_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: str, message: str
) -> None:
    assert status('render', tmp_path / 'new', *arguments.split()) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / 'new').exists()


@pytest.mark.parametrize('missing', ['truth.csv', 'results.jsonl'])
def test_files_that_cannot_be_compared_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], missing: str
) -> None:
    (tmp_path / 'truth.csv').write_text('image,id,x,y\n')
    (tmp_path / 'results.jsonl').touch()
    (tmp_path / missing).unlink()
    assert status('evaluate', tmp_path / 'truth.csv', tmp_path / 'results.jsonl') == 1
    assert f'{missing} cannot be read: No such file' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('command', 'settings'),
    [
        ('identify', IdentificationSettings),
        ('bag', IdentificationSettings),
        ('render', SceneSettings),
        ('render', BentSettings),
    ],
)
def test_help_describes_every_setting(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    command: str,
    settings: Any,
) -> None:
    monkeypatch.setenv('COLUMNS', '1000')
    assert status(command, '--help') == 0
    words = capsys.readouterr().out
    for item in flat_parameters(settings):
        assert f'--{item.name.replace("_", "-")}' in words
        default = 'auto' if item.name == 'family' and command != 'render' else item.default
        assert f'{item.description} Default: {default}; accepted: {item.accepted}.' in words


def test_no_command_and_the_version() -> None:
    assert status() == 2
    assert ahf('--version').returncode == 0
