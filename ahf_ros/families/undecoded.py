"""Targets whose IDs are not certain, as they are reported: without an ID, and with the reason."""

from __future__ import annotations

from dataclasses import fields

from ahf_ros.base.target import UNDECODED, Target, UndecodedTarget

_UNLIKELY = 0.02  # confidence of an ID below which a target counts as unread

_FIELDS = tuple(it.name for it in fields(Target))


def undecoded(target: Target, reason: str = 'uncertain') -> UndecodedTarget:
    """Return a target without its ID, with the reason as in `UndecodedTarget`.

    The likely ID and its family are those of the target. One that is uncertain and has no ID, or
    one that is not likely at all, is unread.

    Examples
    --------
    >>> undecoded(Target(7, 19, 10.5, 20.0, 8.0, 7.5, confidence=0.4)).likely_id
    7
    """
    known = {name: getattr(target, name) for name in _FIELDS}
    known |= {'id': UNDECODED, 'code': 0, 'family': ''}
    unlikely = target.id == UNDECODED or target.confidence < _UNLIKELY
    if reason == 'uncertain' and unlikely:
        return UndecodedTarget(**known, reason='unread')
    return UndecodedTarget(
        **known, reason=reason, likely_id=target.id, likely_family=target.family
    )
