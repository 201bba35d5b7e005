"""Targets whose IDs are not certain, as they are reported: without an ID, and with the reason."""

from __future__ import annotations

from dataclasses import fields

from ahf_ros.base.target import UNDECODED, Target, UndecodedTarget

UNLIKELY = 0.02
"""Confidence of an ID below which a target counts as unread."""

_FIELDS = tuple(it.name for it in fields(Target))


def undecoded(target: Target, *, contested: bool = False) -> UndecodedTarget:
    """Return a target without its ID, which is doubtful or which another target contests.

    The likely ID and its family are those of the target, if the ID is likely at all.

    Examples
    --------
    >>> undecoded(Target(7, 19, 10.5, 20.0, 8.0, 7.5, confidence=0.4)).likely_id
    7
    """
    known = {name: getattr(target, name) for name in _FIELDS}
    known |= {'id': UNDECODED, 'code': 0, 'family': ''}
    if target.id == UNDECODED or (not contested and target.confidence < UNLIKELY):
        return UndecodedTarget(**known, reason='unread')
    reason = 'contested' if contested else 'uncertain'
    return UndecodedTarget(
        **known, reason=reason, likely_id=target.id, likely_family=target.family
    )
