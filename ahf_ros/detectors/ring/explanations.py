"""What best explains that parts of bands are hidden.

At every angle a band is seen, as the ground or as a mark, or something hides it: anything, or
something like the ground. Each stretch that is hidden has a price. A dynamic program along the
band (Viterbi 1967) finds the states with the most evidence.
"""

from __future__ import annotations

import numpy as np

from ahf_ros.detectors.ring.occlusion import HiddenEvidence

_ANYTHING, _LIKE_GROUND = 5.0, 9.0  # price of something that hides a stretch of the band
_EDGE = 3.5  # price of an edge of a mark
_MAXIMUM_END = 3.0  # evidence for an end of something like the ground on a mark
_NEVER = -1e9


def explained_words(of: HiddenEvidence, bits: np.ndarray) -> np.ndarray:
    """Return the evidence for words, each with what best explains that a part of it is hidden.

    Parameters
    ----------
    of : HiddenEvidence
        Of k bands at m angles, `turned`.
    bits : ndarray of bool, shape (k, w, m)
        Whether each of w words has a mark at each angle.

    Returns
    -------
    ndarray of float32, shape (k, w)
    """
    marked = np.ascontiguousarray(bits.transpose(2, 0, 1))
    after = np.roll(marked, -1, axis=0)

    def along(if_marked: np.ndarray, otherwise: np.ndarray, where: np.ndarray) -> np.ndarray:
        either = (of.astype(np.float32).T[..., None] for of in (if_marked, otherwise))
        return np.where(where, *either)

    seen, anything, like_ground = (
        along(part[:, 1], part[:, 0], marked) for part in (of.seen, of.anything, of.like_ground)
    )
    nothing = np.zeros(of.onto.shape)
    begin, end = _ends_on_marks(of)
    begins, ends = along(begin, nothing, marked), along(end, nothing, after)
    border = along(of.off, nothing, marked & ~after) + along(of.onto, nothing, after & ~marked)
    price = of.price[:, None].astype(np.float32)
    any_price, ground_price = price + np.float32(_ANYTHING), price + np.float32(_LIKE_GROUND)
    clear = seen[0]
    other = ground = np.full(clear.shape, _NEVER, np.float32)
    for last in range(len(seen) - 1):
        begun = np.maximum(clear + begins[last], other)
        begun -= ground_price
        best = np.maximum(clear, ground)
        best -= any_price
        clear = clear + border[last]
        np.maximum(clear, other, out=clear)
        np.maximum(clear, np.add(ground, ends[last], out=ends[last]), out=clear)
        clear += seen[last + 1]
        other = np.maximum(other, best, out=best)
        other += anything[last + 1]
        ground = np.maximum(ground, begun, out=begun)
        ground += like_ground[last + 1]
    return np.maximum(clear, np.maximum(other, ground))


def best_explanations(of: HiddenEvidence, bits: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what best explains each word, and how much better arcs of any length would.

    Parameters
    ----------
    of : HiddenEvidence
        Of k bands at m angles, `turned`.
    bits : ndarray of bool, shape (k, m)
        Whether the word of each band has a mark at each angle.

    Returns
    -------
    hidden : ndarray of bool, shape (k, m)
        Where the band is hidden.
    unexplained : ndarray of float64, shape (k,)
        Evidence for marks that begin and end anywhere, over that for the word. A codeword leaves
        nothing of the kind: where something else lies about a dot, this is large.
    """
    count, angles = bits.shape
    ground, mark = np.moveaxis(of.seen, 1, 0)
    words = [
        np.where(bits, _NEVER, ground),
        np.where(bits, mark, _NEVER),
        np.where(bits, of.anything[:, 1], of.anything[:, 0]),
        np.where(bits, of.like_ground[:, 1], of.like_ground[:, 0]),
    ]
    free = [ground, mark, of.anything.max(axis=1), of.like_ground[:, 0]]
    evidence = np.stack([np.concatenate(pair) for pair in zip(words, free, strict=True)])
    evidence = np.ascontiguousarray(evidence.transpose(2, 0, 1))
    moves = _moves(of)
    scores = np.empty((angles, 4, 2 * count))
    scores[0] = np.where(np.arange(4)[:, None] < 2, evidence[0], _NEVER)
    paths = np.empty((4, 4, 2, count))
    for last in range(angles - 1):
        np.add(scores[last].reshape(4, 1, 2, count), moves[last], out=paths)
        score = np.maximum.reduce(paths.reshape(4, 4, -1), axis=0, out=scores[last + 1])
        score += evidence[last + 1]
    best = scores[-1].max(axis=0)
    state, rows = scores[-1, :, :count].argmax(axis=0), np.arange(count)
    hidden = np.empty(bits.shape, bool)
    hidden[:, -1] = state > 1
    for last in range(angles - 2, -1, -1):
        came = scores[last, :, :count] + moves[last, :, state, 0, rows].T
        state = came.argmax(axis=0)
        hidden[:, last] = state > 1
    return hidden, best[count:] - best[:count]


def _moves(of: HiddenEvidence) -> np.ndarray:
    """Return the evidence for moves between states after each angle, shape (m, 4, 4, 1, k).

    States are ground, mark, anything, something like the ground.
    """
    count, angles = of.onto.shape
    moves = np.zeros((4, 4, angles, count))
    moves[0, 1], moves[1, 0] = of.onto.T - _EDGE, of.off.T - _EDGE
    moves[:, 2], moves[:, 3] = -_ANYTHING - of.price, -_LIKE_GROUND - of.price
    moves[2, 2] = moves[3, 3] = 0
    begin, end = _ends_on_marks(of)
    moves[1, 3] += begin.T
    moves[3, 1] += end.T
    return np.ascontiguousarray(moves.transpose(2, 0, 1, 3))[:, :, :, None]


def _ends_on_marks(of: HiddenEvidence) -> tuple[np.ndarray, np.ndarray]:
    """Return the evidence that something like the ground begins on a mark, and that it ends there.

    It makes an edge of its own.
    """
    return np.clip(of.off, 0, _MAXIMUM_END), np.clip(of.onto, 0, _MAXIMUM_END)
