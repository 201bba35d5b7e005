"""What a search tried, as a record that people and programs read."""

from __future__ import annotations

from ahf_ros.filtering.genes import tuned
from ahf_ros.filtering.genetic import SearchResult
from ahf_ros.filtering.trials import Trials
from ahf_ros.imaging.stack import ImageStack
from ahf_ros.target import SearchTrace


def trace_of(search: SearchResult, trials: Trials, stack: ImageStack) -> SearchTrace:
    """Return the filters of a search and their discrepancies.

    Parameters
    ----------
    search : SearchResult
        A search on the images at half their size has the filters that act alike on the whole ones.
    trials : Trials
        Of the whole images.
    stack : ImageStack
        The images as received, or one.
    """
    parts = [trials.parts(values) for values in search.tried]
    filters = [tuned(stack.shape, gains or (1.0, 1.0)) for _, gains in parts]
    names = stack.names if len(trials.plain) > 1 else ()
    return SearchTrace(
        reason=search.reason,
        discrepancies=tuple(int(discrepancy) for discrepancy in search.discrepancies),
        gamma_high=tuple(it.gamma_high for it in filters),
        gamma_low=tuple(it.gamma_low for it in filters),
        cutoff=tuple(it.cutoff for it in filters),
        attenuation=tuple(it.attenuation for it in filters),
        generations=tuple(generation.evaluations for generation in search.history),
        combinations=tuple(names[number] for number, _ in parts) if names else (),
    )
