"""Install what the nodes of ahf_ros need on a machine without ROS 2, by pip install . ./ros.

The same CMakeLists.txt that colcon uses generates and compiles the messages, against the ROS 2
wheels that distributions.ini lists. On a ROS 2 installation, build with colcon instead; this file
is not used there.
"""

from __future__ import annotations

import atexit
import configparser
import os
import runpy
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.build_ext import build_ext

HERE = Path(__file__).resolve().parents[1]
NAME = 'ahf_ros'
DISTRIBUTION = os.environ.get('AHF_ROS_DISTRIBUTION') or 'jazzy'
SITE = Path(f'lib/python{sys.version_info[0]}.{sys.version_info[1]}/site-packages')


def wheels(purpose: str) -> list[str]:
    """Return the ROS 2 wheels of the distribution that are needed to `build` or to `run`."""
    distributions = configparser.ConfigParser()
    distributions.read(HERE / 'distributions.ini', encoding='utf-8')
    if DISTRIBUTION not in distributions:
        accepted = ', '.join(distributions.sections())
        sys.exit(f'AHF_ROS_DISTRIBUTION is {DISTRIBUTION!r}, accepted is one of {accepted}')
    return distributions[DISTRIBUTION][purpose].split()


def ros_prefix() -> Path | None:
    """Return the prefix that the ROS 2 wheels are installed in, None where there are none."""
    try:
        files = metadata.files('ros-ament-cmake-core') or []
    except metadata.PackageNotFoundError:
        return None
    marker = 'share/ament_cmake_core/package.xml'
    for file in files:
        if file.as_posix().endswith(marker):
            return Path(str(file.locate())).resolve().parents[2]
    return None


def unsourced(environment: Mapping[str, str]) -> dict[str, str]:
    """Return an environment without the Python path of a ROS installation that is sourced."""
    prefixes = [it for it in environment.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if it]
    kept = [
        path
        for path in environment.get('PYTHONPATH', '').split(os.pathsep)
        if not any(Path(path).is_relative_to(prefix) for prefix in prefixes)
    ]
    return {**environment, 'PYTHONPATH': os.pathsep.join(kept)}


def check_prerequisites() -> None:
    """End with a line for each thing that this machine lacks, before pip looks for wheels."""
    script = runpy.run_path(str(HERE / 'scripts' / 'prerequisites.py'))
    if lines := script['missing_for_nodes']():
        sys.exit('\n'.join(lines))


class CMakeBuild(build_ext):
    """Generate and compile the interfaces with CMake and put them into the wheel."""

    def initialize_options(self) -> None:
        """Start without generated files."""
        super().initialize_options()
        self.generated: list[str] = []

    def run(self) -> None:
        """Build, then hand the result to the package and to `data_files`."""
        stage = self.build_interfaces()
        data: dict[str, list[str]] = {}
        for source in sorted(stage.rglob('*')):
            relative = source.relative_to(stage)
            if not source.is_file() or relative.parts[0] not in ('lib', 'share'):
                continue
            if not relative.is_relative_to(SITE):
                # Libraries, executables and share/ go below sys.prefix, as in the ROS wheels.
                data.setdefault(str(relative.parent), []).append(str(source))
            elif self.is_generated(relative.relative_to(SITE)):
                self.place_generated(source, relative)
        self.distribution.data_files = sorted(data.items())

    def build_interfaces(self) -> Path:
        """Run CMake and return the directory that it installed into."""
        work = Path(self.build_temp).resolve() / NAME
        stage = work / 'stage'
        environment = unsourced(os.environ)
        prefix = ros_prefix()
        if prefix:
            environment['AMENT_PREFIX_PATH'] = environment['CMAKE_PREFIX_PATH'] = str(prefix)
        configure = [
            'cmake', '-S', str(HERE), '-B', str(work / 'cmake'), '-G', 'Ninja',
            '-DCMAKE_BUILD_TYPE=Release', '-DBUILD_TESTING=OFF', '-DAHF_ROS_KERNELS=OFF',
            f'-DCMAKE_INSTALL_PREFIX={stage}',
            f'-DPython3_EXECUTABLE={sys.executable}',
            f'-DPYTHON_INSTALL_DIR={SITE.as_posix()}',
        ]  # fmt: skip
        build = ['cmake', '--build', str(work / 'cmake'), '--target', 'install']
        for command in (configure, build):
            subprocess.check_call(command, env=environment)
        return stage

    def is_generated(self, module: Path) -> bool:
        """Return whether an installed file of the Python package is not one of the sources."""
        return (
            module.parts[0] == NAME
            and module.suffix in ('.py', '.pyi', '.so')
            and not (HERE / module).exists()
        )

    def place_generated(self, source: Path, relative: Path) -> None:
        """Put a generated file where the wheel has the modules of the package."""
        target = Path(self.build_lib) / relative.relative_to(SITE)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(source, target)
        self.generated.append(str(target))

    def get_outputs(self) -> list[str]:
        """Return the generated files of the package."""
        return self.generated


class BinaryDistribution(Distribution):
    """A distribution that is compiled although it lists no extension modules."""

    def has_ext_modules(self) -> bool:
        """Return True: the wheel is for one Python and one machine."""
        return True


if __name__ == '__main__':
    check_prerequisites()
    # A folder of its own each time: pip's isolated build environment has a new path, and CMake
    # would remember the old one; and two environments may be set up at once.
    scratch = tempfile.mkdtemp(prefix='ahf_ros_')
    atexit.register(shutil.rmtree, scratch, ignore_errors=True)
    setup(
        options={'build': {'build_base': scratch}, 'egg_info': {'egg_base': scratch}},
        version=ElementTree.parse(HERE / 'package.xml').findtext('version'),
        setup_requires=wheels('build'),
        install_requires=wheels('run'),
        packages=[],
        distclass=BinaryDistribution,
        cmdclass={'build_ext': CMakeBuild},
    )
