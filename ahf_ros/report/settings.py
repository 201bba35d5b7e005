"""Settings of a report."""

from __future__ import annotations

from dataclasses import dataclass

from ahf_ros.drawing.overlay import DOUBTFUL_BELOW
from ahf_ros.settings.parameter import check_parameters, parameter


@dataclass(frozen=True, slots=True)
class ReportSettings:
    """What a report shows, and how large it may be.

    Examples
    --------
    >>> ReportSettings(max_size=20.0).doubtful_below
    0.95
    """

    title: str = parameter('', 'Title of the page; empty: the names of the results.')
    max_size: float = parameter(
        55.0,
        'Maximum size of the page, MB. Pictures are reduced to fit; results alone may take more.',
        minimum=0.1,
        maximum=2000.0,
    )
    doubtful_below: float = parameter(
        DOUBTFUL_BELOW,
        'Confidence below which an identified target counts as doubtful.',
        minimum=0.0,
        maximum=1.0,
    )
    threads: int = parameter(
        0,
        'Number of images that are read at a time; 0: one per core.',
        minimum=0,
        maximum=1024,
    )

    def __post_init__(self) -> None:
        """Check every parameter."""
        check_parameters(self)
