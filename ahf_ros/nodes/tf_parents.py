"""Who is whose parent in tf: a frame has one, and no frame is its own ancestor (REP 105)."""

from __future__ import annotations


class Parents:
    """The parents of frames, as tf has them; a contradiction to what a node publishes stays."""

    def __init__(self) -> None:
        self._parents: dict[str, set[str]] = {}

    def add(self, parent: str, child: str) -> None:
        """Remember a transform that somebody publishes."""
        self._parents.setdefault(child.lstrip('/'), set()).add(parent.lstrip('/'))

    def refusal(self, parent: str, child: str) -> str:
        """Return why a transform may not be published; empty if it may."""
        if not (parent and child):
            return 'the images have no frame_id, accepted is the frame of the camera'
        if parent == child:
            return f'{child!r} is the frame of both camera and targets, accepted are two names'
        if others := sorted(self._parents.get(child, set()) - {parent}):
            return f'{child!r} has the parent {others[0]!r} already, accepted is one parent'
        if child in self._ancestors(parent):
            return f'{child!r} is an ancestor of {parent!r} already, accepted is no loop'
        return ''

    def _ancestors(self, frame: str) -> set[str]:
        found: set[str] = set()
        waiting = [frame]
        while waiting:
            new = self._parents.get(waiting.pop(), set()) - found
            found |= new
            waiting += new
        return found
