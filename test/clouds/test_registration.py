from dataclasses import replace

import numpy as np
import pytest

from ahf_ros.clouds.registration.field import added, known_field
from ahf_ros.clouds.registration.rigid import chi_square_limit
from ahf_ros.clouds.registration.scan import Scan
from ahf_ros.clouds.registration.session import Registration
from ahf_ros.network.network import FloatArray
from ahf_ros.network.points import MeasuredPoints
from support.scans import measured, ring, squared_error, station

SIGMA = 20e-6  # m
COUNT, COMMON = 8, 6  # scans around the object, and targets that neighbours share


def names(*groups: int) -> list[str]:
    return [f'{100 * group + number}' for group in groups for number in range(COMMON)]


def scans(seed: int) -> list[Scan]:
    """Return scans around an object."""
    random = np.random.default_rng(seed)
    groups = ring(COUNT, COMMON, random)
    return [
        measured(
            names((number - 1) % COUNT, number),
            np.concatenate((groups[number - 1], groups[number])),
            station(number, COUNT),
            SIGMA,
            random,
        )
        for number in range(COUNT)
    ]


def true_points(seed: int, count: int = COUNT) -> FloatArray:
    return ring(count, COMMON, np.random.default_rng(seed)).reshape(-1, 3)


def registered(given: list[Scan]) -> Registration:
    registration = Registration()
    for scan in given:
        registration.add(scan)
    return registration


TRUE = [station(0, COUNT).inverse @ station(number, COUNT) for number in range(COUNT)]


@pytest.fixture(scope='module')
def two() -> list[Scan]:
    """Two neighbouring scans, whose common targets are 0 to 5."""
    return scans(1)[:2]


@pytest.mark.parametrize('adjust', [False, True])
def test_covariances_of_a_chain_agree_with_its_errors(adjust: bool) -> None:
    """Squared errors over covariances have the mean 6; scans of one chain depend on each other."""
    squares = []
    for seed in range(40):
        registration = registered(scans(seed))
        if adjust:
            registration.adjust()
        found = registration.field.scans[1:]
        squares.append(
            [squared_error(it.transform, true) for it, true in zip(found, TRUE[1:], strict=True)]
        )
    assert np.mean(squares) == pytest.approx(6, abs=4 * np.sqrt(12 / 40))


