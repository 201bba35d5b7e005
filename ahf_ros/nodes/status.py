"""The status of a node on /diagnostics."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Header

from ahf_ros.nodes.process import ProcessNode

PERIOD = 1.0
"""Period of /diagnostics, s."""


def publish_status(node: ProcessNode, what: str, status: Callable[[], DiagnosticStatus]) -> None:
    """Publish what a function returns every `PERIOD` seconds, named after the node and `what`."""
    publisher = node.publisher(DiagnosticArray, '/diagnostics', 10)
    name = f'{node.get_fully_qualified_name().lstrip("/")}: {what}'

    def publish() -> None:
        # Before the counts, so that these are no older than the stamp.
        header = Header(stamp=node.get_clock().now().to_msg())
        found = status()
        found.name = name
        publisher.publish(DiagnosticArray(header=header, status=[found]))

    node.every(PERIOD, publish)


def status_of(
    reports: Iterable[object], otherwise: str, values: Mapping[str, object]
) -> DiagnosticStatus:
    """Return a warning of all reports that are not empty; without any, the other message."""
    warning = '; '.join(str(text) for text in reports if text)
    return DiagnosticStatus(
        level=DiagnosticStatus.WARN if warning else DiagnosticStatus.OK,
        message=warning or otherwise,
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
    )
