"""`ahf targets`: printed PDF files, rendered and identified, and what happens where they fail."""

import json
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from ahf_ros.prints import SQUARE_NAMES, VENDOR_NAMES
from support.command_line import ahf, status
from support.disk import room_for
from support.printed import identified, largest_error, sample, settings_of

pytest.importorskip('reportlab', reason='PDF files are written by reportlab')
pypdfium2 = pytest.importorskip('pypdfium2', reason='PDF files are rendered by pypdfium2')

ROUND = (*VENDOR_NAMES, 'cct12', 'gsi', 'dots', 'cctag3', 'cctag4')
SQUARE = [name for name in SQUARE_NAMES if not name.endswith(('_100', '_250', '_1000'))]
"""Larger dictionaries begin with the same markers."""
PER_FAMILY = 12


targets = partial(status, 'targets')


def rendered(file: Path, scale: float) -> list[np.ndarray]:
    """Return the pages of a PDF, `scale` px in a mm."""
    with pypdfium2.PdfDocument(file) as document:
        zoom = scale * 25.4 / 72
        return [page.render(scale=zoom, grayscale=True).to_numpy().squeeze() for page in document]


@pytest.mark.parametrize(
    ('name', 'polarity'),
    [*((name, 'dark') for name in (*ROUND, *SQUARE)), *((name, 'bright') for name in ROUND)],
)
def test_what_is_printed_is_identified_where_it_is(name: str, polarity: str) -> None:
    figures = identified(settings_of(name, polarity, sample(name, PER_FAMILY), page='A6'))
    assert (figures.expected, figures.right) == (PER_FAMILY, PER_FAMILY)
    assert (figures.wrong, figures.false_positives) == (0, 0)
    assert largest_error(figures) < 0.02


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a sheet and its geometry, which a process has written."""
    folder = tmp_path_factory.mktemp('targets')
    options = ['--family', 'metashape12', '--ids', '1-54', '--dot-radius', '4mm', '--page', 'A4']
    output = '-o', folder / 'sheet.pdf', '--geometry', folder / 'sheet.json'
    done = ahf('targets', *options, *output)
    message = 'sheet.pdf: metashape12, 54 targets, r 4 mm, on 2 pages A4\n'
    assert (done.returncode, done.stdout, done.stderr) == (0, '', f'{folder}/{message}')
    return folder


def test_a_pdf_is_printed_true_to_scale(folder: Path) -> None:
    content = (folder / 'sheet.pdf').read_bytes()
    assert content.startswith(b'%PDF-1.6')
    assert b'/PrintScaling /None' in content
    with pypdfium2.PdfDocument(content) as document:
        size = 210 / 25.4 * 72, 297 / 25.4 * 72
        assert [page.get_size() for page in document] == [pytest.approx(size, abs=1e-3)] * 2
        kinds = {item.type for page in document for item in page.get_objects()}
        images = pypdfium2.raw.FPDF_PAGEOBJ_IMAGE
        assert len(document) == 2 and kinds and images not in kinds
        assert document.get_metadata_value('Title') == 'metashape12, 54 targets, r 4 mm'
        words = document[0].get_textpage().get_text_range()
    assert '17 metashape12 r 4 mm' in ' '.join(words.split())


def test_the_bars_are_100_mm_long(folder: Path) -> None:
    page = rendered(folder / 'sheet.pdf', 20.0)[0]
    (height, width), scale = page.shape, (page.shape[0] / 297, page.shape[1] / 210)
    row, column = round(height - 7.5 * scale[0]), round(7.5 * scale[1])
    across = np.flatnonzero(page[row, : round(113 * scale[1])] < 128) / scale[1]
    upwards = np.flatnonzero(page[round(height - 113 * scale[0]) :, column] < 128) / scale[0]
    for ends in (across, upwards):
        assert ends.max() - ends.min() == pytest.approx(100 + 0.15, abs=0.1)
    assert width > 4000


def test_the_geometry_has_every_target_and_sheets_repeat_themselves(
    folder: Path, tmp_path: Path
) -> None:
    geometry = json.loads((folder / 'sheet.json').read_text())
    assert (geometry['pages'], geometry['radii']['band_outer']) == (2, 14.0)
    assert [target['id'] for target in geometry['targets']] == list(range(1, 55))
    assert targets('--ids', '1-54', '-o', tmp_path / 'again.pdf') == 0
    assert (tmp_path / 'again.pdf').read_bytes() == (folder / 'sheet.pdf').read_bytes()


def test_the_best_ids_are_printed_and_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / 'best.json'
    assert targets('--best', 20, '-o', tmp_path / 'best.svg', '--geometry', file) == 0
    ids = [target['id'] for target in json.loads(file.read_text())['targets']]
    assert len(ids) == 20
    assert f'IDs: {", ".join(map(str, ids))}\n' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        (['--dot-radius', '60mm'], 'dot_radius is 60 mm, accepted is at most '),
        (['--ids', '999'], 'ids has 999, accepted are IDs of metashape12 from 1 to 161'),
        (['--geometry', 'sheet.pdf'], "geometry is 'sheet.pdf', accepted is a file other than"),
        (['--best', '150'], 'best is 150, accepted is an integer from 1 to '),
    ],
)
def test_what_is_not_accepted_leaves_the_old_file(
    options: list[str],
    message: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    file = Path('sheet.pdf')
    file.write_text('old')
    assert targets(*options, '-o', file) == 2
    assert f'ahf targets: error: {message}' in capsys.readouterr().err
    assert file.read_text() == 'old'


def test_a_full_disk_leaves_the_old_file_and_the_rest_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, geometry = tmp_path / 'sheet.pdf', tmp_path / 'sheet.json'
    file.write_text('old')
    with room_for(5000):
        assert targets('--ids', '1-54', '-o', file, '--geometry', geometry) == 1
    assert f'ahf targets: {file} cannot be written: File too large' in capsys.readouterr().err
    assert file.read_text() == 'old'
    assert len(json.loads(geometry.read_text())['targets']) == 54
    assert {it.name for it in tmp_path.iterdir()} == {'sheet.pdf', 'sheet.json'}


def test_without_its_library_a_pdf_is_refused_and_svg_is_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, 'reportlab', None)
    assert targets('--ids', '1', '-o', tmp_path / 'sheet.pdf') == 2
    assert "pip install 'ahf_ros[print]'" in capsys.readouterr().err
    assert targets('--ids', '1', '-o', tmp_path / 'sheet.svg') == 0
    assert [it.name for it in tmp_path.iterdir()] == ['sheet.svg']
    assert targets('--ids', '1', '-o', tmp_path / 'sheet.png') == 2
    assert 'sheet.png has an unknown format, accepted is one of .pdf' in capsys.readouterr().err
