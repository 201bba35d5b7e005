"""Identification of coded photogrammetric targets under difficult light.

Everything a user needs is here; a name is imported from its module when it is first used.
"""

import sys
from contextlib import suppress
from importlib import import_module
from pkgutil import extend_path
from typing import TYPE_CHECKING, Any

_MODULES = {
    'DETECTOR_NAMES': 'families',
    'FAMILY_NAMES': 'families',
    'UNDECODED': 'base.target',
    'AdaptiveSettings': 'identification.filtering.settings',
    'Detector': 'families',
    'DetectorSettings': 'families',
    'DottedTarget': 'base.target',
    'FilterState': 'base.target',
    'Identification': 'base.target',
    'IdentificationSettings': 'identification.session_settings',
    'Identifier': 'identification.filtering.identifier',
    'ImageStack': 'vision.stack',
    'SceneSettings': 'scenes.scene',
    'SearchTrace': 'base.target',
    'SquareMarker': 'base.target',
    'Target': 'base.target',
    'TrueTarget': 'base.target',
    'UndecodedTarget': 'base.target',
    'adjust': 'network.adjustment',
    'compare': 'network.congruence',
    'create_detector': 'families',
    'create_identifier': 'identification.session',
    'draw': 'views.drawing.overlay',
    'identify': 'identification.session',
    'orient': 'network.orient',
    'read_image': 'files.image_files',
    'render': 'scenes.scene',
    'resect': 'network.single_image',
    'score': 'scenes.evaluation',
    'write_image': 'files.image_files',
}

if TYPE_CHECKING:  # which takes what is imported `as` itself for public
    from ahf_ros.base.target import UNDECODED as UNDECODED
    from ahf_ros.base.target import DottedTarget as DottedTarget
    from ahf_ros.base.target import FilterState as FilterState
    from ahf_ros.base.target import Identification as Identification
    from ahf_ros.base.target import SearchTrace as SearchTrace
    from ahf_ros.base.target import SquareMarker as SquareMarker
    from ahf_ros.base.target import Target as Target
    from ahf_ros.base.target import TrueTarget as TrueTarget
    from ahf_ros.base.target import UndecodedTarget as UndecodedTarget
    from ahf_ros.families import DETECTOR_NAMES as DETECTOR_NAMES
    from ahf_ros.families import FAMILY_NAMES as FAMILY_NAMES
    from ahf_ros.families import Detector as Detector
    from ahf_ros.families import DetectorSettings as DetectorSettings
    from ahf_ros.families import create_detector as create_detector
    from ahf_ros.files.image_files import read_image as read_image
    from ahf_ros.files.image_files import write_image as write_image
    from ahf_ros.identification.filtering.identifier import Identifier as Identifier
    from ahf_ros.identification.filtering.settings import AdaptiveSettings as AdaptiveSettings
    from ahf_ros.identification.session import create_identifier as create_identifier
    from ahf_ros.identification.session import identify as identify
    from ahf_ros.identification.session_settings import (
        IdentificationSettings as IdentificationSettings,
    )
    from ahf_ros.network.adjustment import adjust as adjust
    from ahf_ros.network.congruence import compare as compare
    from ahf_ros.network.orient import orient as orient
    from ahf_ros.network.single_image import resect as resect
    from ahf_ros.scenes.evaluation import score as score
    from ahf_ros.scenes.scene import SceneSettings as SceneSettings
    from ahf_ros.scenes.scene import render as render
    from ahf_ros.views.drawing.overlay import draw as draw
    from ahf_ros.vision.stack import ImageStack as ImageStack
else:
    __all__ = list(_MODULES)

# The generated messages (ahf_ros.msg, ahf_ros.srv) may live in another directory of sys.path:
# an installed copy when Python runs from a checkout, or the build tree.
__path__ = extend_path(__path__, __name__)

with suppress(ModuleNotFoundError):  # where a build tree has the generated messages alone
    from ahf_ros.base.former import FormerModules

    sys.meta_path.append(FormerModules())


def __getattr__(name: str) -> Any:
    """Import a public name, see PEP 562."""
    if name == '__version__':
        value = import_module(f'{__name__}.base.release').release()
    elif name in _MODULES:
        value = getattr(import_module(f'{__name__}.{_MODULES[name]}'), name)
    else:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return what is for users."""
    return sorted([*_MODULES, '__version__'])
