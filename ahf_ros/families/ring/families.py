"""The competition of families for the bands about dots.

Every family reads a band by the same likelihood, so that their words compare by their evidence. To
save time, the family that most of the clearest dots have reads all dots, and the others those that
are not clear yet.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import chain

import numpy as np

from ahf_ros.families.claims import leading, within
from ahf_ros.families.ring.hypotheses import Hypotheses
from ahf_ros.families.ring.known import NOTHING_KNOWN, Prior
from ahf_ros.families.ring.reading import read_bands
from ahf_ros.families.ring.rivals import against_rivals, odds
from ahf_ros.prints.ring import RingPrint, canonical, words_of_prints
from ahf_ros.vision import frame
from ahf_ros.vision.circle_fit import Fit

_DOUBT = 0.05  # odds of another family that has all prints, up to which one is sure
_ALL_WORDS = 0.5  # odds of a family of all words against one of a rule, before any print is seen


def read_families(
    gray: np.ndarray,
    dots: Fit,
    families: Sequence[RingPrint],
    prior: Prior = NOTHING_KNOWN,
) -> Hypotheses:
    """Return what the bands about dots are read as, at least one hypothesis of each dot.

    The first family reads all dots, the others those that are not clear yet.
    """
    first, *others = families
    found = read_bands(gray, dots, first, prior)
    found = against_rivals(gray, dots, found, families, prior)
    if not others:
        return found
    rest = dots.select(~found.clear)
    parts = [found]
    for code in others:
        read = read_bands(gray, rest, code, prior)
        parts.append(read.select(read.words > 0))
    return contested(Hypotheses.joined(parts))


def _narrowest(words: dict[RingPrint, int]) -> dict[RingPrint, int]:
    """Return words of a print without those of families that have all prints of another one."""
    return {
        code: word
        for code, word in words.items()
        if not any(_has_more_prints(code, of) for of in words)
    }


@lru_cache(maxsize=256)
def _has_more_prints(code: RingPrint, other: RingPrint) -> bool:
    """Return whether a family has all prints of another one, and further ones."""
    if len(code.words) <= len(other.words):
        return False
    return all(words_of_prints(other, other.words, [code]))


def contested(read: Hypotheses) -> Hypotheses:
    """Return hypotheses of which none is certain where another family has more evidence."""
    _, minor, _ = frame.ellipse_axes(read.frames)
    names = np.array([code.name for code in read.families], str)
    near = within(read.frames, minor)

    def rivals(of: np.ndarray) -> np.ndarray:
        return near(of) & (names != names[of, None])

    beaten = read.certain & ~leading(odds(read), read.certain, rivals, 1.0)
    return replace(read, confidence=np.where(beaten, 0.0, read.confidence))


def decoded(hypotheses: Hypotheses) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the names of families, the canonical code words and the IDs of k hypotheses."""
    names = np.array([code.name for code in hypotheses.families], str)
    codes, ids = np.zeros((2, len(names)), np.int64)
    for code in dict.fromkeys(hypotheses.families):
        which = hypotheses.families == code
        codes[which], ids[which] = canonical(hypotheses.words[which], code)
    return names, codes, ids


def as_described(read: Hypotheses, families: Sequence[RingPrint]) -> Hypotheses:
    """Return hypotheses of families as they are described, not as their bands were measured."""
    named = {code.name: code for code in families}
    return replace(read, families=np.array([named[it.name] for it in read.families], object))


def words_shown(
    hypotheses: Hypotheses, families: Sequence[RingPrint]
) -> list[dict[RingPrint, int]]:
    """Return the words that the prints of k readings are, by those of some families."""
    codes = decoded(hypotheses)[1]
    prints: dict[int, dict[RingPrint, int]] = {}
    for code in dict.fromkeys(hypotheses.families):
        own = np.flatnonzero(hypotheses.families == code)
        prints |= zip(own.tolist(), words_of_prints(code, codes[own], families), strict=True)
    return [prints[index] for index in sorted(prints)]


