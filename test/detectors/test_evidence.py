import numpy as np
import pytest

from ahf_ros.detectors.ring.evidence import (
    MarkAppearance,
    border_evidence,
    level_evidence,
    light_levels,
    step_evidence,
)

ANGLES = 40


def marks(polarity, contrast=0.25, bright=200.0):
    return MarkAppearance(
        np.array([polarity]), np.array([contrast]), np.array([bright]), np.array([0.8])
    )


def light(levels, of=None):
    """Return the light that bright places of given gray values show, without edges in the gap."""
    bright = np.resize(np.array(levels, float), (1, ANGLES))
    return light_levels(bright, np.full((2, 1, ANGLES), 100.0), of or marks(1))


def test_a_dark_mark_is_darker_and_a_bright_one_brighter_by_its_contrast():
    dark, bright = marks(1).step(np.array([[100.0]])), marks(-1).step(np.array([[100.0]]))
    assert dark[0, 0] == pytest.approx(np.log((25 + 8) / (100 + 8)))
    assert bright[0, 0] == -dark[0, 0]


@pytest.mark.parametrize('level', [220.0, 60.0, 20.0])
def test_steps_are_read_in_light_and_in_shadow(level):
    surround = np.full((1, ANGLES), level)
    there = light([220.0, 60.0, 20.0])
    marked = step_evidence(surround, 0.25 * surround, marks(1), there)
    unmarked = step_evidence(surround, surround, marks(1), there)
    assert (marked > 0.5).all()
    assert (unmarked < -0.5).all()
    assert (np.abs(np.concatenate([marked, unmarked])) <= 4).all()


def test_bright_marks_are_read_on_a_black_surround():
    surround = np.full((1, ANGLES), 2.0)
    of = marks(-1, contrast=0.02)
    there = light([200.0], of)
    assert (step_evidence(surround, np.full((1, ANGLES), 180.0), of, there) > 1).all()
    assert (step_evidence(surround, surround, of, there) < -1).all()


def test_levels_that_light_and_marks_share_say_nothing():
    # MarkAppearance in the light are as dark as the surround in the shadow.
    there = light([200.0, 50.0])
    values = np.array([[[200.0, 50.0, 12.5]]])  # one depth, one target, three places
    lit, shared, deep = level_evidence(values, there)[0]
    assert lit < -2
    assert abs(shared) < 0.3
    assert deep > 2


def test_the_more_edges_of_light_the_less_a_step_says():
    calm = np.full((2, 1, ANGLES), 100.0)
    restless = calm.copy()
    restless[1, 0, ::2] = 30.0
    bright = np.resize([100.0, 30.0], (1, ANGLES))
    surround = np.full((1, ANGLES), 30.0)
    values = np.full((1, ANGLES), 25.0)  # a mark in the light, or the same shadow without a mark
    alone, doubted = (
        step_evidence(surround, values, marks(1), light_levels(bright, gap, marks(1)))
        for gap in (calm, restless)
    )
    assert (alone < -2).all()
    assert (doubted > alone + 1).all()


def test_borders_are_found_where_they_are():
    band = np.full((3, 1, ANGLES), 200.0)
    band[:, :, 10:20] = 50.0
    rises, falls = border_evidence(band, marks(1), light([200.0]))
    assert rises[0, 9] == rises.max() > 1  # after the last unmarked place
    assert falls[0, 19] == falls.max() > 1
    assert (rises[0, 25:35] < -1).all()
    assert (falls[0, 25:35] < -1).all()
