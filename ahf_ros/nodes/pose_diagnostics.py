"""Diagnostics of the node `pose`."""

from __future__ import annotations

from dataclasses import dataclass, replace

from diagnostic_msgs.msg import DiagnosticStatus

from ahf_ros.nodes.diagnostics import LOSS_REMEDY, Stamps
from ahf_ros.nodes.status import status_of


@dataclass(slots=True)
class PoseTally(Stamps):
    """Counts of images since the start, and what is to be said; texts are empty if nothing is."""

    received: int = 0
    published: int = 0
    refused: int = 0  # without a pose
    reason: str = ''  # of the last of them
    ambiguous: int = 0  # with a second pose that fits about as well
    lost: int = 0  # in transport
    wrong: int = 0  # images with targets that do not agree
    rejected: str = ''  # names of the last of them, and why
    unknown: str = ''  # IDs of the last image that have no coordinates
    used: int = 0  # targets of the last pose
    sigma0: float = 0.0
    latency: float = 0.0  # from the arrival of the last message to its pose, s
    no_tf: str = ''  # why there is no tf
    rectified: str = ''  # message about images that are, or are not, rectified
    uncalibrated: str = ''  # why no camera_info arrives
    mistaken: str = ''  # message about other types on the topic
    silent: str = ''  # message about targets that do not arrive


MISFIT = 3.0
"""sigma0 from which on wrong weights alone do not explain residuals."""


class PoseDiagnostics:
    """Turns a tally into one status per period, with the rate and the level of the period."""

    def __init__(self, tally: PoseTally) -> None:
        self._tally = tally
        self._before = replace(tally)

    def status(self, period: float) -> DiagnosticStatus:
        """Return the status of the last `period` seconds."""
        tally, before = replace(self._tally), self._before
        self._before = tally
        published = tally.published - before.published
        values = {
            'rate (Hz)': f'{published / period:.2f}',
            'latency (s)': f'{tally.latency:.4f}',
            'received': tally.received,
            'published': tally.published,
            'not determined': tally.refused,
            'last reason': tally.reason,
            'ambiguous': tally.ambiguous,
            'lost in transport': tally.lost,
            'stamps that went backwards': tally.backwards,
            'images with targets left out': tally.wrong,
            'last targets left out': tally.rejected,
            'IDs without coordinates': tally.unknown,
            'targets used': tally.used,
            'sigma0': f'{tally.sigma0:.2f}',
        }
        return status_of(_reports(tally, before), f'{published} poses', values)


def _reports(tally: PoseTally, before: PoseTally) -> tuple[object, ...]:
    """Return everything that is wrong since the last status, and empty texts and zeros."""
    refused = tally.refused - before.refused
    ambiguous = tally.ambiguous - before.ambiguous
    backwards, wrong = tally.backwards - before.backwards, tally.wrong - before.wrong
    lost = tally.lost - before.lost
    misfit = tally.published > before.published and tally.sigma0 > MISFIT
    return (
        tally.mistaken,
        not tally.mistaken and tally.silent,
        tally.uncalibrated,
        refused and f'{refused} images without a pose: {tally.reason}',
        tally.no_tf,
        ambiguous and f'{ambiguous} images with a second pose that fits about as well',
        wrong and f'targets left out in {wrong} images, in the last: {tally.rejected}',
        misfit
        and f'image points fit {tally.sigma0:.0f} times worse than their covariances say: wrong '
        'calibration, camera_matrix or coordinates',
        tally.rectified,
        backwards and f'{backwards} stamps went backwards',
        lost and f'{lost} messages were lost in transport; {LOSS_REMEDY}',
    )