@pytest.mark.lasting
@pytest.mark.parametrize('adjust', [False, True])
def test_covariances_of_targets_agree_with_their_errors(adjust: bool) -> None:
    squares = []
    for seed in range(20):
        registration = registered(scans(seed))
        if adjust:
            registration.adjust()
        field = registration.field
        places = [int(it) // 100 * COMMON + int(it) % 100 for it in field.names]
        error = (field.points - station(0, COUNT).inverse.moved(true_points(seed)[places])).ravel()
        squares.append(error @ np.linalg.solve(field.covariance, error))
    size = len(error)
    assert np.mean(squares) == pytest.approx(size, abs=4 * np.sqrt(2 * size / 20))


def test_an_adjustment_closes_the_chain() -> None:
    registration = registered(scans(3))
    before = registration.field
    result = registration.adjust()
    assert result.cost <= chi_square_limit(result.redundancy)
    assert result.words().startswith('8 scans and 48 targets adjusted, sigma0 ')
    last = registration.field.scans[-1]
    assert last.rms < 3 * SIGMA
    assert last.rms < before.scans[-1].rms
    assert np.trace(registration.field.covariance) < np.trace(before.covariance)
    assert (registration.field.scans[0].transform.covariance == 0).all()  # it holds the frame
    again = registration.adjust().field
    assert again.points == pytest.approx(registration.field.points, abs=1e-9)


def test_known_coordinates_give_the_frame() -> None:
    points = true_points(5)
    sigma = 1e-5
    squares = []
    for seed in range(60):
        random = np.random.default_rng(seed)
        near = points[:COMMON] + sigma * random.standard_normal((COMMON, 3))
        covariance = sigma**2 * np.eye(3 * COMMON)
        registration = Registration(MeasuredPoints(tuple(names(0)), near, covariance, unit='m'))
        for number in (0, 1):
            groups = [(number - 1) % COUNT, number]
            seen = points.reshape(COUNT, COMMON, 3)[groups].reshape(-1, 3)
            registration.add(measured(names(*groups), seen, station(number, COUNT), SIGMA, random))
        registration.adjust()
        for number, it in enumerate(registration.field.scans):
            squares.append(squared_error(it.transform, station(number, COUNT)))
    assert np.mean(squares) == pytest.approx(6, abs=4 * np.sqrt(12 / 60))


def test_exact_coordinates_are_accepted() -> None:
    points = true_points(5)[: 2 * COMMON]
    exact = MeasuredPoints(tuple(names(0, 1)), points, np.zeros((points.size, points.size)))
    field = known_field(exact)
    scan = measured(names(0, 1), points, station(1, COUNT), SIGMA, np.random.default_rng(0))
    found = added(field, scan).scans[0]
    assert squared_error(found.transform, station(1, COUNT)) < chi_square_limit(6)
    assert np.linalg.eigvalsh(found.transform.covariance)[0] > 0


def test_undo_and_reset() -> None:
    registration = registered(scans(2)[:3])
    three = registration.field
    registration.adjust()
    assert registration.undo() is False  # the adjustment
    assert registration.field is three
    assert registration.undo() is True
    assert len(registration.field.scans) == 2
    registration.reset()
    assert registration.field.names == ()
    with pytest.raises(ValueError, match='nothing to undo'):
        registration.undo()
    with pytest.raises(ValueError, match='0 scans registered, accepted are two or more'):
        registration.adjust()


def refusal(first: Scan, second: Scan) -> str:
    """Return why a second scan is refused, which changes nothing."""
    registration = registered([first])
    before = registration.field
    with pytest.raises(ValueError) as caught:
        registration.add(second)
    assert registration.field is before
    return str(caught.value)


def test_few_common_targets_are_refused(two: list[Scan]) -> None:
    first, second = two
    assert refusal(first, second.without(names(0)[2:])) == (
        '2 of the targets of the scan, 0, 1, 100, 101, 102, 103, 104, 105, are in the field, '
        'accepted are three or more'
    )
    empty = second.without(second.names)
    assert refusal(first, empty).startswith('0 of the targets of the scan, none,')
    with pytest.raises(ValueError, match='the scan has 2 targets, accepted are three or more'):
        registered([first.without(first.names[2:])])


def test_targets_on_a_line_are_refused(two: list[Scan]) -> None:
    first, second = two
    line = np.linspace((0, 0, 1), (0.5, 0, 1), len(first.names))
    straight = replace(first, points=line)
    with pytest.raises(ValueError, match=r'are nearly on a line: 0\.5 m long and 0 m wide'):
        registered([straight])
    chosen = second.without(names(0)[3:])
    points = chosen.points.copy()
    points[2] = 0.5 * (points[0] + points[1]) + 1e-3
    assert 'targets 0, 1, 2 are nearly on a line' in refusal(first, replace(chosen, points=points))


@pytest.mark.parametrize('factor', [1000.0, 0.001])
def test_other_units_are_told(two: list[Scan], factor: float) -> None:
    first, second = two
    text = refusal(
        first, Scan(second.names, factor * second.points, factor**2 * second.covariances)
    )
    scan, field = ('millimetres', 'metres')[:: 1 if factor > 1 else -1]
    assert f'the scan is in {scan}, the field in {field}; accepted are metres' in text


def test_another_scale_is_told(two: list[Scan]) -> None:
    first, second = two
    text = refusal(first, replace(second, points=1.02 * second.points))
    assert text.startswith('targets are 1.02')
    assert text.endswith(
        'times as far apart in the scan as in the field, accepted is the same scale'
    )


def test_a_mirrored_frame_is_told(two: list[Scan]) -> None:
    first, second = two
    assert 'mirror image' in refusal(first, replace(second, points=second.points * (1, -1, 1)))


@pytest.mark.parametrize('moved', [1, 2])
def test_targets_that_moved_are_named(two: list[Scan], moved: int) -> None:
    first, second = two
    points = second.points.copy()
    points[1 : 1 + moved] += (0, 0.002, 0)
    text = refusal(first, replace(second, points=points))
    for number in range(COMMON):
        told = f'target {number} moved by 0.00' in text
        assert told == (1 <= number <= moved)


def test_a_wrong_id_is_named_with_the_place_it_has(two: list[Scan]) -> None:
    first, second = two
    # 3 is read as 505, which the field has elsewhere.
    other = names(COUNT - 1)[2]
    wrong = tuple(other if name == '3' else name for name in second.names)
    text = refusal(first, replace(second, names=wrong))
    assert text == f'target {other} is where 3 was: a wrong ID; 0, 1, 2, 4, 5 fit to each other'


def test_four_targets_that_disagree_are_named_together(two: list[Scan]) -> None:
    first, second = two
    three = second.without(names(0)[3:])
    points = three.points.copy()
    points[0] += 0.003
    assert 'which of them moved or have a wrong ID cannot be told' in refusal(
        first, replace(three, points=points)
    )


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        ({'names': ('7', '7')}, "target '7' is there twice"),
        ({'points': np.full((2, 3), np.nan)}, "point of target '1' is"),
        ({'points': np.zeros((2, 2))}, r'points have the shape \(2, 2\), accepted is \(2, 3\)'),
        ({'covariances': np.zeros((2, 3, 3))}, 'positive definite'),
    ],
)
def test_bad_scans_are_refused(change: dict, words: str) -> None:
    good = {
        'names': ('1', '2'),
        'points': np.zeros((2, 3)),
        'covariances': np.tile(np.eye(3), (2, 1, 1)),
    }
    with pytest.raises(ValueError, match=words):
        Scan(**(good | change))
