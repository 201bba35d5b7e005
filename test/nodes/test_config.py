import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize('node', ['detector', 'illumination', 'pose', 'registration'])
def test_parameter_files_are_current(node: str) -> None:
    script = runpy.run_path(str(ROOT / 'scripts' / 'write_config.py'))
    written = (ROOT / 'config' / f'{node}.yaml').read_text()
    assert written == script['configuration'](node), 'run scripts/write_config.py'
