"""A family learnt from measured coordinates."""

from pathlib import Path

import numpy as np
import pytest

from ahf_ros.cli import main
from ahf_ros.families.learning.points import learn_family
from ahf_ros.files.tables import read_points
from ahf_ros.prints.gsi import point_family, positions_of
from support import ROOT
from support.photographs import IN_CI

GSI = point_family()
SURVEY = ROOT.parent / 'shared' / 'gsi' / 'vstars_export.csv'


def rotation(generator: np.random.Generator) -> np.ndarray:
    matrix = np.linalg.qr(generator.normal(size=(3, 3)))[0]
    return matrix * np.sign(np.linalg.det(matrix))


def survey(numbers: list[int], scale: float, noise: float, seed: int = 1) -> dict[str, np.ndarray]:
    """Return a point list of targets anywhere in space, and of points that are none."""
    generator = np.random.default_rng(seed)
    points = {'TARGET1': generator.normal(size=3), 'CODE999': generator.normal(size=3)}
    for number in numbers:
        turn, place = rotation(generator), generator.uniform(-5000, 5000, 3)

        def measured(
            point: np.ndarray, turn: np.ndarray = turn, place: np.ndarray = place
        ) -> np.ndarray:
            there = turn @ (scale * np.append(point, 0.0)) + place
            return there + generator.normal(0, noise, 3)

        for name, point in zip(GSI.template_names, GSI.template, strict=True):
            points[f'CODE{number}' if name == 'E' else f'NUGGET{number}_{name}'] = measured(point)
        word = GSI.word(number)
        for position, point in zip(
            positions_of(word), GSI.positions[GSI.decoding_dots(word)], strict=True
        ):
            points[f'NUGGET{number}_{position}'] = measured(point)
    return points


def test_the_design_comes_out_of_a_survey() -> None:
    numbers = [1, 2, 18, 133, 505, 10001, 10700, 11000]
    learnt = learn_family(survey(numbers, 1.35, 0.02), GSI, 'mine')
    assert learnt.codes == {number: GSI.word(number) for number in numbers}
    assert not learnt.left_out
    family = learnt.family
    assert family.dot_radius == pytest.approx(2.025, abs=0.005)
    assert np.abs(family.template / 1.35 - GSI.template).max() < 0.05
    assert np.abs(family.positions / 1.35 - GSI.positions).max() < 0.1


def test_front_and_back_are_told_apart() -> None:
    points = survey([18], 1.0, 0.0)
    mirrored = {label: point * [1, 1, -1] for label, point in points.items()}
    for list_of in (points, mirrored):
        learnt = learn_family(list_of, GSI, 'mine')
        assert np.abs(learnt.family.template - GSI.template).max() < 1e-3


def test_incomplete_and_strange_targets_are_left_out_with_a_reason() -> None:
    points = survey([1, 2, 18, 133], 1.0, 0.01)
    del points['NUGGET2_B']
    del points['NUGGET18_6']
    points['NUGGET133_A'] = points['NUGGET133_A'] + 9.0
    learnt = learn_family(points, GSI, 'mine')
    assert [target.number for target in learnt.targets] == [1]
    assert learnt.left_out[2] == 'has no template dot B'
    assert learnt.left_out[18].startswith('has the decoding dots 14, 4, accepted are 3')
    assert learnt.left_out[133].startswith('differs from the template by up to')


def test_positions_that_are_new_are_learnt() -> None:
    points = survey([18], 1.0, 0.0)
    renamed = {label.replace('NUGGET18_14', 'NUGGET18_29'): at for label, at in points.items()}
    family = learn_family(renamed, GSI, 'mine').family
    there = family.positions[family.position_numbers.tolist().index(29)]
    assert there == pytest.approx([23, 15], abs=1e-3)


def test_lists_without_targets_or_with_one_code_twice_are_refused() -> None:
    with pytest.raises(ValueError, match='no rows of coded targets, accepted are rows CODEn and'):
        learn_family({'TARGET1': np.zeros(3), 'CODE7': np.zeros(3)}, GSI, 'mine')
    points = survey([18], 1.0, 0.0)
    del points['NUGGET18_C']
    with pytest.raises(ValueError, match='no complete target; target 18 has no template dot C'):
        learn_family(points, GSI, 'mine')
    twice = survey([18], 1.0, 0.0)
    twice |= {label.replace('18', '19'): point for label, point in twice.items()}
    with pytest.raises(ValueError, match='targets 18 and 19 have the same dots'):
        learn_family(twice, GSI, 'mine')


def test_the_command_writes_a_library(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    export, output = tmp_path / 'export.csv', tmp_path / 'mine.json'
    points = survey([18, 505, 10400], 1.35, 0.02)
    rows = [f'{name},{x:.3f},{y:.3f},{z:.3f},0.02,0.02,0.02' for name, (x, y, z) in points.items()]
    export.write_text('\n'.join(rows) + '\n')
    assert main(['learn-family', str(export), '-o', str(output), '--dot-radius', '2.2']) == 0
    assert '3 targets (18, 505, 10400), 1.3' in capsys.readouterr().err
    family = point_family(str(output))
    assert (family.name, family.dot_radius, family.unit) == ('mine', 2.2, 'mm')
    assert family.word(505) == GSI.word(505) and family.word(10001) == GSI.word(10001)
    assert family.number(GSI.word(10400)) == 10400


@pytest.mark.parametrize(
    ('text', 'told'),
    [
        ('A,1,2\n', r"has no column id, x, y, z, its columns are 'A, 1, 2'"),
        ('label,x,y,z\nA,1,2,3\nB,1,two,3\n', r"line 3: y is 'two', accepted is a finite number"),
        ('A,1,2,3\n\nA,1,2,3\n', r"line 3: id is 'A', which line 1 has already"),
        ('# nothing\n', 'is empty, accepted is a table with id'),
        ('A,1,2,3\n', 'no rows of coded targets'),
    ],
)
def test_bad_lists_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture, text: str, told: str
) -> None:
    export, output = tmp_path / 'export.csv', tmp_path / 'mine.json'
    export.write_text(text)
    assert main(['learn-family', str(export), '-o', str(output)]) == 1
    assert told.replace('\\', '') in capsys.readouterr().err
    assert not output.exists()


def test_a_bad_dot_radius_is_refused(capsys: pytest.CaptureFixture) -> None:
    arguments = ['learn-family', 'no.csv', '-o', 'x.json', '--dot-radius', '-1']
    assert main(arguments) == 2
    assert 'dot_radius is -1.0, accepted is a length above 0' in capsys.readouterr().err


@pytest.mark.skipif(not (IN_CI or SURVEY.exists()), reason=f'there is no {SURVEY}')
def test_the_survey_of_a_telescope_has_the_printed_design() -> None:
    learnt = learn_family(read_points(SURVEY), GSI, 'mine')
    scale = np.mean([target.scale for target in learnt.targets])
    assert 1 / scale == pytest.approx(1.358, abs=0.002)
    assert np.abs(learnt.family.template * scale - GSI.template).max() < 0.1
    assert np.abs(learnt.family.positions * scale - GSI.positions).max() < 0.1
    assert learnt.codes == {number: GSI.word(number) for number in range(133, 139)}
