"""The experiment of the paper as one command, on images that are small and few."""

from __future__ import annotations

import json
import os
import runpy
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

FOLDER = Path(__file__).parents[2] / 'benchmarks'
SMALL = ('--quick', '--images', 1, '--seed', 1, '--ambients', 0.3, '--evaluations', 5)


def paper(*arguments: object) -> str:
    done = subprocess.run(
        [sys.executable, str(FOLDER / 'paper.py'), *map(str, arguments)],
        capture_output=True,
        text=True,
        env={**os.environ, 'PYTHONPATH': str(FOLDER.parent)},
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope='module')
def measured(tmp_path_factory) -> tuple[str, Path]:
    path = tmp_path_factory.mktemp('paper') / 'paper.json'
    return paper(*SMALL, '--lights', 'normal', 'stripe', '--json', path), path


def row(text: str, name: str) -> list[str]:
    """Return the cells of the first row of a method."""
    line = next(line for line in text.splitlines() if line.startswith(f'| {name} |'))
    return [cell.strip() for cell in line.split('|')[2:-1]]


def test_the_figures_of_the_paper_stand_beside_ours(measured):
    text, _ = measured
    assert row(text, 'AHF-TI in the paper') == [
        '63 / 68 / 68 (0.263)',
        '80 / 83 / 83 (0.247)',
    ]
    for name in ('traditional', 'ring', 'AHF-ring', 'aruco'):
        assert row(text, name)[0].startswith('100 / 100 / 100 (0.0'), name
    plain, driven = (row(text, name)[1] for name in ('traditional', 'AHF-traditional'))
    assert float(plain.split('/')[1]) < 50 < float(driven.split('/')[1].split()[0])


def test_every_method_is_in_the_json(measured):
    text, path = measured
    records = json.loads(path.read_text())['records']
    names = {record['method'] for record in records}
    assert {'CLAHE + traditional', 'retinex + traditional', 'AHF-ring', 'AHF-aruco'} <= names
    assert len(records) == 2 * len(names)
    striped = next(
        it for it in records if (it['method'], it['light']) == ('AHF-traditional', 'stripe')
    )
    assert striped['filter']
    assert len(striped['tried']) == striped['evaluations'] > 1
    assert len(striped['vectors']) == striped['score']['right']
    assert f'{striped["seconds"]:.2f}' in text


def test_plots_come_from_an_earlier_run(measured, tmp_path):
    pytest.importorskip('matplotlib')
    text, path = measured
    assert paper('--read', path, '--plots', tmp_path / 'plots') == text
    for name in ('recall', 'fitness', 'errors'):
        picture = cv2.imread(str(tmp_path / 'plots' / f'{name}.png'))
        assert picture.shape[1] > 300
        assert picture.std() > 10


@pytest.mark.parametrize('count', [1, 2, 4, 5])
def test_every_method_has_a_panel(measured, count):
    pytest.importorskip('matplotlib')
    report = json.loads(measured[1].read_text())
    driven = [record for record in report['records'] if record['method'] == 'AHF-traditional']
    names = [f'method {number}' for number in range(count)]
    report['records'] = [{**record, 'method': name} for name in names for record in driven]
    plots = runpy.run_path(str(FOLDER / 'paper_plots.py'))
    for draw in ('fitness', 'errors'):
        shown = [panel for panel in plots[draw](report).axes if panel.get_visible()]
        assert [panel.get_title().split('\n')[0] for panel in shown] == names


def test_rival_preprocessors_even_out_the_light():
    preprocessors = runpy.run_path(str(FOLDER / 'preprocessors.py'))['PREPROCESSORS']
    rows, columns = np.mgrid[:240, :320]
    checks = np.where((rows // 20 + columns // 20) % 2, 1.0, 0.4)
    image = np.rint(checks * (40 + 0.6 * columns)).astype(np.uint8)

    def unevenness(shown: np.ndarray) -> float:
        left, right = shown[:, 40:100].mean(), shown[:, 220:280].mean()
        return abs(right - left) / shown.std()

    for name, preprocess in preprocessors.items():
        shown = preprocess(image)
        assert shown.dtype == np.uint8 and shown.shape == image.shape
        assert shown.std() > 20, name
    for name in ('CLAHE', 'retinex', 'local normalisation'):
        assert unevenness(preprocessors[name](image)) < 0.8 * unevenness(image), name
