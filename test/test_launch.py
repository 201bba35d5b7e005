from __future__ import annotations

import runpy
from pathlib import Path

import pytest

launch = pytest.importorskip('launch', reason='launch is not installed')
pytest.importorskip('launch_ros', reason='launch_ros is not installed')

FOLDER = Path(__file__).parent.parent / 'launch'


@pytest.mark.parametrize(('name', 'nodes'), [('detector', 1), ('demo', 3)])
def test_a_launch_file_starts_nodes(name: str, nodes: int) -> None:
    described = runpy.run_path(str(FOLDER / f'{name}.launch.py'))['generate_launch_description']()
    packages = [getattr(entity, 'node_package', None) for entity in described.entities]
    assert packages.count('ahf_ros') == nodes
