"""Why targets are reported whose confidence is low, and others are not that are certain."""

from collections import Counter
from collections.abc import Mapping, Sequence

from ahf_ros.base.target import UNDECODED, Target, UndecodedTarget
from ahf_ros.base.text import counted, listed

DOUBTFUL_BELOW = 0.95
"""Confidence below which a decoded target counts as doubtful."""

_PROBABILITIES = 'probabilities are reported from {} on'
_MEANING = {
    **dict.fromkeys(('ring', 'cctag', 'several'), _PROBABILITIES.format(0.75)),
    **dict.fromkeys(('gsi', 'dots', 'aruco', 'apriltag', 'square'), _PROBABILITIES.format(0.8)),
    'traditional': 'no probability: how clearly the band is read',
    'gsi_published': 'no probability: how exactly the design fits',
    'dots_published': 'no probability: how many samples agree, from 0.75 on',
}
"""What the confidence of detectors is that report doubtful targets."""


def doubt(target: Target, detector: str) -> str:
    """Return why a detector reports a target in spite of its low confidence.

    It is empty if the confidence is as high as usual, or the target undecoded.
    """
    if target.id == UNDECODED or target.confidence >= DOUBTFUL_BELOW:
        return ''
    return _MEANING.get(detector, f'{detector} sets a lower limit of its own')


def doubtful_remark(doubts: Mapping[str, int], identified: int) -> str:
    """Return how many targets are doubtful, why, and what shows them; nothing if there are none.

    `doubts` are the numbers of targets by what `doubt` returns, `identified` is that of all.

    Examples
    --------
    >>> doubtful_remark({'how many agree': 2}, 9)
    '2 of 9 targets are doubtful (how many agree): look at them with --overlay DIR'
    """
    if not doubts:
        return ''
    why = max(doubts, key=lambda it: doubts[it])
    of_all = f'{sum(doubts.values())} of {counted(identified, "target")}'
    return f'{of_all} are doubtful ({why}): look at them with --overlay DIR'


def repeated_remark(targets: Sequence[UndecodedTarget]) -> str:
    """Return which IDs several targets have, the commonest first; nothing if there are none.

    Examples
    --------
    >>> one = UndecodedTarget(-1, 0, 9.0, 9.0, 8.0, 8.0, likely_id=5, likely_family='a')
    >>> repeated_remark([one, one])
    '2 targets share IDs and are not reported, 5 of a (2): print each ID once'
    """
    if not targets:
        return ''
    counts = Counter((it.likely_id, it.likely_family) for it in targets)
    order = sorted(counts, key=lambda it: (-counts[it], it))
    named = listed([f'{number} of {name} ({counts[number, name]})' for number, name in order])
    return f'{len(targets)} targets share IDs and are not reported, {named}: print each ID once'
