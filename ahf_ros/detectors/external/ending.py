"""Whether this process ends: then nobody waits for programs and detectors of others any more."""

from __future__ import annotations

POLL = 0.02
"""Time between two looks at what is waited for, s."""

_begun = False  # a signal handler sets it, so it has no lock


def begin() -> None:
    """Say that this process ends."""
    global _begun
    _begun = True


def has_begun() -> bool:
    """Return whether this process ends."""
    return _begun
