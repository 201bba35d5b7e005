"""Why targets are reported whose confidence is lower than usual."""

from __future__ import annotations

from ahf_ros.target import UNDECODED, Target

DOUBTFUL_BELOW = 0.95
"""Confidence below which a decoded target counts as doubtful."""

_PROBABILITIES = 'probabilities are reported from 0.75 on'
_MEANING = {
    'ring': _PROBABILITIES,
    'cctag': _PROBABILITIES,
    'several': _PROBABILITIES,
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
