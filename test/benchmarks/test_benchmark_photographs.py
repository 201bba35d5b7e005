"""The benchmark of photographs: its truth is complete, and pictures come from clones."""

import subprocess
from pathlib import Path
from typing import Any

import cv2
import pytest

from ahf_ros import FAMILY_NAMES, SceneSettings, render
from ahf_ros.prints.families import print_in
from benchmarks import photographs
from support import strangers
from support.pictures.projected import lit


def test_the_truth_names_pictures_and_families_that_can_be_read() -> None:
    every = strangers.photographs()
    assert len({shown['blob'] for shown in every}) == len(every) > 40
    for shown in every:
        new = shown['family'] not in FAMILY_NAMES
        file = str(strangers.TRUTH / f'{shown["family"]}.json') if new else ''
        ids = {target[0] for target in shown['targets']}
        assert ids <= set(print_in(shown['family'], file).design.all_ids)


@pytest.fixture
def clone(tmp_path: Path) -> tuple[Path, dict[str, Any]]:
    """A folder with a repository of one picture, and what it shows."""
    scene = render(SceneSettings(width=480, height=360, targets=3, dot_radius=9))
    repository = tmp_path / 'somebody' / 'pictures'
    repository.mkdir(parents=True)
    cv2.imwrite(str(repository / 'one.png'), scene.image)
    git = ['git', '-C', str(repository)]
    subprocess.run([*git, 'init', '-q'], check=True)
    stored = subprocess.run(
        [*git, 'hash-object', '-w', 'one.png'], check=True, capture_output=True, text=True
    )
    targets = [[it.id, it.x, it.y] for it in scene.targets]
    return tmp_path, {
        'repository': 'somebody/pictures',
        'path': 'one.png',
        'blob': stored.stdout.strip(),
        'family': 'metashape12',
        'targets': targets[:2],
        'uncounted': targets[2:],
    }


def test_a_picture_is_read_from_its_clone_and_scored(clone: tuple[Path, dict[str, Any]]) -> None:
    folder, shown = clone
    image = strangers.picture(folder, shown)
    record = photographs.record(image, shown, photographs.WAYS)
    of = {'right': 2, 'wrong': 0, 'false': 0, 'missed': []}
    assert record['by'] == {'named': of, 'auto': of}
    moved = {**shown, 'targets': [[shown['targets'][0][0], 5, 5]], 'uncounted': []}
    by = photographs.record(image, moved, ['named'])['by']['named']
    assert (by['right'], by['false'], by['missed']) == (0, 3, [moved['targets'][0][0]])


def test_a_picture_is_lit_by_a_pattern(
    clone: tuple[Path, dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, shown = clone
    monkeypatch.setattr(photographs, 'photographs', lambda: [shown])
    given = [str(folder), '--lights', 'lattice', '--ambient', '0.3', '0.1', '--families', 'named']
    figures = photographs.measure(photographs.parser().parse_args(given))
    assert [of['light'] for of in figures['rows']] == ['lattice 0.3', 'lattice 0.1']
    assert [of['by']['named']['right'] for of in figures['rows']] == [2, 2]
    image = strangers.picture(folder, shown)
    dim, dimmer = (lit(image, 'lattice', of, 9.0, 101) for of in (0.3, 0.1))
    assert image.mean() > dim.mean() > dimmer.mean() > 0
    assert (dim == lit(image, 'lattice', 0.3, 9.0, 101)).all()


def test_a_picture_that_is_not_there_says_what_to_clone(
    clone: tuple[Path, dict[str, Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    folder, shown = clone
    with pytest.raises(ValueError, match=r'no other\.png.*github\.com/somebody/pictures'):
        strangers.picture(folder, {**shown, 'path': 'other.png', 'blob': '0' * 40})
    with pytest.raises(SystemExit):
        photographs.main([str(folder), '--repositories', 'elenasmar99/Coded_targets_recognition'])
    assert 'clone of https://github.com/elenasmar99' in capsys.readouterr().err
