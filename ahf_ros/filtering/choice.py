"""The choice of the filter, and of the combination of a stack, with the smallest |N - n|."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np

from ahf_ros.filtering.genes import first_filters, genes_of, with_combination
from ahf_ros.filtering.genetic import SearchResult, Values, search
from ahf_ros.filtering.settings import AdaptiveSettings
from ahf_ros.filtering.trials import Trials, confirmed


@dataclass(frozen=True, slots=True)
class Choice:
    """What was chosen for an image or stack, and how it was found.

    Attributes
    ----------
    expected : int
        N.
    filter : tuple of float or None
        What was chosen, see `Trials`.
    remembered : tuple of float or None
        What to try first for the next image.
    evaluations : int
        Number of identifications.
    tried : tuple of tuple of float
        What a search tried.
    search : SearchResult or None
        The search; None if there was none.
    """

    expected: int
    filter: Values | None
    remembered: Values | None
    evaluations: int
    tried: tuple[Values, ...] = ()
    search: SearchResult | None = None


def choose(
    trials: Trials,
    expected: int,
    settings: AdaptiveSettings,
    remembered: Values | None,
    executor: Executor | None,
    clock: Callable[[], float],
) -> Choice:
    """Return what shows n targets with the smallest |N - n|.

    Parameters
    ----------
    trials : Trials
    expected : int
        N; 0 if it is unknown.
    settings : AdaptiveSettings
        A patience of 0 is no limit.
    remembered : tuple of float or None
        What worked for the image before.
    executor : concurrent.futures.Executor or None
        Threads of the search.
    clock : callable
        Time in s.
    """
    discrepancy = partial(trials.discrepancy, expected)
    searching = settings.ahf and expected > 0
    if searching and remembered and discrepancy(remembered, executor) == 0:
        return Choice(expected, remembered, remembered, len(trials.targets))
    plain = _best_plain(trials, expected, executor)
    kept = None if plain == trials.plain[0] else plain
    if not searching or discrepancy(plain) == 0:
        return Choice(expected, plain, kept if searching else remembered, len(trials.targets))
    searched = trials.reduced() if settings.coarse else trials
    genes = with_combination(genes_of(settings.tuning), len(trials.plain))
    initial = [remembered] if remembered and len(remembered) == len(genes) else []
    reference = math.inf
    if settings.genetic.patience:
        initial += first_filters(genes, plain)
        reference = searched.discrepancy(expected, plain, executor)
    result = search(
        partial(searched.discrepancy, expected),
        genes,
        settings.genetic,
        np.random.default_rng(settings.genetic.seed),
        initial=initial,
        reference=reference,
        executor=executor,
        clock=clock,
    )
    evaluations = len(trials.plain) + result.evaluations
    tried = result.tried
    if searched is not trials:
        tried = confirmed(expected, tried, searched, trials, executor)
        evaluations += len(tried)
    best = min(tried, key=discrepancy)
    if discrepancy(best) < discrepancy(plain):
        return Choice(expected, best, best, evaluations, tried, result)
    return Choice(expected, plain, kept, evaluations, tried, result)


def _best_plain(trials: Trials, expected: int, executor: Executor | None) -> Values | None:
    """Return the first of the best without a filter; without N, the most promising one."""
    best = trials.plain[0]
    trials.count(best, executor)
    for plain in trials.plain[1:] if expected else ():
        fewest = trials.discrepancy(expected, best)
        if fewest == 0:
            break
        if trials.discrepancy(expected, plain, executor) < fewest:
            best = plain
    return best
