"""The family of targets whose print is that of several families: that of their neighbours.

Nothing in the image of such a target tells its family. So it is that of the nearest target whose
family is certain, and without one the word is not certain, either.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ahf_ros.codes.ring import canonical, family
from ahf_ros.codes.same_print import words_of_print
from ahf_ros.detectors.ring.hypotheses import Hypotheses


def decoded(hypotheses: Hypotheses) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the families, the canonical code words and the IDs of hypotheses.

    Returns
    -------
    names : ndarray of str, shape (k,)
    codes, ids : ndarray of int64, shape (k,)
    """
    names = np.array([code.name for code in hypotheses.families], str)
    codes, ids = np.zeros((2, len(names)), np.int64)
    for name in np.unique(names):
        which = names == name
        codes[which], ids[which] = canonical(hypotheses.words[which], family(str(name)))
    return names, codes, ids


def settle_same_prints(hypotheses: Hypotheses, families: Sequence[str]) -> Hypotheses:
    """Return hypotheses of which those of a print of several families are of one, or uncertain.

    Parameters
    ----------
    hypotheses : Hypotheses
        Of all dots of an image.
    families : sequence of str
        Names of the families that the image may show.
    """
    names, codes, _ = decoded(hypotheses)
    certain = np.flatnonzero(hypotheses.certain)
    prints = {int(i): words_of_print(str(names[i]), int(codes[i])) for i in certain}
    doubtful = [index for index, words in prints.items() if len(words) > 1]
    clear = np.array([index for index, words in prints.items() if len(words) == 1], int)
    words, confidence = hypotheses.words.copy(), hypotheses.confidence.copy()
    of_families = hypotheses.families.copy()
    centres = hypotheses.frames[:, :2, 2]
    for index in doubtful:
        of_print = {name: word for name, word in prints[index].items() if name in families}
        others = clear[np.isin(names[clear], list(of_print))]
        if not others.size:
            confidence[index] = 0.0
            continue
        nearest = others[np.hypot(*(centres[others] - centres[index]).T).argmin()]
        words[index] = of_print[names[nearest]]
        of_families[index] = family(str(names[nearest]))
    return replace(hypotheses, words=words, confidence=confidence, families=of_families)
