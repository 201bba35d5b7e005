"""The options that say where tasks are processed."""

from __future__ import annotations

from ahf_ros.cli.options import Group
from ahf_ros.settings.parameter import Parameter

JOBS = Parameter(
    'jobs',
    0,
    'Number of images or stacks that are identified at the same time, each in a process of its '
    'own; 0: one per processor core, and none for fewer than 4 images, which are faster without. '
    'The result is the same.',
    minimum=0,
    maximum=256,
)


def add_scheduler_argument(parser: Group) -> None:
    """Give a parser the option that names a cluster."""
    parser.add_argument(
        '--scheduler',
        default='',
        metavar='ADDRESS',
        help='Process on the workers of this scheduler of dask.distributed, such as '
        'tcp://host:8786; files are read and written there.',
    )
