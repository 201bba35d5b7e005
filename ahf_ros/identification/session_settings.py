"""Settings of an identification, declared once for every way in, and of the images that it is of.

The command line needs them before it knows whether it computes anything, so nothing is imported
here that does.
"""

from dataclasses import dataclass, field

from ahf_ros.base.settings.parameter import check_parameters, parameter
from ahf_ros.base.text import counted
from ahf_ros.families import AUTO, DETECTOR, DetectorSettings, detector_name, estimator
from ahf_ros.identification.filtering.settings import AdaptiveSettings
from ahf_ros.vision import MAXIMUM_IMAGES

MAXIMUM_TARGETS = 100_000
"""Maximum of N."""

TUMBLING, SLIDING = 'tumbling', 'sliding'
"""Which images of a stream are a stack: every image one of one, or each with those before it."""


@dataclass(frozen=True, slots=True)
class IdentificationSettings:
    """Settings of one identification: which targets, how many, by which detector and search.

    Attributes
    ----------
    detector : str
        One of `ahf_ros.families.DETECTOR_NAMES`, or 'auto' for the detector of the family.
    expected_targets : int
        N, the number of coded targets in every image; 0 where unknown.
    estimate_expected : bool
        Whether to estimate N where it is unknown.
    follow : int
        Images in which all of an image is searched again that has not changed; 0: every image is
        searched wholly.
    detection : DetectorSettings
        What the targets look like.
    adaptive : AdaptiveSettings
        How a filter is searched for.

    Raises
    ------
    ValueError
        If a value is not accepted or does not fit the others.

    Examples
    --------
    >>> from ahf_ros import DetectorSettings, IdentificationSettings
    >>> IdentificationSettings(detection=DetectorSettings(family='aicon14')).detector
    'auto'
    """

    detector: str = parameter(DETECTOR.default, DETECTOR.description, choices=DETECTOR.choices)
    expected_targets: int = parameter(
        0,
        'N, the number of coded targets in every image; 0: unknown, and no filter is searched for '
        'unless N is estimated.',
        minimum=0,
        maximum=MAXIMUM_TARGETS,
    )
    estimate_expected: bool = parameter(
        False,
        'Whether to estimate N where it is unknown, and to search for a filter that shows N '
        'targets.',
    )
    follow: int = parameter(
        30,
        'Images after which all that has not changed has been searched again, in parts: known '
        'targets are read again in the next image, and what changed is searched; 0: every image '
        'is searched wholly.',
        minimum=0,
        maximum=10_000,
    )
    detection: DetectorSettings = field(default_factory=DetectorSettings)
    adaptive: AdaptiveSettings = field(default_factory=AdaptiveSettings)

    def __post_init__(self) -> None:
        """Refuse values that are not accepted."""
        check_parameters(self)
        self.check_detector()
        if self.estimate_expected:
            estimator(self.detection)
        count = len(self.adaptive.wanted)
        if count and self.expected_targets not in (0, count):
            raise ValueError(
                f'expected_targets is {self.expected_targets} and expected_ids has '
                f'{counted(count, "ID")}; accepted with these is their number, or 0'
            )
        exist = len(self.adaptive.listed)
        if exist and self.expected_targets > exist:
            raise ValueError(
                f'expected_targets is {self.expected_targets} and network_ids has '
                f'{counted(exist, "ID")}; accepted with these is at most their number'
            )

    @property
    def number(self) -> int:
        """N as it is given, by a number or by IDs; 0 where it is not."""
        return self.expected_targets or len(self.adaptive.wanted)

    @property
    def settles(self) -> bool:
        """Whether images show which families are there: neither these nor a detector is named."""
        return AUTO == self.detection.family == self.detector

    def check_detector(self) -> None:
        """Refuse a detector that does not identify the family."""
        detector_name(self.detector, self.detection)


@dataclass(frozen=True, slots=True)
class StackSettings:
    """Which images are identified together.

    Examples
    --------
    >>> StackSettings(stack=4).stack_window
    'tumbling'
    """

    stack: int = parameter(
        1,
        'Number of images of an unmoved scene, lit in turn by different patterns, that are '
        'identified together; 1: every image on its own.',
        minimum=1,
        maximum=MAXIMUM_IMAGES,
    )
    stack_window: str = parameter(
        TUMBLING,
        'tumbling: each image belongs to one stack; sliding: each image is identified with those '
        'before it.',
        choices=(TUMBLING, SLIDING),
    )
    stack_movement: bool = parameter(
        True,
        'Whether to look for movement of the scene within a stack, and to split the stack there.',
    )

    def __post_init__(self) -> None:
        """Refuse values that are not accepted."""
        check_parameters(self)
