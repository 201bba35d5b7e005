"""The families that an image shows, chosen on its clearest dots.

A glance at a dot bounds the evidence for each print, which is a band and a number of sectors. That
of the right print is nearly always the highest, so that a few readings tell the families, and
those that none of the clearest dots shows are not read at all.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ahf_ros.families.ring.decoding import DOUBT
from ahf_ros.families.ring.families import covering_families, words_shown
from ahf_ros.families.ring.hypotheses import Hypotheses
from ahf_ros.families.ring.proposals import HOPEFUL, Print, bounds, measure_likely, most_hopeful
from ahf_ros.families.ring.reading import read_bands
from ahf_ros.families.ring.rivals import has_more, odds
from ahf_ros.prints.ring import RingPrint
from ahf_ros.vision.circle_fit import ENOUGH, Fit

_CLEAREST = 32  # dots that tell the family of an image
_OTHERS = 2048  # clearest ones of the others: texture and letters have thousands
_CLEAR = 0.5  # bound of the mean evidence of a reading, which spots of light hardly reach
_DOUBTED = 0.1  # probability that all words are wrong, below which they show a family
_ROUGH = (0.0,)  # shifts of edges that are tried to find these, px
_SAMPLE = 8  # of those that seem to have a print, which are read first
_LIKELIEST = 16  # dots to have a print, of which none shows that it is not there
_CONCEIVABLE = 0.1  # confidence of a word of many, from which it may be certain as one of few
_NEARLY = 0.05  # mean evidence of a reading, by which a print is as good as the best one
_ALIKE = 0.1  # the same, of prints of one band that are read beside the best one
_MARKS = 30.0  # log odds of a word against bare paper, of dots with marks
_PRINTS = 4  # the most likely ones, which are tried on the same dots


def choose_families(gray: np.ndarray, dots: Fit, families: Sequence[RingPrint]) -> list[RingPrint]:
    """Return as few of some families as have all words of the print that the clearest dots show.

    Only their likeliest print is tried, on the likeliest of them.
    """
    clearest = dots.select(dots.clearest(_CLEAREST))
    return covering_families(_words_shown(gray, clearest, families, tried=1, most=_SAMPLE))


def further_families(
    gray: np.ndarray, dots: Fit, families: Sequence[RingPrint], shown: Sequence[RingPrint] = ()
) -> list[RingPrint]:
    """Return the same for dots that no family explains, most of which are none of targets.

    A family with more words may have the prints of those that were shown before.
    """
    dots = dots.select(dots.share >= ENOUGH)
    dots = dots.select(dots.clearest(_OTHERS))
    if not families or not len(dots.frames):
        return []
    finest = {code.band: code.bits for code in sorted(families, key=lambda code: code.bits)}
    mean = bounds(gray, dots, list(finest.items()), _ROUGH).max(axis=0)
    order = most_hopeful(dots, mean)
    order = order[mean[order] > _CLEAR][:_CLEAREST]
    first = [(code.band, code.bits) for code in shown]
    return covering_families(_words_shown(gray, dots.select(order), families, first))


def _words_shown(
    gray: np.ndarray,
    dots: Fit,
    families: Sequence[RingPrint],
    first: Sequence[Print] = (),
    tried: int = _PRINTS,
    most: int = _LIKELIEST,
) -> list[dict[RingPrint, int]]:
    """Return words of the likeliest print of some dots that has any, by family.

    So many prints are tried at the most, those of `first` before all others, each on so many of
    the likeliest dots. The one that is tried first begins with a sample of these, as it is nearly
    always right.
    """
    prints = list(dict.fromkeys((code.band, code.bits) for code in families))
    mean = bounds(gray, dots, prints)
    hopeful = (mean.max(axis=0) > HOPEFUL) & (dots.share >= ENOUGH)
    if not hopeful.any():
        return []
    dots, mean = dots.select(hopeful), mean[:, hopeful]
    likely = mean > mean.max(axis=0) - _NEARLY
    known: list[Print] = []
    ranks = 0
    ordered = _likeliest(prints, np.maximum(mean, 0))
    for best in sorted(ordered, key=lambda it: prints[it] not in first):
        if prints[best] in known or ranks == tried:
            continue
        read: list[Hypotheses] = []
        order = np.argsort(-mean[best], kind='stable')
        likeliest = order[likely[best, order]][:most]
        if not len(likeliest):
            continue
        alike = _alike(prints, mean[:, likeliest[:_SAMPLE]], best)
        # What is tried before likelier prints is not read on the dots that these are likely on.
        known += [prints[best]] if prints[best] in first else alike
        same = [code for code in families if _has_any(code, prints[best : best + 1])]
        rivals = [code for code in families if _has_any(code, alike) and code not in same]
        ends = [0, most] if ranks else [0, _SAMPLE, most]
        ranks += 1
        for some in filter(len, (likeliest[part] for part in map(slice, ends, ends[1:]))):
            read.append(_read(gray, dots.select(some), same, rivals, thorough=tried > 1))
            every = Hypotheses.joined(read)
            if _tells(every):
                return words_shown(every, families)
    return []


def _alike(prints: Sequence[Print], mean: np.ndarray, best: int) -> list[Print]:
    """Return prints whose bounds on some dots, (prints, k), are about those of the best one.

    Bounds tell the band. How many sectors it has, only words tell.
    """
    of_all = mean.mean(axis=1)
    return [
        it
        for it, own in zip(prints, of_all, strict=True)
        if it[0] == prints[best][0] and own > of_all[best] - _ALIKE
    ]


def _has_any(code: RingPrint, prints: Sequence[Print]) -> bool:
    """Return whether a family has one of some prints, or every other edge of one."""
    return any(code.band == band and bits % code.bits == 0 for band, bits in prints)


def _likeliest(prints: Sequence[Print], mean: np.ndarray) -> list[int]:
    """Return the indices of prints, the likeliest first, from the bounds of k dots, (prints, k).

    That which all dots may have comes before those that the best two have: where light makes most
    of the dots, few are of targets, but none has a higher bound.
    """
    orders = []
    for of_prints in (mean.mean(axis=1), np.sort(mean, axis=1)[:, -2:].mean(axis=1)):
        # Whatever has a number of sectors has its multiples as well.
        for index, (band, bits) in enumerate(prints):
            if any(
                of_prints[other] > of_prints[index] - _NEARLY
                for other, (of_band, fewer) in enumerate(prints)
                if of_band == band and fewer < bits and bits % fewer == 0
            ):
                of_prints[index] -= _NEARLY
        orders.append(np.argsort(-of_prints, kind='stable').tolist())
    of_all, of_best = orders
    return list(dict.fromkeys([of_all[0], *of_best]))


def _read(
    gray: np.ndarray,
    dots: Fit,
    families: Sequence[RingPrint],
    rivals: Sequence[RingPrint],
    *,
    thorough: bool,
) -> Hypotheses:
    """Return the words of dots, by those of some families that explain their bands best.

    Rivals, with other numbers of sectors, read those dots whose words they may explain better, or,
    in a thorough search for words, all dots with marks. Families that have all words of others are
    read first. Where they find nothing conceivable, the others find nothing, as they have no other
    words.
    """
    dots, _ = measure_likely(gray, dots, None)
    every = [*families, *rivals]
    narrow = [code for code in every if any(has_more(of, code) for of in every)]
    found = [read_bands(gray, dots, code) for code in families if code not in narrow]
    read = _shown(found)
    told, clear = _tells(read), _tells(read.select(read.clear))
    if not clear and (told or thorough):
        marked = np.any([(of.seen > _MARKS) | of.certain for of in found], axis=0)
        dots, found = dots.select(marked), [of.select(marked) for of in found]
        if marked.any():
            found += [read_bands(gray, dots, code) for code in rivals if code not in narrow]
        read = _shown(found)
    if _tells(read):
        return read  # whose prints the others may have, too
    conceivable = np.any([of.confidence >= _CONCEIVABLE for of in found], axis=0)
    if conceivable.any():
        some = [of.select(conceivable) for of in found]
        some += [read_bands(gray, dots.select(conceivable), code) for code in narrow]
        read = _shown(some)
    return read


def _tells(read: Hypotheses) -> bool:
    """Return whether it is hardly possible that all words are wrong."""
    return bool(np.prod(1 - read.confidence) < _DOUBTED)


def _shown(found: Sequence[Hypotheses]) -> Hypotheses:
    """Return what is certain by as few families as have a certain word of all dots with one.

    Each has read the same dots. The family that most dots have comes first, and what it explains
    is of no other.
    """
    certain = np.array([of.certain & (of.coded > -DOUBT) for of in found])
    better = np.where(certain, [odds(of) for of in found], 0.0)
    parts = [Hypotheses.joined(found).select(slice(0))]
    while certain.any():
        best = np.lexsort([better.sum(axis=1), certain.sum(axis=1)])[-1]
        parts.append(found[best].select(certain[best]))
        left = ~certain[best]
        certain, better = certain & left, better * left
    return Hypotheses.joined(parts)
