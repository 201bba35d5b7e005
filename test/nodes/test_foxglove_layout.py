"""docs/foxglove_layout.json against a node that runs."""

import importlib
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from diagnostic_msgs.msg import DiagnosticArray

LAYOUT = json.loads(
    (Path(__file__).parents[2] / 'docs' / 'foxglove_layout.json').read_text(encoding='utf-8')
)
PANELS: dict[str, dict[str, Any]] = LAYOUT['configById']


def leaves(place: Any) -> list[str]:
    """Return the panels of a layout or of a part of it."""
    if isinstance(place, str):
        return [place]
    assert place['direction'] in ('row', 'column')
    return [*leaves(place['first']), *leaves(place['second'])]


def paths() -> list[str]:
    """Return what the plots show."""
    return [path['value'] for panel in PANELS.values() for path in panel.get('paths', [])]


def topics() -> Iterator[str]:
    """Return every topic that a panel shows."""
    for panel in PANELS.values():
        images = panel.get('imageMode', {})
        yield from [images['imageTopic']] if images else []
        yield from [it['topic'] for it in images.get('annotations', [])]
        yield from panel.get('topics', {})
        yield from [panel['topicToRender']] if 'topicToRender' in panel else []
    yield from [path.split('.')[0] for path in paths()]


def message_class(kind: str) -> type:
    package, *_, name = kind.split('/')
    return getattr(importlib.import_module(f'{package}.msg'), name)


def test_every_panel_has_a_place_and_settings() -> None:
    assert sorted(leaves(LAYOUT['layout'])) == sorted(PANELS)


def test_the_node_has_what_the_layout_shows(graph: Any) -> None:
    graph.start('detector', '-p', 'cloud:=true', '-p', 'always:=true')
    diagnostics = graph.listen(DiagnosticArray, '/diagnostics')
    graph.until(lambda: diagnostics)
    node = ('detector', '/')
    of_node = (
        graph.node.get_publisher_names_and_types_by_node,
        graph.node.get_subscriber_names_and_types_by_node,
    )
    kinds: dict[str, list[str]] = {}

    def seen() -> bool:
        for names_and_types in of_node:
            kinds.update(names_and_types(*node))
        return set(topics()) <= set(kinds)

    graph.until(seen)
    (annotations,) = PANELS['Image!annotated']['imageMode']['annotations']
    assert kinds[annotations['topic']] == [annotations['schemaName']]

    status = diagnostics[-1].status[0]
    shown = PANELS['DiagnosticStatusPanel!detector']
    assert (status.name, status.hardware_id) == (
        shown['selectedName'],
        shown['selectedHardwareId'],
    )
    keys = {item.key for item in status.values}
    for path in paths():
        assert set(re.findall(r'\{key=="(.*?)"\}', path)) <= keys
        topic, *fields = re.sub(r'\[:\]|\{.*?\}', '', path).split('.')
        (kind,) = kinds[topic]
        for name in fields:
            kind = message_class(kind).get_fields_and_field_types()[name]
            kind = re.sub(r'sequence<(.*)>', r'\1', kind)
        assert kind in ('uint32', 'float', 'string')  # numbers in diagnostics are texts
