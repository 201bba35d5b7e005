"""Looks at whether images and clouds arrive, and reports why not."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping, Sequence

from ahf_ros.nodes.cloud import ANSWER, CLOUD
from ahf_ros.nodes.diagnostics import Tally
from ahf_ros.nodes.inputs import Input
from ahf_ros.nodes.matching import Waiting
from ahf_ros.nodes.process import ProcessNode
from ahf_ros.nodes.settings import MAXIMUM_TOLERANCE
from ahf_ros.nodes.supply import other_types, several, silence

_DIGITS = re.compile(r'\d+')  # a report whose numbers alone have changed is not logged again


class Watch:
    """Keeps the part of a tally that depends on publishers and on time.

    What it reports is logged when it begins, and is in the diagnostics as long as it lasts.

    Parameters
    ----------
    node : ProcessNode
        Subscribes, and logs.
    tally : Tally
        Gets the reports.
    """

    def __init__(self, node: ProcessNode, tally: Tally) -> None:
        self._node = node
        self._tally = tally
        self._reported: frozenset[str] = frozenset()

    def look(self, images: Input, timeout: float, clouds: tuple[Input, Waiting] | None) -> None:
        """Bring the tally up to date.

        Parameters
        ----------
        images : Input
            Where images come from.
        timeout : float
            Time of waiting after which that is reported, s; 0: never.
        clouds : tuple of Input and Waiting, optional
            Where clouds come from, and what waits for its match.
        """
        tally, publishers = self._tally, images.publishers()
        reports = {
            'mistaken': other_types(images, publishers),
            'several': several(images, publishers),
            'silent': '',
            'unmatched': '',
        }
        silent = time.monotonic() - images.arrived
        if timeout and silent > timeout:
            reports['silent'] = silence(images, publishers, self._topics)
            tally.silent = f'no image for {silent:.0f} s: {reports["silent"]}'
        else:
            tally.silent = ''
        if clouds and timeout:
            reports['unmatched'] = self._unmatched(*clouds, timeout)
        tally.mistaken, tally.several = reports['mistaken'], reports['several']
        tally.lost += images.losses.newly_lost()
        tally.lost_unknown = images.losses.unknown
        if tally.clouds:
            tally.clouds.waiting = reports['unmatched']
            if clouds:
                tally.clouds.lost += clouds[0].losses.newly_lost()
        self._log(reports)

    def _unmatched(self, source: Input, waiting: Waiting, timeout: float) -> str:
        if waiting.seconds[ANSWER] <= timeout:
            return ''
        images, clouds = waiting.counts[ANSWER], waiting.counts[CLOUD]
        if not clouds:
            reason = silence(source, source.publishers(), self._topics)
            return f'{images} images wait for a cloud: {reason}'
        text = f'{images} images and {clouds} clouds wait for each other'
        if waiting.nearest > MAXIMUM_TOLERANCE * 1e9:
            return (
                f'{text}: their stamps are of different clocks, {waiting.nearest / 1e9:g} s apart'
            )
        return (
            f'{text}: the nearest stamps differ by {waiting.nearest / 1e9:g} s, '
            f'set cloud_tolerance to at least {_rounded_up(waiting.nearest) / 1e9:g}'
        )

    def _topics(self) -> Mapping[str, Sequence[str]]:
        """Return the types of the topics that others publish."""
        own = self._node.get_fully_qualified_name()
        return {
            name: kinds
            for name, kinds in self._node.get_topic_names_and_types()
            if not name.startswith(f'{own}/') and self._node.count_publishers(name)
        }

    def _log(self, reports: Mapping[str, str]) -> None:
        now = {_DIGITS.sub('', text): text for text in reports.values() if text}
        for form in sorted(now.keys() - self._reported):
            self._node.get_logger().warning(now[form])
        self._reported = frozenset(now)


def _rounded_up(nanoseconds: int) -> int:
    """Return a number of two significant digits that is not less."""
    step = 10 ** max(0, len(str(nanoseconds)) - 2)
    return -(-nanoseconds // step) * step
