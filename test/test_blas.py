"""BLAS has one thread while targets are identified, and as many as before at other times."""

from __future__ import annotations

import subprocess
import sys
import threading

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController

from ahf_ros.blas import one_blas_thread
from ahf_ros.session import create_identifier
from ahf_ros.target import Target
from support import ROOT, environment

MAXIMUM_RATIO = 1.2
"""Of the processor time with all threads of OpenBLAS at hand to that with one."""

TIMED = """
import numpy  # first, as in most programs
import time
from ahf_ros import SceneSettings, identify, render

image = render(SceneSettings(width=1200, height=900, targets=12, light='stripe')).image
times = []
for _ in range(5):
    began = time.process_time()
    identify(image, threads=1)
    times.append(time.process_time() - began)
print(min(times))
"""


def processor_time(**changes: str) -> float:
    """Return the least processor time of an identification in a new process, s."""
    variables = environment()
    variables.pop('OPENBLAS_NUM_THREADS', None)
    variables |= changes
    command = [sys.executable, '-c', TIMED]
    return float(subprocess.check_output(command, env=variables, cwd=ROOT))


def test_an_identification_takes_no_more_time_where_numpy_was_imported_first() -> None:
    # Other processes make both slower now and then, so the best of up to three runs count.
    runs = []
    for _ in range(3):
        runs.append((processor_time(), processor_time(OPENBLAS_NUM_THREADS='1')))
        threads, one = map(min, zip(*runs, strict=True))
        if threads <= MAXIMUM_RATIO * one:
            return
    pytest.fail(f'{runs} s with all threads and with one')


def blas_threads() -> set[int]:
    libraries = ThreadpoolController().select(user_api='blas').info()
    return {it['num_threads'] for it in libraries if 'opencv' not in it['filepath']}


def test_blas_has_one_thread_until_the_last_identification_has_ended() -> None:
    with ThreadpoolController().limit(limits=2, user_api='blas'):
        before = blas_threads()
        first, second = one_blas_thread(), one_blas_thread()
        with first:
            worker = threading.Thread(target=second.__enter__)
            worker.start()
            worker.join()
        assert blas_threads() <= {1}
        second.__exit__(None, None, None)
        assert blas_threads() == before


def test_any_detector_is_called_with_one_blas_thread() -> None:
    seen: set[int] = set()

    def detector(image: np.ndarray) -> list[Target]:
        seen.update(blas_threads())
        return []

    create_identifier(detector=detector).identify(np.eye(40, dtype=np.uint8))
    assert seen <= {1}
