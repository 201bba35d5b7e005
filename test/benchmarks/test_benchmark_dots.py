"""The benchmark of rings of dots prints wrong IDs and false positives, and draws what it says."""

from benchmarks import dots


def test_every_cell_has_right_wrong_and_false() -> None:
    figures = {'right': 29, 'wrong': 1, 'false_positives': 2, 'rmse_xy': 0.0123}
    row = {'group': 'light', 'name': 'stripe 0.3', 'expected': 30, 'nees': 2.04, 'seconds': 0.5}
    records = [{**row, **figures, 'detector': name, 'ahf': ahf} for name, ahf in dots.METHODS]
    head, rule, line = dots.scene_table(records)
    assert head.count('|') == rule.count('|') == line.count('|')
    assert line.startswith('| light | stripe 0.3 | 30 | 29, 1 wrong, 2 false (0.012) |')
    assert line.endswith('| 2.0 | 0.50 |')
