"""The bound of what any congruence test can locate, with few pairs of epochs."""

import pytest

from benchmarks.network_epochs import PART, located
from support.simulated_epochs import Field


@pytest.mark.parametrize('bar', [True, False])
def test_no_test_locates_more_than_the_most_powerful_one(bar: bool) -> None:
    most, by_share = located(Field('small', (1.0, 0.8, 0.6), 8, 6), bar, 1, 5 * PART)
    assert 0.9 < by_share <= most + 0.005  # both of one sample of a thousand
