"""Run a command with the vector units of numpy, OpenBLAS and OpenCV cut down.

    python -m support.vector_units {baseline,avx2} COMMAND [ARGUMENT ...]

The three libraries choose their code by the processor when they are loaded, and that code rounds
differently: what is computed on one processor differs in the last bits from what is computed on
another. A test that passes natively and fails here depends on those bits.
"""

import ast
import ctypes
import os
import platform
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np

try:
    from numpy._core import _multiarray_umath as core  # type: ignore[attr-defined]
except ImportError:  # numpy 1
    from numpy.core import _multiarray_umath as core

LEVELS = ('baseline', 'avx2')
BEYOND_AVX2 = ('AVX512', 'X86_V4')
KERNELS = {
    ('x86_64', 'baseline'): 'Prescott',
    ('x86_64', 'avx2'): 'Haswell',
    ('aarch64', 'baseline'): 'ARMV8',
}
"""The kernel of OpenBLAS for a machine and a level."""

Units = dict[str, list[str]]


def active() -> Units:
    """Return what each library uses in this process."""
    return {'numpy': _numpy(), 'OpenBLAS': _openblas(), 'OpenCV': _opencv()}


def described() -> str:
    """Return one line that says what each library uses in this process."""
    return '; '.join(f'{name}: {" ".join(units) or "none"}' for name, units in active().items())


def cut_down(level: str) -> dict[str, str]:
    """Return the environment variables that leave no more than a level of vector units."""
    units = active()
    variables = {
        'NPY_DISABLE_CPU_FEATURES': ' '.join(_unwanted(units['numpy'], level)),
        'OPENCV_CPU_DISABLE': ','.join(_unwanted(units['OpenCV'], level)),
    }
    kernel = KERNELS.get((platform.machine().lower().replace('amd64', 'x86_64'), level))
    if kernel and (level == 'baseline' or core.__cpu_features__['AVX2']):
        variables['OPENBLAS_CORETYPE'] = kernel
    return variables


def check(variables: dict[str, str], before: Units, after: Units) -> None:
    """Raise RuntimeError where a variable had no effect."""
    for name, variable, separator in (
        ('numpy', 'NPY_DISABLE_CPU_FEATURES', None),
        ('OpenCV', 'OPENCV_CPU_DISABLE', ','),
    ):
        left = set(variables[variable].split(separator)) & set(after[name])
        if left:
            raise RuntimeError(f'{variable} has no effect: {name} uses {" ".join(sorted(left))}')
    kernel = variables.get('OPENBLAS_CORETYPE')
    if kernel and before['OpenBLAS'] == after['OpenBLAS'] not in ([], [kernel]):
        raise RuntimeError(f'OPENBLAS_CORETYPE has no effect: {" ".join(after["OpenBLAS"])}')


def main() -> None:
    """Cut down, say so and become the command."""
    if len(sys.argv) < 3 or sys.argv[1] not in LEVELS:
        sys.exit(__doc__)
    level, *command = sys.argv[1:]
    variables = cut_down(level)
    environment = {**os.environ, **variables}
    program = 'from support.vector_units import active; print(active())'
    printed = subprocess.check_output(
        [sys.executable, '-W', 'error::ImportWarning', '-c', program],
        env=environment,
        cwd=Path(__file__).parents[1],
        text=True,
    )
    check(variables, active(), ast.literal_eval(printed))
    print(*(f'{name}={value!r}' for name, value in variables.items()), flush=True)
    os.execvpe(command[0], command, environment)


def _unwanted(units: list[str], level: str) -> list[str]:
    if level == 'baseline':
        return units
    return [unit for unit in units if unit.startswith(BEYOND_AVX2)]


def _numpy() -> list[str]:
    """Return the features beyond the baseline that numpy has code for and uses."""
    return [name for name in core.__cpu_dispatch__ if core.__cpu_features__[name]]


def _opencv() -> list[str]:
    """Return the same of OpenCV; it marks dispatched features by * and those not in use by ?."""
    return [
        name[1:]
        for name in cv2.getCPUFeaturesLine().split()
        if name.startswith('*') and not name.endswith('?')
    ]


def _openblas() -> list[str]:
    """Return the kernel of the OpenBLAS that numpy has loaded, nothing for another BLAS."""
    maps = Path('/proc/self/maps')
    if not maps.exists():
        return []
    np.linalg.inv(np.eye(2))
    folder = str(Path(np.__file__).parents[1] / 'numpy')
    files = {line.split()[-1] for line in maps.read_text().splitlines() if 'openblas' in line}
    for file in sorted(files, key=lambda file: not file.startswith(folder)):
        library = ctypes.CDLL(file)
        for prefix in ('scipy_openblas', 'openblas'):
            for suffix in ('64_', ''):
                name = f'{prefix}_get_corename{suffix}'
                if hasattr(library, name):
                    function = getattr(library, name)
                    function.restype = ctypes.c_char_p
                    return [function().decode()]
    return []


if __name__ == '__main__':
    main()
