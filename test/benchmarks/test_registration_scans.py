import numpy as np

from benchmarks.registration import COMMON, COUNT, registered
from support.scans import clouds


def test_a_chain_closes_within_its_covariance() -> None:
    figures = registered(clouds, 1, 1)
    assert figures.refused == 0
    assert np.shape(figures.chain) == np.shape(figures.adjusted) == (1, COUNT - 1)
    assert figures.closing[0] < 3 * 3 * COMMON
    assert figures.after[0] < 0.03 < figures.before[0]  # mm
