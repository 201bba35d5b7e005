"""The table of stated confidences and the share that is right."""

import numpy as np

from benchmarks.confidence import reliability_table


def test_each_condition_and_all_of_them_have_their_shares() -> None:
    stated = np.array([0.2, 0.96, 0.97, 1.0])
    right = np.array([False, True, False, True])
    _, rule, *rows = reliability_table(['dark', 'dark', 'bright', 'bright'], stated, right)
    assert rule == '|---|---|---|---|---|'
    assert rows == [
        '| dark | 0.0 to 0.5 | 1 | 0.2000 | 0.0000 |',
        '| dark | 0.95 to 0.98 | 1 | 0.9600 | 1.0000 |',
        '| bright | 0.95 to 0.98 | 1 | 0.9700 | 0.0000 |',
        '| bright | 0.999 to 1.0 | 1 | 1.0000 | 1.0000 |',
        '| all | 0.0 to 0.5 | 1 | 0.2000 | 0.0000 |',
        '| all | 0.95 to 0.98 | 2 | 0.9650 | 0.5000 |',
        '| all | 0.999 to 1.0 | 1 | 1.0000 | 1.0000 |',
    ]
