"""Settings of adaptive homomorphic filtering."""

from dataclasses import dataclass, field

from ahf_ros.base.settings.parameter import check_parameters, numbers_in, parameter
from ahf_ros.base.text import shown

PUBLISHED, EXTENDED = 'published', 'extended'


@dataclass(frozen=True, slots=True)
class FilterSettings:
    """Input and output of the filter: the offset of the logarithm and the mapping to 8 bit."""

    log_offset: float = parameter(
        1 / 255,
        'Added to the image before the logarithm, as a fraction of its range.',
        minimum=1e-6,
        maximum=1.0,
    )
    black_percentile: float = parameter(
        0.1, 'Percentile of the filtered image that becomes black.', minimum=0.0, maximum=49.0
    )
    white_percentile: float = parameter(
        99.5, 'Percentile of the filtered image that becomes white.', minimum=51.0, maximum=100.0
    )

    def __post_init__(self) -> None:
        """Check every parameter."""
        check_parameters(self)


@dataclass(frozen=True, slots=True)
class TuningSettings:
    """Ranges of the filters that a search tries."""

    search: str = parameter(
        EXTENDED,
        'published: tunes the gains, as in the paper; extended: also tunes cut-off and output '
        'contrast.',
        choices=(EXTENDED, PUBLISHED),
    )
    gamma_high_min: float = parameter(
        1.0, 'Minimum gain of the high frequencies.', minimum=0.1, maximum=20.0
    )
    gamma_high_max: float = parameter(
        4.0, 'Maximum gain of the high frequencies.', minimum=0.1, maximum=20.0
    )
    gamma_high_step: float = parameter(
        0.1, 'Step of the gain of the high frequencies.', minimum=0.001, maximum=20.0
    )
    gamma_low_min: float = parameter(
        0.0, 'Minimum gain of the low frequencies.', minimum=0.0, maximum=20.0
    )
    gamma_low_max: float = parameter(
        1.0,
        'Maximum gain of the low frequencies, at most gamma_high_min.',
        minimum=0.0,
        maximum=20.0,
    )
    gamma_low_step: float = parameter(
        0.01, 'Step of the gain of the low frequencies.', minimum=0.001, maximum=20.0
    )
    cutoff_min: float = parameter(
        0.0625,
        'Minimum cut-off of an extended search, as a fraction of the published one, the median.',
        minimum=0.02,
        maximum=4.0,
    )
    cutoff_max: float = parameter(
        2.0,
        'Maximum cut-off of an extended search, likewise.',
        minimum=0.02,
        maximum=4.0,
    )
    exponent_min: float = parameter(
        0.125,
        'Minimum exponent of the output in an extended search; near 0 shows the logarithm.',
        minimum=0.01,
        maximum=1.0,
    )

    def __post_init__(self) -> None:
        """Check every parameter, and the ranges against each other."""
        check_parameters(self)
        for lower, upper in (
            ('gamma_high_min', 'gamma_high_max'),
            ('gamma_low_min', 'gamma_low_max'),
            ('gamma_low_max', 'gamma_high_min'),
            ('cutoff_min', 'cutoff_max'),
        ):
            value, maximum = getattr(self, lower), getattr(self, upper)
            if value > maximum:
                raise ValueError(
                    f'{lower} is {value!r}, accepted is a number of at most {upper}, {maximum!r}'
                )


@dataclass(frozen=True, slots=True)
class GeneticSettings:
    """Parameters of Table 1 of the paper, and limits.

    The paper has a population of 50. With 20, fifty filters are more than two generations, which
    find slightly more than fifty random filters.
    """

    population: int = parameter(20, 'Chromosomes per generation.', minimum=2, maximum=10000)
    generations: int = parameter(100, 'Maximum number of generations.', minimum=1, maximum=100000)
    stall: int = parameter(
        50,
        'Generations without improvement after which a search ends.',
        minimum=1,
        maximum=100000,
    )
    tournament: int = parameter(
        8,
        'Chromosomes in a tournament; the fittest becomes a parent.',
        minimum=1,
        maximum=100,
    )
    crossover: float = parameter(
        0.8,
        'Probability that two parents exchange their bits after a random position.',
        minimum=0.0,
        maximum=1.0,
    )
    mutation: float = parameter(
        0.1, 'Probability that a bit of a child flips.', minimum=0.0, maximum=1.0
    )
    max_evaluations: int = parameter(
        50, 'Maximum number of filters tried in a search; 0: no limit.', minimum=0, maximum=1000000
    )
    patience: int = parameter(
        0,
        'Filters in a row that show no more targets than before, after which a search ends; 0: '
        '2 for ring, 3 for gsi and dots, no limit for others.',
        minimum=0,
        maximum=1000000,
    )
    max_duration: float = parameter(
        0.0,
        'Time after which a search ends, s; 0: no limit. With a limit, results vary with speed.',
        minimum=0.0,
        maximum=86400.0,
    )
    seed: int = parameter(0, 'Seed of the random numbers.', minimum=0, maximum=2**31 - 1)

    def __post_init__(self) -> None:
        """Check every parameter."""
        check_parameters(self)


@dataclass(frozen=True, slots=True)
class AdaptiveSettings:
    """Whether a filter is searched for, and how.

    The default of `max_evaluations` bounds the cost of an image where no filter shows all N
    targets. With the extended genes, 50 filters find what 100 of the published search do.

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
    network_ids: str = parameter(
        '',
        'IDs that exist, such as 1-200, of which each image shows some: other IDs are left out, '
        'and doubtful targets are weighed with them, but N is not their number.',
    )
    fusion: bool = parameter(
        True,
        'Whether a search that has not found all shows the targets on which its filters agree, '
        'not those of the best one alone; not so the published search, nor one that ends with the '
        'patience of its detector.',
    )
    coarse: bool = parameter(
        False,
        'Whether to search on the image at half its size and to confirm the best few filters at '
        'full size.',
    )
    threads: int = parameter(
        0,
        'Number of filters tried at the same time, and of threads that share the work on one '
        'image; 0: one per processor core. The result is the same.',
        minimum=0,
        maximum=256,
    )
    tuning: TuningSettings = field(default_factory=TuningSettings)
    filter: FilterSettings = field(default_factory=FilterSettings)
    genetic: GeneticSettings = field(default_factory=GeneticSettings)

    def __post_init__(self) -> None:
        """Check every parameter."""
        check_parameters(self)
        if self.wanted and self.network_ids.strip():
            raise ValueError(
                f'expected_ids is {shown(self.expected_ids)} and network_ids is '
                f'{shown(self.network_ids)}, accepted is one of them: expected_ids where every '
                'image shows all, network_ids where it shows some'
            )
        numbers_in('network_ids', self.network_ids)

    @property
    def wanted(self) -> frozenset[int]:
        """The IDs that every image should show; empty if they are unknown."""
        return numbers_in('expected_ids', self.expected_ids)

    @property
    def listed(self) -> frozenset[int]:
        """The IDs that images may show; empty if they may show any."""
        return self.wanted or numbers_in('network_ids', self.network_ids)
