"""Whether a measurement is good, in words and numbers."""

from dataclasses import replace

import numpy as np
import pytest

from ahf_ros.network.network import Rejection
from ahf_ros.network.solution import Solution, Suspect
from ahf_ros.network.verdict import relative_precision, verdict
from support.networks import SIZE, known, solution


def good() -> Solution:
    """Return a network in which nothing is weak: its image points fill the images."""
    whole = solution()
    whole = replace(whole, network=known(whole.network))
    seen = whole.network.observations
    middle = (np.array(SIZE) - 1) / 2
    filling = middle + (seen.xy - middle) * 3
    observations = replace(seen, xy=np.clip(filling, 0, np.array(SIZE) - 1))
    return replace(whole, network=replace(whole.network, observations=observations))


def suspect(name: str, verdict: str, *rivals: str) -> Suspect:
    return Suspect(name, 0.5, 0.1, 1e-7, verdict, rivals)  # type: ignore[arg-type]


def rejected(number: int, photograph: str) -> tuple[Rejection, ...]:
    return tuple(
        Rejection(photograph, str(index), (1.0, 2.0), 'too far', 9.0) for index in range(number)
    )


def test_a_good_measurement_is_good() -> None:
    whole = good()
    found = verdict(whole)
    extent = max(
        float(np.linalg.norm(a - b)) for a in whole.state.points for b in whole.state.points
    )
    sigma = np.sqrt(np.diag(whole.covariance_of_points).mean())
    assert relative_precision(whole) == pytest.approx(extent / sigma)
    assert found.grade == 'good' and found.to_do == ()
    said = int(found.line.split('1 : ')[1].split(';')[0].replace(',', ''))
    assert said == pytest.approx(extent / sigma, rel=0.05)
    assert found.line == (
        f'Good: relative precision 1 : {said:,}; 2 of 2 checks passed; sigma0 0.98, as expected; '
        'nothing is weak.'
    )


@pytest.mark.parametrize(
    ('change', 'grade', 'words', 'to_do'),
    [
        ({'sigma0': 4.2, 'scaled': True}, 'bad', 'sigma0 4.20, image points do not fit', 'IDs'),
        ({'sigma0': 0.5, 'scaled': True}, 'good', '2.0 times more precise than they say', ''),
        ({'sigma0': 1.5, 'scaled': True}, 'good', '1.5 times less precise than they say', ''),
        ({'redundancy': 0}, 'bad', 'without redundancy', 'Take more photographs'),
        ({'converged': False}, 'bad', 'did not converge', 'Give a focal length'),
        (
            {'suspects': (suspect('scale bar 3-4', 'failed'),)},
            'bad',
            '1 of 2 checks failed',
            'Measure scale bar 3-4 again',
        ),
        (
            {'suspects': (suspect('scale bar 3-4', 'left out'),)},
            'weak',
            '1 of 1 check passed; sigma0 0.98, as expected; weak: scale bar 3-4 is wrong and left',
            'Measure scale bar 3-4 again',
        ),
        (
            {'suspects': (suspect('scale bar 1-2', 'unclear', 'control point 5'),)},
            'bad',
            'weak: scale bar 1-2, control point 5 contradict each other',
            'Measure scale bar 1-2, control point 5 again',
        ),
        ({'rejected': rejected(2, 'view_1.jpg')}, 'weak', 'weak: 2 image points left out', ''),
        (
            {'rejected': rejected(4, 'view_1.jpg'), 'expected_rejections': 2.8},
            'good',
            'nothing is weak',
            'most of photograph view_1.jpg (4)',
        ),
    ],
)
def test_what_a_measurement_is_judged_by(change: dict, grade: str, words: str, to_do: str) -> None:
    found = verdict(replace(good(), **change))
    assert (found.grade, words in found.line) == (grade, True), found.line
    assert to_do in ' '.join(found.to_do) if to_do else found.to_do == ()


def test_no_scale_and_no_check_are_weaknesses() -> None:
    bare = replace(good(), network=replace(good().network, bars=(), control=()))
    found = verdict(bare)
    assert found.line.endswith('; no checks; sigma0 0.98, as expected.')
    assert found.grade == 'weak' and 'role check' in found.to_do[0]
    without = verdict(replace(bare, network=replace(bare.network, unit='')))
    assert 'weak: no scale' in without.line


def test_parameters_that_are_not_determined_are_named() -> None:
    whole = good()
    covariance = whole.camera_covariances[0].copy()
    covariance[5, 5] = 0.19**2  # k3, which lenses have to 0.2
    found = verdict(replace(whole, camera_covariances=(covariance,)))
    assert found.grade == 'good'
    assert 'do not determine k3' in ' '.join(it.text for it in found.findings)


def test_a_board_of_exact_points_needs_no_rays_and_no_checks() -> None:
    whole = good()
    used = np.isin(whole.network.observations.photograph, [0, 1])
    exact = replace(
        whole,
        network=replace(whole.network, bars=(), control=()),
        state=replace(whole.state, used=used),
        covariance_of_points=np.zeros_like(whole.covariance_of_points),
    )
    found = verdict(exact)
    assert 'exact coordinates; no checks' in found.line and found.grade != 'bad'
    assert not any('rays' in it or 'role check' in it for it in found.to_do)