def settle_same_prints(hypotheses: Hypotheses, families: Sequence[RingPrint]) -> Hypotheses:
    """Assign prints shared by several families to one of them, or mark them uncertain.

    Where two families of an image have a print, it is of the one whose words the other has all, or
    the nearest target that only one of them has tells which it is.
    """
    if len(families) == 1:
        return hypotheses
    certain = np.flatnonzero(hypotheses.certain).tolist()
    shown = words_shown(hypotheses.select(certain), families)
    prints = dict(zip(certain, shown, strict=True))
    present, sure = present_families(list(prints.values()))
    options = {
        index: _narrowest({code: word for code, word in words.items() if code in present})
        for index, words in prints.items()
    }
    clear = np.array([index for index, words in options.items() if len(words) == 1], int)
    own = [next(iter(options[index])) for index in clear.tolist()]
    words, confidence = hypotheses.words.copy(), hypotheses.confidence.copy()
    of_families = hypotheses.families.copy()
    centres = hypotheses.frames[:, :2, 2]
    for index, of_print in options.items():
        near = np.flatnonzero([code in of_print for code in own])
        if not near.size:
            confidence[index] = 0.0
            continue
        away = np.hypot(*(centres[clear[near]] - centres[index]).T)
        code = own[near[away.argmin()]]
        if code not in sure:
            confidence[index] = 0.0
        if code is not of_families[index]:
            words[index] = of_print[code]
            of_families[index] = code
    return replace(hypotheses, words=words, confidence=confidence, families=of_families)


def present_families(
    prints: Sequence[dict[RingPrint, int]],
) -> tuple[list[RingPrint], set[RingPrint]]:
    """Return the families that say all prints in the fewest nats, and those that are sure.

    No other may stand for these. A print costs the logarithm of the number of words of its family,
    and what it takes to say which of the families of the image it is of. One family is likelier,
    and one whose words follow a rule. A family of more words would hardly show only these.
    """
    present, sure = covering_families(prints), set()
    for code in tuple(present):  # what came first may be needless beside what came later
        fewer = [it for it in present if it is not code]
        if _nats(prints, fewer) < _nats(prints, present):
            present = fewer
    left = list(prints)
    for best in present:
        covered = [of for of in left if best in of]
        different = len({of[best] for of in covered})
        rivals = set.intersection(*(set(of) for of in covered)) - {best}
        odds = (
            (len(best.words) / len(code.words)) ** different * _before(code) / _before(best)
            for code in rivals
        )
        if sum(odds) < _DOUBT:
            sure.add(best)
        left = [of for of in left if best not in of]
    return present, sure


def covering_families(prints: Sequence[dict[RingPrint, int]]) -> list[RingPrint]:
    """Return families that have all prints.

    One after the other is the best of what is left, as if others of the most words had the rest.
    """
    left: list[dict[RingPrint, int]] = list(prints)
    found = []
    while left:
        count = Counter(chain.from_iterable(left))
        most, every = max(len(code.words) for code in count), len(left)
        best = min(
            count,
            key=lambda code: (
                _of_family(code, count[code], every)
                + _of_words(every - count[code], most, every)
                - (count[code] < every) * np.log(_DOUBT),
                len(code.words),
            ),
        )
        found.append(best)
        left = [of for of in left if best not in of]
    return found


def _nats(prints: Sequence[dict[RingPrint, int]], families: Sequence[RingPrint]) -> float:
    """Return what prints cost, each as one of the first family that has it, or infinity."""
    left, nats = list(prints), (1 - len(families)) * np.log(_DOUBT)
    for code in families:
        others = [of for of in left if code not in of]
        nats += _of_family(code, len(left) - len(others), len(prints))
        left = others
    return np.inf if left else float(nats)


def _of_family(code: RingPrint, own: int, every: int) -> float:
    return _of_words(own, len(code.words), every) - float(np.log(_before(code)))


def _of_words(own: int, words: int, every: int) -> float:
    """Return what it costs to say so many prints of a family, and that they are of it."""
    return float(own * (np.log(words) - np.log(max(own, 1) / every)))


def _before(code: RingPrint) -> float:
    """Return the odds of a family before any print is seen."""
    return _ALL_WORDS if code.has_all_words else 1.0
