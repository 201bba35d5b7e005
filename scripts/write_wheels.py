"""Write docs/wheels.md: for which machines pip finds wheels of everything the package requires.

.venv/bin/python scripts/write_wheels.py

It asks the package index for each machine and version of Python, and takes some minutes.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from importlib import metadata
from pathlib import Path

PAGE = Path(__file__).resolve().parents[1] / 'docs' / 'wheels.md'
PYTHONS = ('3.10', '3.11', '3.12', '3.13', '3.14')
PLATFORMS = {
    'Linux x86_64 (glibc)': (
        'manylinux_2_28_x86_64',
        'manylinux_2_17_x86_64',
        'manylinux2014_x86_64',
    ),
    'Linux aarch64 (glibc)': (
        'manylinux_2_28_aarch64',
        'manylinux_2_17_aarch64',
        'manylinux2014_aarch64',
    ),
    'Linux x86_64 (musl)': ('musllinux_1_2_x86_64', 'musllinux_1_1_x86_64'),
    'macOS 14 arm64': tuple(f'macosx_{it}_0_arm64' for it in (14, 13, 12, 11)),
    'macOS 14 x86_64': (
        *(f'macosx_{it}_0_x86_64' for it in (14, 13, 12, 11)),
        'macosx_10_9_x86_64',
    ),
    'Windows amd64': ('win_amd64',),
}

HEAD = """# Where pip finds wheels

`pip install .` compiles the kernels of this package, and nothing else where its dependencies have
wheels. `make wheels` compiles them for all of these systems, on any of them. They compute the same
bits on x86-64 and on aarch64, which [a test](architecture.md#kernels) emulates.

For these machines pip was asked for them ({date}); a cell has the versions of numpy and OpenCV
that it chose, or what has no wheel there. Printed by `python scripts/write_wheels.py`.

On Alpine Linux (musl), OpenCV is a package of the system: `apk add py3-opencv`. Nothing was run on
macOS and Windows; a test takes away what only POSIX has.

"""


def requirements() -> list[str]:
    """Return what the package itself requires."""
    return [it for it in metadata.requires('ahf_ros') or () if 'extra ==' not in it]


def found(platforms: tuple[str, ...], python: str) -> str:
    """Return the versions that pip chooses for a machine, or what it does not find."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder, 'report.json')
        command = [sys.executable, '-m', 'pip', 'install', '--dry-run', '--quiet']
        command += ['--ignore-installed', '--report', str(report), '--target', folder]
        command += ['--only-binary', ':all:', '--python-version', python]
        command += [word for it in platforms for word in ('--platform', it)]
        done = subprocess.run([*command, *requirements()], capture_output=True, text=True)
        if done.returncode:
            missing = re.search(r'No matching distribution found for ([\w.-]+)', done.stderr)
            return f'no {missing[1]}' if missing else 'not found'
        chosen = {
            it['metadata']['name']: it['metadata']['version']
            for it in json.loads(report.read_text())['install']
        }
    return f'{chosen["numpy"]}, {chosen["opencv-python-headless"]}'


def main() -> None:
    """Ask for each machine and version of Python, and write the page."""
    from datetime import date

    lines = [f'| | {" | ".join(PYTHONS)} |', f'|---{"|---" * len(PYTHONS)}|']
    for name, platforms in PLATFORMS.items():
        cells = [found(platforms, python) for python in PYTHONS]
        lines.append(f'| {name} | {" | ".join(cells)} |')
        print(lines[-1], flush=True)
    text = HEAD.format(date=date.today().isoformat()) + '\n'.join([*lines, ''])
    PAGE.write_text(text, encoding='utf-8')


if __name__ == '__main__':
    main()
