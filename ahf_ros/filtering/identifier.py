"""Adaptive homomorphic filtering: the identification chooses the filter of its image [1]_.

The image as received is identified first. Where it does not show the N targets that are expected,
a genetic search looks for the filter through which the detector finds n with the smallest |N - n|.
It works with any detector, of which it knows nothing but how it is called.

References
----------
.. [1] Shang & Liu, Remote Sens. 2023, 15, 3151.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field, replace
from numbers import Integral
from typing import Any

import numpy as np

from ahf_ros.filtering.fusion import fused
from ahf_ros.filtering.genes import TuningSettings, tuned
from ahf_ros.filtering.genetic import GeneticSettings, SearchResult, Values, search
from ahf_ros.filtering.homomorphic import FilterSettings
from ahf_ros.filtering.trials import AnyDetector, Trials, checked_targets, confirmed
from ahf_ros.imaging.image import check_image
from ahf_ros.settings.parameter import check_parameters, numbers_in, parameter
from ahf_ros.target import FilterState, Identification, Target, count_codes

Refinement = Callable[[np.ndarray, Sequence[Target]], Sequence[Target]]
"""From the image as received and targets found in a filtered one to the same targets, with centres
taken from the image as received."""

Estimate = Callable[[np.ndarray], int]
"""From the image as received to the number of coded targets that it seems to show."""


@dataclass(frozen=True, slots=True)
class AdaptiveSettings:
    """Whether and where a filter is searched for, and how.

    The default of `max_evaluations` bounds what an image costs where no filter shows all N
    targets. With the extended genes, 50 filters find what 100 of the published search do
    (`benchmarks/strategies.py`).
    """

    ahf: bool = parameter(
        True, 'Whether to search for a filter where the image as received does not show N targets.'
    )
    expected_ids: str = parameter(
        '',
        'IDs of the coded targets in every image, as 1-54, 60; their number is N, and other IDs '
        'are wrong.',
    )
    fusion: bool = parameter(
        False,
        'Whether targets count that other filters than the best one show, after a search in vain.',
    )
    coarse: bool = parameter(
        False,
        'Whether to search on the image at half its size, and to confirm the best few filters at '
        'full size.',
    )
    threads: int = parameter(
        0,
        'Filters tried at the same time, 0: one a processor core. The result is the same.',
        minimum=0,
        maximum=256,
    )
    tuning: TuningSettings = field(default_factory=TuningSettings)
    filter: FilterSettings = field(default_factory=FilterSettings)
    genetic: GeneticSettings = field(default_factory=GeneticSettings)

    def __post_init__(self) -> None:
        """Check every parameter."""
        check_parameters(self)
        numbers_in('expected_ids', self.expected_ids)

    @property
    def listed(self) -> frozenset[int]:
        """The IDs that images may show; empty where any may be."""
        return numbers_in('expected_ids', self.expected_ids)


def identify(
    image: np.ndarray,
    detector: AnyDetector,
    expected: int,
    settings: AdaptiveSettings | None = None,
    refine: Refinement | None = None,
    estimate: Estimate | None = None,
    draft: AnyDetector | None = None,
) -> Identification:
    """Identify the targets of one image through the filter that suits the detector.

    Parameters
    ----------
    image, expected
        As for `AdaptiveIdentifier.identify`.
    detector, settings, refine, estimate, draft
        As for `AdaptiveIdentifier`.

    Returns
    -------
    Identification

    Raises
    ------
    ValueError
        As `AdaptiveIdentifier.identify` does.
    """
    identifier = AdaptiveIdentifier(detector, settings, refine, estimate, draft)
    return identifier.identify(image, expected)


@dataclass(frozen=True, slots=True)
class Memory:
    """What lives from one image to the next.

    Attributes
    ----------
    filter : tuple of float or None
        The filter that the next image is begun with; None for none.
    settled : tuple of 2 int or None
        n and N of the last image; None unless N was estimated.
    """

    filter: Values | None = None
    settled: tuple[int, int] | None = None


class AdaptiveIdentifier:
    """Identifies one image after the other and begins each with the filter that worked last.

    Results depend on the images since the last `reset` and, with `max_duration`, on the machine.

    Parameters
    ----------
    detector : callable
        From an 8-bit image to the targets in it. Targets with the same ID count once and are all
        passed on; what it raises, `identify` raises.
    settings : AdaptiveSettings, optional
        The limits of the search and the number of threads.
    refine : callable, optional
        From the image as received and the targets to the same targets with better centres; the
        method `refine` of the detector where None, if it has one. It is asked where the targets
        were found in another image: through a filter, or in the 8-bit version of an image with
        more bits.
    estimate : callable, optional
        From the image as received to N, asked where N is unknown. Not for every image: while the
        filter that worked last, or none, goes on to show the n codes of the image before, the
        light and the targets are taken to be the same, and so is N; no filter is searched for,
        either. What it raises, `identify` raises.
    draft : callable, optional
        The detector with centres good enough for `refine`, in less time; the method `draft` of
        the detector where None, if it has one. It is asked instead of the detector wherever
        `refine` is asked next.
    clock : callable, optional
        Time in s.

    Attributes
    ----------
    last_search : SearchResult or None
        The search for the last image; None where there was none.
    memory : Memory
        What earlier images leave to the next one; set it to go on where another left off.
    """

    def __init__(
        self,
        detector: AnyDetector,
        settings: AdaptiveSettings | None = None,
        refine: Refinement | None = None,
        estimate: Estimate | None = None,
        draft: AnyDetector | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.last_search: SearchResult | None = None
        self._detector = detector
        self._settings = settings or AdaptiveSettings()
        self._refine = refine or getattr(detector, 'refine', None)
        self._draft = draft or getattr(detector, 'draft', None)
        self._estimate = estimate
        self._clock = clock
        self.memory = Memory()

    def reset(self) -> None:
        """Forget what worked for earlier images."""
        self.memory = Memory()

    def identify(self, image: np.ndarray, expected: int) -> Identification:
        """Identify the targets of one image; call it from one thread at a time.

        Parameters
        ----------
        image : ndarray of uint8, uint16, float32 or float64, shape (height, width)
            The image as received.
        expected : int
            N, the number of coded targets that it shows; 0 where unknown: N is then estimated, or
            no filter tried where nothing estimates it. Codes that the detector shows at once are
            targets: no estimate is below their number. Where the settings list the IDs, N is
            their number, whatever is given here; a target with another ID is left out, and counts
            as much against a filter as one that it misses.

        Returns
        -------
        Identification
            The result with the smallest |N - n|, of equally good ones that of the image as
            received, then the first; with `fusion`, and after a search, what it and the other
            filters show together, see `ahf_ros.filtering.fusion`. The evaluations of its filter
            state are the identifications that led to it; threads may have begun others when the
            right one was found.

        Raises
        ------
        ValueError
            If the image is not accepted, `expected` is not an integer of at least 0, or the
            detector or the refinement returns anything but a list of targets at finite places, or
            the estimate is no integer of at least 0.
        """
        started = self._clock()
        check_image(image)
        _check_count('expected', expected)
        listed = self._settings.listed
        expected = len(listed) or expected
        estimate = None if expected else self._estimate
        # Without a refinement, centres are those of the detector.
        draft = (self._refine and self._draft) or self._detector
        trials = Trials(image, self._detector, draft, expected, listed, self._settings.filter)
        tried: tuple[Values, ...] = ()
        threads = self._settings.threads or os.cpu_count() or 1
        with ThreadPoolExecutor(threads) if threads > 1 else nullcontext() as executor:
            if estimate and self._unchanged(trials, estimate, executor):
                chosen, evaluations = self.memory.filter, 1
            else:
                chosen, evaluations, tried = self._choose(trials, executor)
        targets = trials.targets[chosen]
        others = tried if self._settings.fusion else ()
        if others:
            targets = fused(trials.of([chosen, None, *others]))
        settled = (count_codes(targets), trials.expected) if estimate else None
        self.memory = replace(self.memory, settled=settled)
        if self._refine and (chosen or others or image.dtype != np.uint8):
            targets = checked_targets(self._refine(image, targets), 'refine')
        state = FilterState(
            evaluations=evaluations,
            generations=self.last_search.generations if self.last_search else 0,
            duration=self._clock() - started,
        )
        if chosen:
            state = replace(state, applied=True, **asdict(tuned(image.shape, chosen)))
        ordered = tuple(sorted(targets, key=lambda target: target.id))
        return Identification(ordered, trials.expected, state, estimate is not None)

    def _unchanged(self, trials: Trials, estimate: Estimate, executor: Executor | None) -> bool:
        """Return whether an image shows what the last one did; tell the trials what N is."""
        self.last_search = None
        shown = trials.count(self.memory.filter, executor)
        settled = self.memory.settled
        if shown and settled and settled[0] == shown:
            trials.expected = settled[1]
            return True
        estimated = estimate(trials.image)
        _check_count('estimate', estimated)
        trials.expected = max(int(estimated), shown)
        return False

    def _choose(
        self, trials: Trials, executor: Executor | None
    ) -> tuple[Values | None, int, tuple[Values, ...]]:
        """Return the best filter, the evaluations, and the filters that a search tried.

        None is the image as received.
        """
        self.last_search = None
        remembered = self.memory.filter
        searching = self._settings.ahf and trials.expected > 0
        if searching and remembered and trials.discrepancy(remembered, executor) == 0:
            return remembered, len(trials.targets), ()
        unfiltered = trials.discrepancy(None, executor)
        if not searching or unfiltered == 0:
            self.memory = replace(self.memory, filter=None if searching else remembered)
            return None, len(trials.targets), ()
        genetic = self._settings.genetic
        searched = trials.reduced() if self._settings.coarse else trials
        self.last_search = result = search(
            searched.discrepancy,
            self._settings.tuning.genes,
            genetic,
            np.random.default_rng(genetic.seed),
            initial=[remembered] if remembered else [],
            executor=executor,
            clock=self._clock,
        )
        evaluations = 1 + result.evaluations
        tried = result.tried
        if searched is not trials:
            tried = confirmed(tried, searched, trials, executor)
            evaluations += len(tried)
        best = min(tried, key=trials.discrepancy)
        chosen = best if trials.discrepancy(best) < unfiltered else None
        self.memory = replace(self.memory, filter=chosen)
        return chosen, evaluations, tried


def _check_count(name: str, count: Any) -> None:
    if isinstance(count, bool) or not isinstance(count, Integral) or count < 0:
        raise ValueError(f'{name} is {count!r}, accepted is an integer of at least 0')
