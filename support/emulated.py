"""Kernels on another machine: a program for it, in an emulator, repeats every call.

    python -m support.emulated

prints the program, in C. It reads calls from its standard input: the number of a kernel, and the
bytes of its parameters, those of an array after their number. It writes the arrays that are
results. `make test-aarch64` compiles and runs it.
"""

import ctypes
import subprocess
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from math import prod
from typing import Any
from unittest import mock

import numpy as np

from ahf_ros.kernels import HEADER, NUMBERS, Kernel, declared

KERNELS = declared(HEADER.read_text(encoding='utf-8'))
TYPES: dict[str, Any] = {
    'count': ctypes.c_int64,
    'rows': ctypes.c_int64,
    **{it: NUMBERS[it][1] for it in NUMBERS},
}

PROGRAM = """\
#include <stdio.h>
#include <stdlib.h>

#include "kernels.h"

static void take(void *place, size_t size)
{
    if (fread(place, 1, size, stdin) != size)
        exit(1);
}

static void *array(int64_t *size)
{
    take(size, sizeof *size);
    void *place = malloc(*size);
    take(place, *size);
    return place;
}

int main(void)
{
    for (int64_t kernel; fread(&kernel, sizeof kernel, 1, stdin); fflush(stdout))
        switch (kernel) {
CASES
        }
}
"""


def case(number: int, kernel: Kernel) -> str:
    """Return the lines of the program that call a kernel."""
    taken, given, freed = [], [], []
    for i, each in enumerate(kernel.parameters):
        if each.sides:
            taken.append(f'int64_t n{i}; void *p{i} = array(&n{i});')
            freed.append(f'free(p{i});')
            if not each.given:
                given.append(f'fwrite(p{i}, 1, n{i}, stdout);')
        else:
            taken.append(f'{each.kind} p{i}; take(&p{i}, sizeof p{i});')
    called = f'{kernel.name}({", ".join(f"p{i}" for i in range(len(kernel.parameters)))});'
    return '\n'.join([f'case {number}: {{', *taken, called, *given, *freed, 'break; }'])


@contextmanager
def repeated(command: Sequence[str], calls: Counter[str]) -> Iterator[None]:
    """Repeat every call of a kernel by a program, and count those that agree.

    A call raises an AssertionError where a bit of a result differs, but for those of NaN: IEEE 754
    leaves its sign to the processor.
    """
    native = Kernel.__dict__['_function'].func
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:

        @cache
        def both(kernel: Kernel) -> Callable[..., None]:
            function = native(kernel)

            def call(*values: Any) -> None:
                before = _bytes(kernel, values)
                function(*values)
                _compare(process, kernel, before, _bytes(kernel, values))
                calls[kernel.name] += 1

            return call

        with mock.patch.object(Kernel, '_function', property(both)):
            yield
        process.communicate()


def _bytes(kernel: Kernel, values: Sequence[Any]) -> list[bytes]:
    """Return the bytes of each parameter of a call, and in the place of an array its bytes."""
    pairs = list(zip(kernel.parameters, values, strict=True))
    counts = {each.name: value for each, value in pairs if each.is_count}
    return [
        ctypes.string_at(
            value, prod(int(counts.get(side, side)) for side in each.sides) * each.dtype.itemsize
        )
        if each.sides
        else bytes(TYPES[each.kind](value))
        for each, value in pairs
    ]


def _compare(
    process: subprocess.Popen[bytes], kernel: Kernel, before: list[bytes], after: list[bytes]
) -> None:
    assert process.stdin and process.stdout
    process.stdin.write(bytes(TYPES['count']([*KERNELS].index(kernel.name))))
    # All arrays: a kernel may leave a part of its scratch memory as it was.
    for each, data in zip(kernel.parameters, before, strict=True):
        process.stdin.write((bytes(TYPES['count'](len(data))) if each.sides else b'') + data)
    process.stdin.flush()
    results = [
        (each, np.frombuffer(data, each.dtype), process.stdout.read(len(data)))
        for each, data in zip(kernel.parameters, after, strict=True)
        if each.sides and not each.given
    ]
    for each, here, answer in results:
        there = np.frombuffer(answer, each.dtype)
        assert here.size == there.size, f'the kernel {kernel.name} ended the program'
        bits, numbers = f'u{here.itemsize}', (here == here) | (there == there)
        differ = np.flatnonzero((here.view(bits) != there.view(bits)) & numbers)
        assert not len(differ), (
            f'{each.name} of the kernel {kernel.name} is {here[differ[:3]]} here and '
            f'{there[differ[:3]]} there'
        )


if __name__ == '__main__':
    print(PROGRAM.replace('CASES', '\n'.join(case(*each) for each in enumerate(KERNELS.values()))))
