"""Frames of dots without the shift of their edges."""

from __future__ import annotations

import numpy as np
import pytest

from ahf_ros.features import frame
from ahf_ros.features.circle_fit import Fit
from ahf_ros.features.edge_shift import SMALL, unshifted


@pytest.mark.parametrize('polarity', [1, -1])
def test_small_dots_are_read_without_and_with_the_shift_of_their_edge(polarity):
    radii = np.array([SMALL - 2, SMALL + 5])
    fit = Fit(
        frame.affine_frames(np.array([50.0, 90.0]), 40.0, radii, radii, 0.0),
        np.full(2, polarity),
        *(np.ones(2) for _ in range(4)),
        covariance=np.tile(np.eye(2), (2, 1, 1)),
        blur=np.full(2, 0.8),
        edge_shift=np.zeros(2),
    )
    which, frames = unshifted(fit)
    assert which.tolist() == [0, 1, 0]
    outwards = frame.mean_radii(frames) - radii[which]
    assert outwards == pytest.approx(np.array([0, 0.2, 0.4]) * polarity)  # in the blur, 0 to 1/2
    assert frames[:, :2, 2] == pytest.approx(fit.frames[which, :2, 2])


@pytest.mark.parametrize('polarity', [1, -1])
def test_beside_a_saturated_ground_a_larger_shift_is_tried_as_well(polarity):
    radii = np.array([SMALL + 5, SMALL - 2, SMALL + 5])
    fit = Fit(
        frame.affine_frames(np.array([50.0, 90.0, 130.0]), 40.0, radii, radii, 0.0),
        np.full(3, polarity),
        contrast=np.full(3, 0.4),
        bright=np.array([200.0, 255.0, 255.0]),
        share=np.ones(3),
        deviation=np.ones(3),
        covariance=np.tile(np.eye(2), (3, 1, 1)),
        blur=np.full(3, 0.8),
        edge_shift=np.zeros(3),
    )
    which, frames = unshifted(fit)
    assert which.tolist() == [0, 1, 2, 1, 1, 2]
    outwards = frame.mean_radii(frames) - radii[which]
    assert outwards == pytest.approx(np.array([0.2, 0, 0.2, 0.4, 1.0, 1.0]) * polarity)
