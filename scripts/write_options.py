"""Write ahf_ros/base/options.py, the types of keyword arguments, from declarations in the code."""

from __future__ import annotations

from pathlib import Path

from ahf_ros.base.settings.nested import flat_parameters
from ahf_ros.base.settings.parameter import Parameter
from ahf_ros.families import DetectorSettings
from ahf_ros.identification.session_settings import IdentificationSettings

FILE = Path(__file__).resolve().parent.parent / 'ahf_ros' / 'base' / 'options.py'
OWN = ('detector',)  # an argument of its own, which may be a function as well
HEAD = '''\
"""The types of settings that functions take by keyword; scripts/write_options.py writes them."""

from typing import Literal, TypedDict


class DetectorOptions(TypedDict, total=False):
    """Fields of `DetectorSettings`."""

'''
BETWEEN = '''

class IdentificationOptions(DetectorOptions, total=False):
    """Fields of `IdentificationSettings` and of the settings in it, except the detector."""

'''


def declaration(item: Parameter) -> str:
    """Return the line that declares a parameter."""
    kind = type(item.default).__name__
    if item.choices:
        kind = f'Literal[{", ".join(map(repr, item.choices))}]'
    return f'    {item.name}: {kind}\n'


def text() -> str:
    """Return the text of the module."""
    detection = flat_parameters(DetectorSettings)
    every = flat_parameters(IdentificationSettings)
    others = [item for item in every if item not in detection and item.name not in OWN]
    parts = (''.join(map(declaration, items)) for items in (detection, others))
    return HEAD + BETWEEN.join(parts)


if __name__ == '__main__':
    FILE.write_text(text())
