"""Identification of coded photogrammetric targets under difficult light.

Everything a user needs is here; a name is imported from its module when it is first used.
"""

from importlib import import_module
from pkgutil import extend_path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ahf_ros.detectors import (
        DETECTOR_NAMES,
        FAMILY_NAMES,
        Detector,
        DetectorSettings,
        create_detector,
    )
    from ahf_ros.drawing.overlay import draw
    from ahf_ros.evaluation import score
    from ahf_ros.filtering.identifier import Identifier
    from ahf_ros.filtering.settings import AdaptiveSettings
    from ahf_ros.imaging.stack import ImageStack
    from ahf_ros.interchange.image_files import read_image, write_image
    from ahf_ros.session import create_identifier, identify
    from ahf_ros.session_settings import IdentificationSettings
    from ahf_ros.synthetic.scene import SceneSettings, render
    from ahf_ros.target import (
        UNDECODED,
        DottedTarget,
        FilterState,
        Identification,
        SearchTrace,
        SquareMarker,
        Target,
        TrueTarget,
        UndecodedTarget,
    )

# The generated messages (ahf_ros.msg, ahf_ros.srv) may live in another directory of sys.path:
# an installed copy when Python runs from a checkout, or the build tree.
__path__ = extend_path(__path__, __name__)

__all__ = [
    'DETECTOR_NAMES',
    'FAMILY_NAMES',
    'UNDECODED',
    'AdaptiveSettings',
    'Detector',
    'DetectorSettings',
    'DottedTarget',
    'FilterState',
    'Identification',
    'IdentificationSettings',
    'Identifier',
    'ImageStack',
    'SceneSettings',
    'SearchTrace',
    'SquareMarker',
    'Target',
    'TrueTarget',
    'UndecodedTarget',
    'create_detector',
    'create_identifier',
    'draw',
    'identify',
    'read_image',
    'render',
    'score',
    'write_image',
]

_MODULES = {
    'DETECTOR_NAMES': 'detectors',
    'FAMILY_NAMES': 'detectors',
    'UNDECODED': 'target',
    'AdaptiveSettings': 'filtering.settings',
    'Detector': 'detectors',
    'DetectorSettings': 'detectors',
    'DottedTarget': 'target',
    'FilterState': 'target',
    'Identification': 'target',
    'IdentificationSettings': 'session_settings',
    'Identifier': 'filtering.identifier',
    'ImageStack': 'imaging.stack',
    'SceneSettings': 'synthetic.scene',
    'SearchTrace': 'target',
    'SquareMarker': 'target',
    'Target': 'target',
    'TrueTarget': 'target',
    'UndecodedTarget': 'target',
    'create_detector': 'detectors',
    'create_identifier': 'session',
    'draw': 'drawing.overlay',
    'identify': 'session',
    'read_image': 'interchange.image_files',
    'render': 'synthetic.scene',
    'score': 'evaluation',
    'write_image': 'interchange.image_files',
}


def __getattr__(name: str) -> Any:
    """Import a public name, see PEP 562."""
    if name == '__version__':
        value = import_module(f'{__name__}.release').release()
    elif name in _MODULES:
        value = getattr(import_module(f'{__name__}.{_MODULES[name]}'), name)
    else:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return what is for users."""
    return sorted([*__all__, '__version__'])
