"""The experiment of the paper as one command, on images that are small and few."""

import io
import json
from contextlib import redirect_stdout
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks import paper
from support.preprocessors import PREPROCESSORS

SMALL = (
    '--quick --images 1 --seed 1 --jobs 1 --ambients 0.3 --evaluations 5 --lights normal stripe'
)


def printed(*arguments: object) -> str:
    with redirect_stdout(io.StringIO()) as told:
        assert paper.main([*map(str, arguments)]) == 0
    return told.getvalue()


@pytest.fixture(scope='module')
def measured(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    path = tmp_path_factory.mktemp('paper') / 'paper.json'
    return printed(*SMALL.split(), '--json', path), path


def row(text: str, name: str) -> list[str]:
    """Return the cells of the first row of a method."""
    line = next(line for line in text.splitlines() if line.startswith(f'| {name} |'))
    return [cell.strip() for cell in line.split('|')[2:-1]]


def test_the_figures_of_the_paper_stand_beside_ours(measured: tuple[str, Path]) -> None:
    text, _ = measured
    assert row(text, 'AHF-TI in the paper') == ['63 / 68 / 68 (0.263)', '80 / 83 / 83 (0.247)']
    for name in ('traditional', 'ring', 'AHF-ring', 'aruco'):
        assert row(text, name)[0].startswith('100 / 100 / 100 (0.0'), name
    plain, driven = (row(text, name)[1] for name in ('traditional', 'AHF-traditional'))
    assert float(plain.split('/')[1]) < 50 < float(driven.split('/')[1].split()[0])


def test_every_method_is_in_the_json(measured: tuple[str, Path]) -> None:
    text, path = measured
    records = json.loads(path.read_text())['records']
    names = {record['method'] for record in records}
    assert {'CLAHE + traditional', 'retinex + traditional', 'AHF-ring', 'AHF-aruco'} <= names
    assert len(records) == 2 * len(names)
    (striped,) = (
        it for it in records if (it['method'], it['light']) == ('AHF-traditional', 'stripe')
    )
    assert striped['filter']
    assert striped['evaluations'] > 1
    assert f'{striped["seconds"]:.2f}' in text


def test_plots_come_from_an_earlier_run(measured: tuple[str, Path], tmp_path: Path) -> None:
    pytest.importorskip('matplotlib')
    text, path = measured
    assert printed('--read', path, '--plots', tmp_path / 'plots') == text
    picture = cv2.imread(str(tmp_path / 'plots' / 'recall.png'))
    assert picture.shape[1] > 300
    assert picture.std() > 10


def test_rival_preprocessors_even_out_the_light() -> None:
    rows, columns = np.mgrid[:240, :320]
    checks = np.where((rows // 20 + columns // 20) % 2, 1.0, 0.4)
    image = np.rint(checks * (40 + 0.6 * columns)).astype(np.uint8)

    def unevenness(shown: np.ndarray) -> float:
        left, right = shown[:, 40:100].mean(), shown[:, 220:280].mean()
        return abs(right - left) / shown.std()

    for name, preprocess in PREPROCESSORS.items():
        shown = preprocess(image)
        assert shown.dtype == np.uint8 and shown.shape == image.shape
        assert shown.std() > 20, name
    for name in ('CLAHE', 'retinex', 'local normalisation'):
        assert unevenness(PREPROCESSORS[name](image)) < 0.8 * unevenness(image), name
