"""The types of keyword arguments follow the settings."""

import runpy

from support import ROOT


def test_the_types_of_options_are_current() -> None:
    script = runpy.run_path(str(ROOT / 'scripts' / 'write_options.py'))
    assert (ROOT / 'ahf_ros' / 'base' / 'options.py').read_text() == script['text'](), (
        'run scripts/write_options.py'
    )
