"""Whether an image is mirrored."""

from __future__ import annotations

from ahf_ros.filtering.mirroring import is_mirrored
from ahf_ros.session import create_identifier
from ahf_ros.synthetic.scene import SceneSettings, render
from ahf_ros.target import UNDECODED, Target


def seen(*numbers: int) -> list[Target]:
    return [Target(number, number, 50.0 * number, 5.0, 4.0, 4.0) for number in numbers]


def mirrored(target: Target) -> int | None:
    """Return 7 for 3, 3 for 7, and so on; 5 is the same, and from 10 on nothing is known."""
    return 10 - target.id if target.id < 10 else None


def test_most_ids_decide():
    assert is_mirrored(seen(7, 8, 9), {1, 2, 3}, mirrored)
    assert is_mirrored(seen(7, 8, 9, 3, 20), {1, 2, 3}, mirrored)
    assert not is_mirrored(seen(1, 2, 3), {1, 2, 3}, mirrored)
    assert not is_mirrored(seen(1, 2, 8, 9), {1, 2, 3}, mirrored)


def test_what_cannot_tell_does_not():
    assert not is_mirrored(seen(7, 8, 9), (), mirrored)  # any ID may be there
    assert not is_mirrored(seen(7, 8), {2, 3}, mirrored)  # too few
    assert not is_mirrored(seen(11, 12, 13), {1, 2, 3}, mirrored)  # others
    assert not is_mirrored(seen(9, UNDECODED, UNDECODED), {1, 11}, mirrored)
    assert not is_mirrored([], {1, 2, 3}, mirrored)


def test_a_mirrored_image_of_expected_targets_is_said_to_be_one():
    rendering = render(SceneSettings(width=640, height=480, targets=8, dot_radius=10, seed=3))
    ids = ','.join(str(target.id) for target in rendering.targets)
    identifier = create_identifier(expected_ids=ids, ahf=False)
    assert not identifier.identify(rendering.image).mirrored
    found = identifier.identify(rendering.image[:, ::-1].copy())
    assert found.mirrored
    assert found.count < 4 and found.expected == 8
    assert not create_identifier().identify(rendering.image[:, ::-1].copy()).mirrored
    assert not identifier.identify(rendering.image[::-1, ::-1].copy()).mirrored  # upside down
