"""Whether an image is mirrored, from the IDs that it should show.

Every word of a family of ring codes is another word of the family in a mirror, so that a mirrored
image shows as many targets as the original. This is known only where IDs are expected.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

from ahf_ros.target import UNDECODED, Target

MirroredId = Callable[[Target], int | None]
"""From a target to the ID that it has in a mirror, None if that is unknown."""

_MINIMUM_TARGETS = 3  # targets; fewer may have such IDs by chance


def is_mirrored(
    targets: Sequence[Target], expected: Collection[int], mirrored: MirroredId
) -> bool:
    """Return whether most IDs of an image are not expected, and most would be in a mirror.

    Parameters
    ----------
    targets : sequence of Target
        Targets of one image, before those with unexpected IDs are left out.
    expected : collection of int
        IDs that the image may show; empty if it may show any, and then no image is mirrored.
    mirrored : callable

    Examples
    --------
    >>> seen = [Target(identifier, 0, 0.0, 0.0, 4.0, 4.0) for identifier in (11, 12, 13)]
    >>> is_mirrored(seen, {1, 2, 3}, lambda target: target.id - 10)
    True
    """
    decoded = {target.key: target for target in targets if target.id != UNDECODED}.values()
    if not expected or len(decoded) < _MINIMUM_TARGETS:
        return False
    direct = sum(target.id in expected for target in decoded)
    reflected = sum(mirrored(target) in expected for target in decoded)
    return 2 * direct < len(decoded) < 2 * reflected
