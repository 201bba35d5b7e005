"""Former places of modules: they work for one more release, and warn."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:  # the module takes longer than all others that this one needs
    from importlib.abc import Loader

_PACKAGE = 'ahf_ros.'

FORMER = {
    'advice': 'views.advice',
    'blas': 'base.blas',
    'cloud_settings': 'clouds.cloud_settings',
    'codes': 'prints',
    'codes.gsi_learning': 'families.learning.points',
    'deprecation': 'base.deprecation',
    'detectors': 'families',
    'detectors.dots.published': 'families.published.dots',
    'detectors.gsi.published': 'families.published.gsi',
    'detectors.ring.learning': 'families.learning.rings',
    'detectors.traditional': 'families.published.traditional',
    'doubt': 'base.doubt',
    'drawing': 'views.drawing',
    'drawing.coordinates': 'network.report.coordinates',
    'drawing.movements': 'network.report.movements',
    'edge_shift': 'base.edge_shift',
    'ending': 'base.ending',
    'evaluation': 'scenes.evaluation',
    'extras': 'base.extras',
    'features': 'vision',
    'filtering': 'identification.filtering',
    'imaging': 'vision',
    'imaging.headers': 'files.headers',
    'imaging.heic': 'files.heic',
    'imaging.png': 'files.png',
    'imaging.tiff': 'files.tiff',
    'imaging.whole': 'files.whole',
    'inputs': 'base.inputs',
    'interchange': 'files',
    'interchange.camera_files': 'network.files.camera_files',
    'interchange.control_files': 'network.files.control_files',
    'interchange.coordinate_files': 'network.files.coordinate_files',
    'interchange.export': 'network.export',
    'interchange.matching': 'clouds.matching',
    'interchange.network_files': 'network.files.network_files',
    'interchange.network_results': 'network.files.network_results',
    'interchange.observation_files': 'network.files.observation_files',
    'interchange.point_clouds': 'clouds.point_clouds',
    'interchange.registration_files': 'clouds.registration_files',
    'interchange.robot_files': 'network.files.robot_files',
    'localisation': 'clouds.localisation',
    'notices': 'base.notices',
    'opening': 'base.opening',
    'options': 'base.options',
    'orientation': 'network',
    'orientation.normals': 'network.image_points',
    'orientation.precision': 'network.least_squares',
    'parsed_yaml': 'base.parsed_yaml',
    'printing': 'prints.printing',
    'registration': 'clouds.registration',
    'registration_settings': 'clouds.registration_settings',
    'release': 'base.release',
    'report': 'views.report',
    'report.network_figures': 'network.report.figures',
    'report.network_page': 'network.report.page',
    'report.network_scene': 'network.report.scene',
    'report.network_summary': 'network.report.summary',
    'scans': 'clouds.scans',
    'session': 'identification.session',
    'session_settings': 'identification.session_settings',
    'settings': 'base.settings',
    'settling': 'identification.settling',
    'stream': 'identification.stream',
    'synthetic': 'scenes',
    'target': 'base.target',
    'target_check': 'base.target_check',
    'text': 'base.text',
    'writing': 'base.writing',
}
"""Former rooms and modules, and where they are now. The longest name that is there counts."""


class FormerModules:
    """Finds modules by their former names where nothing else has found them."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return how to load a former module, None if there was none of this name."""
        place = present_place(name)
        if place is None:
            return None
        return ModuleSpec(name, cast('Loader', _Loader(place)), is_package=True)


def present_place(name: str) -> str | None:
    """Return the present name of a module by its former one, None if it never had another name.

    Examples
    --------
    >>> present_place('ahf_ros.orientation.datum')
    'ahf_ros.network.datum'
    """
    former = name.removeprefix(_PACKAGE)
    while former and name.startswith(_PACKAGE):
        if former in FORMER:
            return _PACKAGE + FORMER[former] + name[len(_PACKAGE + former) :]
        former = former.rpartition('.')[0]
    return None


class _FormerModule(ModuleType):
    """A module whose names are those of another one."""

    place: str

    def __getattr__(self, name: str) -> Any:
        if name.startswith('__'):
            raise AttributeError(f'module {self.__name__!r} has no attribute {name!r}')
        value = getattr(import_module(self.place), name)
        text = f'{self.__name__} is {self.place} now; the former name goes with the next release'
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        setattr(self, name, value)
        return value


class _Loader:
    def __init__(self, place: str) -> None:
        self.place = place

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        module = _FormerModule(spec.name)
        module.place = self.place
        return module

    def exec_module(self, module: ModuleType) -> None:
        import_module(self.place)  # which fails here, and not at the first use
