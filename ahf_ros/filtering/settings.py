"""Settings of adaptive homomorphic filtering."""

from __future__ import annotations

from dataclasses import dataclass, field

from ahf_ros.filtering.genes import TuningSettings
from ahf_ros.filtering.genetic import GeneticSettings
from ahf_ros.filtering.homomorphic import FilterSettings
from ahf_ros.settings.parameter import check_parameters, numbers_in, parameter


@dataclass(frozen=True, slots=True)
class AdaptiveSettings:
    """Whether a filter is searched for, and how.

    The default of `max_evaluations` bounds the cost of an image of which no filter shows all N
    targets. With the extended genes, 50 filters find what 100 of the published search do
    (`benchmarks/strategies.py`).

    Examples
    --------
    >>> sorted(AdaptiveSettings(expected_ids='1-3, 7').listed)
    [1, 2, 3, 7]
    """

    ahf: bool = parameter(
        True, 'Whether to search for a filter if the image as received does not show N targets.'
    )
    expected_ids: str = parameter(
        '',
        'IDs of the coded targets in every image, such as 1-54, 60; their number is N, other '
        'IDs are left out, and doubtful targets are weighed with them.',
    )
    fusion: bool = parameter(
        False,
        'Whether to add targets that only other filters than the best one show, after a search '
        'that has not found all.',
    )
    coarse: bool = parameter(
        False,
        'Whether to search on the image at half its size and to confirm the best few filters at '
        'full size.',
    )
    threads: int = parameter(
        0,
        'Number of filters tried at the same time; 0: one per processor core. The result is the '
        'same.',
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
        """The IDs that images may show; empty if they may show any."""
        return numbers_in('expected_ids', self.expected_ids)
