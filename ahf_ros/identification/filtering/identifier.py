"""Adaptive homomorphic filtering: the identification chooses the filter of its image [1]_.

The image as received is identified first, or the combinations of a stack, one after the other. If
none shows the N targets that are expected, a genetic search looks for the filter through which the
detector finds n with the smallest |N - n|. The combination of a stack is one of its genes.
It works with any detector: it knows nothing about a detector but how to call it.

References
----------
.. [1] Shang & Liu, Remote Sens. 2023, 15, 3151.
"""

import math
import os
import time
from collections.abc import Callable, Collection, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from numbers import Integral
from typing import Any

import numpy as np

from ahf_ros import kernels
from ahf_ros.base.blas import one_blas_thread
from ahf_ros.base.deprecation import deprecated_arguments
from ahf_ros.base.edge_shift import median_edge_shift
from ahf_ros.base.notices import said_once
from ahf_ros.base.target import (
    UNDECODED,
    FilterState,
    Identification,
    Prints,
    SearchTrace,
    Target,
    UndecodedTarget,
    repeated_targets,
    sorted_targets,
)
from ahf_ros.base.target_check import checked_targets
from ahf_ros.identification.filtering.genes import BEGINNING, FIRST, genes_of, tuned
from ahf_ros.identification.filtering.genetic import SearchResult, Values, search
from ahf_ros.identification.filtering.settings import PUBLISHED, AdaptiveSettings
from ahf_ros.identification.filtering.trials import DetectorFunction, Trials, confirmed, fused
from ahf_ros.vision.stack import ImageStack

Refinement = Callable[[np.ndarray, Sequence[Target]], Sequence[Target]]
"""From the image as received and targets found in a filtered one to the same targets, with centres
measured in the image as received."""

Estimate = Callable[[np.ndarray], int]
"""From the image as received to the number of coded targets that it seems to show."""

MirroredId = Callable[[Target], int | None]
"""From a target to the ID that it has in a mirror, None if that is unknown."""

_MINIMUM_MIRRORED = 3  # targets; fewer may have the IDs of a mirrored image by chance


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """The last image that a detector has seen as received, and what it saw there.

    Attributes
    ----------
    image : ndarray of uint8, shape (height, width)
    targets : tuple of Target
    lost : tuple of Target
        Earlier ones that this image does not show, where they would be.
    turn : int
        How many images came before it.
    still : int
        How many images in a row, up to this one, have shown nothing new beside their targets.
    """

    image: np.ndarray
    targets: tuple[Target, ...]
    lost: tuple[Target, ...] = ()
    turn: int = 0
    still: int = 0


Follow = Callable[[np.ndarray, Seen], Seen]
"""From an image and what was seen in the one before it to what it shows."""


@dataclass(frozen=True, slots=True)
class Memory:
    """What an identification leaves to the next one.

    Attributes
    ----------
    filter : tuple of float or None
        What to try first, see `ahf_ros.identification.filtering.trials.Trials`; None for nothing.
    settled : tuple of 2 int or None
        n and N of the last image; None unless N was estimated.
    families : tuple of str
        The families that were found so far; empty unless they are to be settled.
    shown : int
        How many images have settled them, see `ahf_ros.identification.settling`.
    glanced : int
        In how many parts of images other families have been looked for since; -1 where the next
        image is looked at as a whole.
    """

    filter: Values | None = None
    settled: tuple[int, int] | None = None
    families: tuple[str, ...] = ()
    shown: int = 0
    glanced: int = 0
    seen: Seen | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class _Choice:
    """What was chosen for an image or stack, and how it was found."""

    expected: int
    filter: Values | None
    remembered: Values | None  # to try first for the next image
    evaluations: int
    tried: tuple[Values, ...] = ()  # in a search
    search: SearchResult | None = None


