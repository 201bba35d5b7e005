"""Compile the kernels: `python scripts/build_kernels.py [LIBRARY] [FLAG ...]`.

`--platforms` in their place lists the platforms of wheels.

setup.py uses it, too. The compiler is that of the machine, or ziglang from PyPI where there is
none, or where the library is for another machine.
"""

from __future__ import annotations

import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[1] / 'ahf_ros' / 'kernels'
FLAGS = FOLDER / 'compile_flags.txt'
LIBRARY = FOLDER / 'kernels.bin'  # no suffix of Python's: it is no module
ZIG = 'ziglang'

TARGETS = {
    'manylinux_2_17_x86_64': 'x86_64-linux-gnu.2.17',
    'manylinux_2_17_aarch64': 'aarch64-linux-gnu.2.17',
    'musllinux_1_2_x86_64': 'x86_64-linux-musl',
    'musllinux_1_2_aarch64': 'aarch64-linux-musl',
    'macosx_11_0_x86_64': 'x86_64-macos.11.0',
    'macosx_11_0_arm64': 'aarch64-macos.11.0',
    'win_amd64': 'x86_64-windows-gnu',
    'win_arm64': 'aarch64-windows-gnu',
}
"""What zig calls the platforms of wheels."""


def own_compiler() -> list[str] | None:
    """Return the compiler of this machine, None if there is none that works."""
    command = shlex.split(os.environ.get('CC') or 'cc')
    if shutil.which(command[0]):
        answer = subprocess.run([*command, '--version'], capture_output=True)
        if not answer.returncode:
            return command
    return None


def compiler(platform: str | None) -> list[str]:
    """Return the command that compiles for a platform of wheels, or for this machine."""
    if platform is None and (command := own_compiler()):
        return command
    if importlib.util.find_spec(ZIG):
        zig = [sys.executable, '-m', ZIG, 'cc']
        # Its own choice is the units of the processor that it runs on, which others lack.
        return [*zig, *(['-target', TARGETS[platform]] if platform else ['-mcpu=baseline'])]
    sys.exit(f'The kernels cannot be compiled: pip install {ZIG}, or install a C compiler')


def build(library: Path, *flags: str, platform: str | None = None) -> None:
    """Compile a library, and put it into its place at once: others may have it open."""
    with tempfile.TemporaryDirectory(dir=library.parent, prefix='.kernels_') as scratch:
        made = Path(scratch, library.name)
        sources = sorted(map(str, FOLDER.glob('*.c')))
        link = ['-shared', '-s'] if platform else ['-shared']
        command = [*compiler(platform), f'@{FLAGS}', *link, *flags, *sources, '-o', str(made)]
        subprocess.run(command, check=True)
        made.replace(library)


if __name__ == '__main__':
    if sys.argv[1:] == ['--platforms']:
        print(*TARGETS)
        sys.exit()
    build(Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else LIBRARY, *sys.argv[2:])
