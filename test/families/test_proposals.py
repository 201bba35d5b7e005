"""Which dots are worth reading."""

from dataclasses import replace

import numpy as np
import pytest

from ahf_ros.families import DetectorSettings
from ahf_ros.families.ring import detector, proposals
from ahf_ros.families.ring.detector import find_hypotheses, report
from ahf_ros.families.ring.families import read_families
from ahf_ros.families.ring.hypotheses import Hypotheses
from ahf_ros.families.ring.proposals import (
    HOPEFUL,
    hopes,
    measure_alike,
    most_hopeful,
    with_rims,
)
from ahf_ros.prints.ring import family
from ahf_ros.scenes.scene import SceneSettings, render
from ahf_ros.vision import frame
from ahf_ros.vision.circle_fit import Fit
from ahf_ros.vision.dots import Dots
from support.ring import lone_dot, made_up, measured

SMALL = SceneSettings(width=800, height=600, targets=4)
FAMILIES = [family(name) for name in ('aicon14', 'metashape12')]


@pytest.mark.parametrize('polarity', ['dark', 'bright'])
@pytest.mark.parametrize('light', ['normal', 'stripe', 'lattice'])
@pytest.mark.parametrize('edge_shift', [-1.0, 0.0, 1.0])
def test_middles_of_targets_are_worth_reading(
    light: str, polarity: str, edge_shift: float
) -> None:
    kind = {'polarity': polarity, 'edge_shift': edge_shift, 'light': light}
    scene = replace(SMALL, texture=0.0, seed=5, **kind)
    rendering = render(scene)
    gray = rendering.image.astype(np.float32)
    x, y = zip(*((it.x, it.y) for it in rendering.targets), strict=True)
    sign = 1 if polarity == 'dark' else -1
    middles = measured(gray, x, y, scene.dot_radius + sign * edge_shift, sign, rounds=1)
    assert (hopes(gray, middles, FAMILIES) > HOPEFUL).all()
    assert hopes(gray, middles.select(slice(0)), FAMILIES).shape == (0,)


@pytest.mark.parametrize(('ink', 'paper'), [(50, 200), (200, 50)])
@pytest.mark.parametrize('x', [150.0, 50.0])
def test_a_dot_without_a_band_is_not_worth_reading(ink: int, paper: int, x: float) -> None:
    gray = lone_dot(ink, paper, x)
    alone = measured(gray, [x], [100.0], 12.0, 1 if ink < paper else -1, rounds=1)
    assert not (hopes(gray, alone, FAMILIES) > HOPEFUL).any()


def test_dots_come_by_their_bands_and_by_how_clear_they_are() -> None:
    """Spots of light have higher bands than small targets, but broken and pale edges."""
    dots = replace(
        made_up([10, 30, 50, 70]),
        share=np.array([0.7, 0.95, 0.95, 0.6]),
        contrast=np.array([0.6, 0.2, 0.2, 0.5]),
    )
    hope = np.array([1.3, 0.7, 0.9, 1.0])
    assert most_hopeful(dots, hope).tolist() == [2, 1, 0, 3]


@pytest.mark.parametrize(
    'scene',
    [
        replace(SMALL, targets=6, light='lattice', ambient=0.3, seed=3),
        replace(
            SMALL, targets=6, light='stripe', ambient=0.12, dot_radius=10.0, distractors=6, seed=4
        ),
    ],
    ids=['lattice', 'stripe'],
)
def test_a_glance_saves_time_and_changes_nothing(
    scene: SceneSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    image, settings, numbers = render(scene).image, DetectorSettings(family='metashape12'), [0]

    def counted(gray: np.ndarray, dots: Fit, *arguments: object) -> Hypotheses:
        numbers[-1] += len(dots.frames)
        return read_families(gray, dots, *arguments)

    monkeypatch.setattr(detector, 'read_families', counted)
    few = find_hypotheses(image, settings)
    monkeypatch.setattr(proposals, 'HOPEFUL', -np.inf)
    numbers.append(0)
    all_dots = find_hypotheses(image, settings)
    assert numbers[1] > 1.2 * numbers[0]
    targets, expected = report(few, settings), report(all_dots, settings)
    assert len(targets) >= 5
    assert [it.key for it in targets] == [it.key for it in expected]
    for one, other in zip(targets, expected, strict=True):
        assert (one.x, one.y) == pytest.approx((other.x, other.y), abs=0.02)


def test_rims_of_bands_about_narrow_gaps_propose_their_middles() -> None:
    size = np.array([9.0, 11.0, 40.0])
    found = Dots(frame.affine_frames(size, size, size, size, 0 * size), np.ones(3, int), size)
    narrow = replace(FAMILIES[0], band_inner=1.5, band_outer=2.0)
    dots = with_rims(found, [*FAMILIES, narrow], 5.0)
    assert frame.mean_radii(dots.frames).tolist() == pytest.approx([9, 11, 40, 5.5])
    assert dots.frames[3, :2, 2].tolist() == [11, 11]


def test_a_dot_in_the_shape_of_others_is_where_its_edges_put_it() -> None:
    rendering = render(replace(SMALL, texture=0.0, tilt=0.0, seed=5))
    gray = rendering.image.astype(np.float32)
    x, y = np.array([(it.x, it.y) for it in rendering.targets]).T
    right = measured(gray, x, y, SMALL.dot_radius, rounds=1)
    aside = replace(right, frames=frame.translated(right.frames, 3.0, 0.0))
    for dots in (right, aside):
        alike = measure_alike(gray, dots)
        assert (hopes(gray, alike, FAMILIES) > HOPEFUL).all()
        centres = sorted(alike.frames[:, :2, 2].tolist())
        assert np.allclose(centres, sorted(zip(x, y, strict=True)), atol=0.2)
    assert not len(measure_alike(gray, right.select(slice(0))).frames)