class Identifier:
    """Identifies one image after the other, each beginning with the filter that worked last.

    Results depend on the images since the last `reset` and, with `max_duration`, on the machine.
    `ahf_ros.create_identifier` makes one from settings.

    Parameters
    ----------
    detector : callable
        From an 8-bit image to the targets in it. Targets with the same ID count once and are all
        passed on.
    settings : AdaptiveSettings, optional
        Limits of the search and number of threads; the defaults where None.
    expected_targets : int
        N where `identify` is not given another one; 0 where unknown.
    refine : callable, optional
        From the image as received and the targets to the same targets with better centres. Called
        if the targets were found in another image: through a filter, or in the 8-bit version of an
        image with more bits.
    draft : callable, optional
        The detector with centres good enough for `refine`, in less time. It replaces the detector
        wherever `refine` is called next.
    estimate : callable, optional
        From the image as received to N, called where N is unknown. On a stream, N is estimated
        again when n changes: while the filter that worked last, or none, still shows the n codes
        of the image before, light and targets are taken to be the same and no filter is searched
        for.
    follow : callable, optional
        The detector for an image that comes after another one, whose targets it may show again.
        Stacks, and images that are not 8-bit, are searched wholly.
    interrupt : callable, optional
        Called before each identification; what it raises ends `identify`.
    patience : int
        Patience of a search where the settings have 0, which then shows what its best filter does:
        fusion lives on many. 0 for no limit.
    contested : bool
        Whether the results have targets that another one contradicts, or whose family is not
        settled, with the ID `UNDECODED`.
    mirrored : callable, optional
        From a target to the ID that it has in a mirror, None if that is unknown.
    name : str
        What errors call the detector.
    looked_for : str
        The families that the detector looks for, as the results name them.
    prints : mapping of str to FamilyRecord, optional
        Families that targets may be of, by their names, for the results.
    clock : callable, optional
        Time in s.

    Attributes
    ----------
    last_search : SearchResult or None
        The search for the last image; None if there was none.
    memory : Memory
        What earlier images leave to the next one; set it to continue from another identifier.

    Examples
    --------
    >>> from ahf_ros import Identifier, SceneSettings, create_detector, render
    >>> scene = render(SceneSettings(width=320, height=240, targets=3, dot_radius=8))
    >>> detector = create_detector(family='metashape12')
    >>> Identifier(detector).identify(scene.image, expected_targets=3).count
    3
    """

    def __init__(
        self,
        detector: DetectorFunction,
        settings: AdaptiveSettings | None = None,
        *,
        expected_targets: int = 0,
        refine: Refinement | None = None,
        draft: DetectorFunction | None = None,
        estimate: Estimate | None = None,
        follow: Follow | None = None,
        interrupt: Callable[[], None] | None = None,
        patience: int = 0,
        contested: bool = False,
        mirrored: MirroredId | None = None,
        name: str = 'detector',
        looked_for: str = '',
        prints: Prints | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.last_search: SearchResult | None = None
        self.memory = Memory()
        # Without a refinement, centres are those of the detector.
        draft = draft if draft and refine else detector
        self._interrupt = interrupt or (lambda: None)
        self._detector = _interruptible(detector, interrupt)
        self._draft = _interruptible(draft, interrupt)
        self._settings = settings = settings or AdaptiveSettings()
        self._threads = settings.threads or os.cpu_count() or 1
        self._fusion = settings.fusion and settings.tuning.search != PUBLISHED
        if patience and not settings.genetic.patience:
            genetic = replace(settings.genetic, patience=patience)
            self._settings = replace(settings, genetic=genetic)
            self._fusion = False
        self._expected_targets = expected_targets
        self._refine = refine
        self._estimate = estimate
        self._follow = follow
        self._clock = clock
        self._contested = contested
        self._mirrored = mirrored
        self._prints = prints or {}
        self._name = name
        self._looked_for = looked_for

    def reset(self) -> None:
        """Forget what worked for earlier images."""
        self.memory = Memory()

    @property
    def expected(self) -> int:
        """N, the number of coded targets in every image; 0 where it is unknown."""
        return len(self._settings.wanted) or self._expected_targets

    @one_blas_thread()
    def seen(self, stack: ImageStack) -> list[Target]:
        """Return the targets of an image, or of the first combination, as it is received.

        It is part of no identification, and leaves nothing to the next one.
        """
        trials = self._trials(stack)
        trials.count(trials.plain[0])
        return trials.targets[trials.plain[0]]

    @deprecated_arguments(positions=('expected_targets',))
    @one_blas_thread()
    @said_once()
    def identify(
        self, image: np.ndarray | ImageStack, *, expected_targets: int | None = None
    ) -> Identification:
        """Identify the targets of one image or stack; call it from one thread at a time.

        Parameters
        ----------
        image : ndarray of uint8, uint16, float32 or float64, shape (height, width), or ImageStack
            The image as received, or several of one unmoved scene. Without N, only the most
            promising combination of a stack is looked at.
        expected_targets : int, optional
            N, the number of coded targets in this image; where None, the N of the identifier.
            Where it is 0, N is estimated; without an estimate, no filter is tried. An estimate is
            never below n of the image as received. Where the settings list the expected IDs, N is
            their number in any case. Targets with IDs other than these, or than those of the
            network, are left out, and no filter is chosen for them or against them.

        Returns
        -------
        Identification
            The result with the smallest `|N - n|`; of equally good ones the one from the image as
            received, then the first. With `fusion`, and after a search in vain, that on which this
            filter and the others agree, see `ahf_ros.identification.filtering.trials`. The
            evaluations of its filter state are the identifications that led to it; threads may
            have begun others when the right one was found.

        Raises
        ------
        ValueError
            If the image is not accepted, N is not an integer of at least 0, the detector or the
            refinement returns what `ahf_ros.base.target_check` does not accept, or the estimate
            is not an integer of at least 0.
        Exception
            Whatever the detector, the refinement or the estimate raises.
        """
        stack = image if isinstance(image, ImageStack) else ImageStack((image,))
        with kernels.shared(self._threads):
            return self._of_stack(stack, expected_targets)

    def _of_stack(self, stack: ImageStack, expected: int | None) -> Identification:
        """Identify the targets of a stack; see `identify`."""
        return self._identified(stack, self._trials(stack), expected)

    def _identified(
        self, stack: ImageStack, trials: Trials, expected_targets: int | None
    ) -> Identification:
        """Return what an image or stack shows, of which something may be known already."""
        started = self._clock()
        given = self._expected_targets if expected_targets is None else expected_targets
        _check_count('expected_targets', given)
        settings = self._settings
        listed, wanted_ids = settings.listed, settings.wanted
        expected = len(wanted_ids) or given
        estimating = not expected and self._estimate is not None
        seen = self._look_again(trials)
        threads = self._threads
        with ThreadPoolExecutor(threads) if threads > 1 else nullcontext() as executor:
            choice = self._steady(trials, executor) if estimating else None
            if choice is None:
                wanted = self._estimated(trials, executor) if estimating else expected
                choice = self._chosen(trials, wanted, executor)
        targets = trials.targets[choice.filter]
        missed = trials.discrepancy(choice.expected, choice.filter)
        fusing = self._fusion and choice.tried and missed
        if fusing:
            agreeing = dict.fromkeys([choice.filter, *trials.plain, *choice.tried])
            targets = fused([trials.targets[values] for values in agreeing])
        repeated = repeated_targets(targets)
        if not self._contested:
            targets = [it for it in targets if not _is_certain_alone(it)]
        self.last_search = choice.search
        settled = (trials.count(choice.filter), choice.expected) if estimating else None
        seen = seen or self._seen_in(trials)
        self.memory = replace(self.memory, filter=choice.remembered, settled=settled, seen=seen)
        number, gains = trials.parts(choice.filter)
        received = trials.image(choice.filter)
        if self._refine and (gains or fusing or received.dtype != np.uint8):
            targets = checked_targets(self._refine(received, targets), f'refine of {self._name}')
        state = FilterState(
            evaluations=choice.evaluations,
            generations=len(choice.search.history) if choice.search else 0,
            duration=self._clock() - started,
        )
        if gains:
            state = replace(state, applied=True, **asdict(tuned(stack.shape, gains)))
        ordered = sorted_targets(targets)
        return Identification(
            targets=tuple(ordered),
            expected=choice.expected,
            filter=state,
            estimated=estimating,
            mirrored=self._mirrored is not None
            and is_mirrored(trials.found[choice.filter], listed, self._mirrored),
            combination=stack.names[number],
            expected_ids=tuple(sorted(wanted_ids)),
            search=_trace_of(choice.search, trials, stack) if choice.search else None,
            edge_shift=median_edge_shift(ordered),
            other_ids=trials.left_out(choice.filter),
            repeated=repeated,
            looked_for=self._looked_for,
            prints=self._prints,
        )

    def _trials(self, stack: ImageStack) -> Trials:
        """Return what is known of an image or stack before it is identified: nothing."""
        return Trials(stack, self._detector, self._draft, self._settings, self._name)

    def _look_again(self, trials: Trials) -> Seen | None:
        """Note what an image shows as received if the one before it tells where to look."""
        before, alone = self.memory.seen, trials.plain == (None,)
        if not (self._follow and before and alone) or trials.found or self.memory.filter:
            return None
        image = trials.image(None)
        if image.dtype != np.uint8:
            return None
        self._interrupt()
        seen = self._follow(image, before)
        trials.know(None, checked_targets(seen.targets, self._name))
        return seen

    def _seen_in(self, trials: Trials) -> Seen | None:
        """Return what was seen in an image as received, if the next one may show it again."""
        if not self._follow or None not in trials.found:
            return None
        image = trials.image(None)
        if image.dtype != np.uint8:
            return None
        # The caller may take the next image into the same array.
        return Seen(image.copy(), tuple(trials.found[None]))

    def _chosen(self, trials: Trials, expected: int, executor: Executor | None) -> _Choice:
        """Return what shows n targets with the smallest |N - n|; N is 0 if it is unknown."""
        settings, remembered = self._settings, self._remembered(trials)
        discrepancy = partial(trials.discrepancy, expected)
        searching = settings.ahf and expected > 0
        if searching and remembered and discrepancy(remembered, executor) == 0:
            return _Choice(expected, remembered, remembered, len(trials.targets))
        plain = _best_plain(trials, expected, executor)
        kept = None if plain == trials.plain[0] else plain
        if not searching or discrepancy(plain) == 0:
            return _Choice(expected, plain, kept if searching else remembered, len(trials.targets))
        searched = trials.reduced() if settings.coarse else trials
        genes = genes_of(settings.tuning, len(trials.plain))
        initial = [remembered] if remembered and len(remembered) == len(genes) else []
        reference = math.inf
        combination = plain or ()
        count = len(genes) - len(combination)
        if settings.genetic.patience:
            initial += [(*values[:count], *combination) for values in FIRST]
            reference = searched.discrepancy(expected, plain, executor)
        elif settings.tuning.search != PUBLISHED:
            initial += [(*values, *combination) for values in BEGINNING]
        begun = self._clock()
        result = search(
            partial(searched.discrepancy, expected),
            genes,
            settings.genetic,
            np.random.default_rng(settings.genetic.seed),
            initial=initial,
            reference=reference,
            executor=executor,
            clock=self._clock,
        )
        evaluations = len(trials.plain) + len(result.tried)
        tried = result.tried
        if settings.coarse:
            tried = confirmed(expected, tried, searched, trials, executor)
            evaluations += len(tried)
        best = min(tried, key=discrepancy)
        better = discrepancy(best) < discrepancy(plain)
        return _Choice(
            expected=expected,
            filter=best if better else plain,
            remembered=best if better else kept,
            evaluations=evaluations,
            tried=tried,
            search=replace(result, duration=self._clock() - begun),
        )

    def _steady(self, trials: Trials, executor: Executor | None) -> _Choice | None:
        """Return the filter and N of the image before if it still shows the same n."""
        remembered, settled = self._remembered(trials) or trials.plain[0], self.memory.settled
        if settled and 0 < settled[0] == trials.count(remembered, executor):
            return _Choice(settled[1], remembered, remembered, 1)
        return None

    def _estimated(self, trials: Trials, executor: Executor | None) -> int:
        """Return the estimate of N, which is at least n through the filter that worked last."""
        assert self._estimate is not None
        shown = trials.count(self._remembered(trials) or trials.plain[0], executor)
        estimated = self._estimate(trials.image(trials.plain[0]))
        _check_count('estimate', estimated)
        return max(int(estimated), shown)

    def _remembered(self, trials: Trials) -> Values | None:
        """Return what worked last, None if nothing did or it does not suit these images."""
        remembered = self.memory.filter
        genes = genes_of(self._settings.tuning)
        return remembered if trials.suits(remembered, len(genes)) else None


def _is_certain_alone(target: Target) -> bool:
    """Return whether a target has no ID only because of what else is known of its image."""
    return isinstance(target, UndecodedTarget) and (target.is_contested or target.is_unsettled)


def is_mirrored(
    targets: Sequence[Target], expected: Collection[int], mirrored: MirroredId
) -> bool:
    """Return whether most IDs in an image are not expected, and most would be in a mirror.

    Every word of a family of ring codes is another word of the family in a mirror, so that a
    mirrored image shows as many targets as the original. This is known only where IDs are
    expected; `targets` has those with other IDs, too.
    """
    decoded = {target.key: target for target in targets if target.id != UNDECODED}.values()
    if not expected or len(decoded) < _MINIMUM_MIRRORED:
        return False
    direct = sum(target.id in expected for target in decoded)
    reflected = sum(mirrored(target) in expected for target in decoded)
    return 2 * direct < len(decoded) < 2 * reflected


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


def _interruptible(
    detector: DetectorFunction, interrupt: Callable[[], None] | None
) -> DetectorFunction:
    """Return a detector that calls `interrupt` first."""
    if interrupt is None:
        return detector

    def detect(image: np.ndarray) -> list[Target]:
        interrupt()
        return detector(image)

    return detect


def _check_count(name: str, count: Any) -> None:
    if isinstance(count, bool) or not isinstance(count, Integral) or count < 0:
        raise ValueError(f'{name} is {count!r}, accepted is an integer of at least 0')


def _trace_of(search: SearchResult, trials: Trials, stack: ImageStack) -> SearchTrace:
    """Return the filters of a search and their discrepancies.

    A search on the images at half their size has the filters that act alike on the whole ones.
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
        generations=search.history,
        combinations=tuple(names[number] for number, _ in parts) if names else (),
    )
