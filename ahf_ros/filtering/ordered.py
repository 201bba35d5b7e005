"""Evaluations by several threads, whose results come in the order of one."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Executor, wait

from ahf_ros.filtering.chromosome import Values


def in_order(
    discrepancy: Callable[[Values], float], tried: Sequence[Values], executor: Executor | None
) -> Generator[float, None, None]:
    """Yield the discrepancies of values in their order.

    Close the generator to cancel what has not begun and to wait for what has.

    Parameters
    ----------
    discrepancy : callable
        From one value per gene to a number; thread-safe if there is an executor.
    tried : sequence of tuple of float
        Values to evaluate. None behind one whose discrepancy is zero is begun.
    executor : concurrent.futures.Executor or None
        Threads; None evaluates one after the other.

    Examples
    --------
    >>> list(in_order(sum, [(1.0, 2.0), (3.0, 4.0)], None))
    [3.0, 7.0]
    """
    if executor is None:
        yield from map(discrepancy, tried)
        return
    successes: list[int] = []

    def evaluate(index: int, values: Values) -> float:
        if successes and min(successes) < index:
            return math.nan  # never read: the search ends before
        result = discrepancy(values)
        if result == 0:
            successes.append(index)
        return result

    futures = [executor.submit(evaluate, *it) for it in enumerate(tried)]
    try:
        for future in futures:
            yield future.result()
    finally:
        for future in futures:
            future.cancel()
        wait(futures)
