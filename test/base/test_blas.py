"""BLAS has one thread while targets are identified, and as many as before at other times."""

import threading

import numpy as np
from threadpoolctl import ThreadpoolController

from ahf_ros.base.blas import one_blas_thread
from ahf_ros.base.target import Target
from ahf_ros.identification.session import create_identifier


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
