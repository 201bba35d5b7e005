"""Install ahf_ros with pip: Python and its kernels, without ROS. ros/ adds what nodes need."""

from __future__ import annotations

import os
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from setuptools import Extension, find_packages, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_ext import build_ext

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / 'scripts'))

from build_kernels import LIBRARY, TARGETS, build  # noqa: E402


class BuildKernels(build_ext):
    """Compile the kernels, which are no module of Python."""

    def get_ext_filename(self, fullname: str) -> str:
        """Return the path of the library in the package."""
        return fullname.replace('.', os.sep) + LIBRARY.suffix

    def build_extension(self, ext: Extension) -> None:
        """Compile the library, if it does not belong where the sources are."""
        if self.editable_mode:
            return
        library = Path(self.get_ext_fullpath(ext.name))
        library.parent.mkdir(parents=True, exist_ok=True)
        platform = self.plat_name.replace('-', '_').replace('.', '_')
        build(library, platform=platform if platform in TARGETS else None)

    def copy_extensions_to_source(self) -> None:
        """Compile it where the sources are, for an editable installation."""
        build(LIBRARY)


class KernelWheel(bdist_wheel):
    """A wheel for any Python on one platform."""

    def finalize_options(self) -> None:
        """Compile for the platform of the wheel."""
        super().finalize_options()
        if self.plat_name_supplied:
            self.distribution.get_command_obj('build_ext').plat_name = self.plat_name

    def get_tag(self) -> tuple[str, str, str]:
        """Return the tag of the wheel."""
        return 'py3', 'none', super().get_tag()[2]


setup(
    version=ElementTree.parse(HERE / 'package.xml').findtext('version'),
    packages=find_packages(include=['ahf_ros', 'ahf_ros.*']),
    package_data={
        '': ['*.json', 'py.typed'],
        'ahf_ros.kernels': ['kernels.h'],
        'ahf_ros.prints': ['ring_families/*'],
        'ahf_ros.files': ['html/*'],
        'ahf_ros.network.report': ['html/*'],
        'ahf_ros.views.report': ['page/*'],
    },
    include_package_data=False,  # which would warn that folders of data look like packages
    ext_modules=[Extension('ahf_ros.kernels.kernels', [])],
    cmdclass={'build_ext': BuildKernels, 'bdist_wheel': KernelWheel},
    # With this an editable installation is one path to the sources, new modules included.
    package_dir={'': '.'},
)
