"""Of several targets with one place or one ID the most certain one is left."""

from ahf_ros.base.target import UNDECODED, Target
from ahf_ros.families.claims import best_targets


def test_of_targets_each_place_and_each_id_has_one() -> None:
    first = Target(7, 7, 50.0, 50.0, 10.0, 10.0, 0.0, confidence=0.99)
    same_place = Target(8, 8, 60.0, 50.0, 10.0, 10.0, 0.0, confidence=0.98)
    same_id = Target(7, 7, 200.0, 50.0, 10.0, 10.0, 0.0, confidence=0.97)
    driven_out = Target(8, 8, 300.0, 50.0, 10.0, 10.0, 0.0, confidence=0.96)
    dots = [Target(UNDECODED, 0, x, 50.0, 10.0, 10.0, 0.0) for x in (201.0, 301.0, 400.0)]
    found = [*dots, driven_out, same_id, same_place, first]
    assert best_targets(found, 2.0) == [first, driven_out, dots[0], dots[2]]
    assert best_targets(found) == [first, same_place, *dots]
