"""The connection to a scheduler of dask.distributed, and which of its workers are fit."""

from __future__ import annotations

import asyncio
import logging
import platform
from typing import Any

from ahf_ros.batch.remote import guarded_perform
from ahf_ros.release import release
from ahf_ros.text import reason_of

CONNECTION_ERRORS = (OSError, asyncio.TimeoutError, asyncio.CancelledError, RuntimeError)
"""What calls of a client raise whose scheduler is away."""

_CONNECT = 10.0  # s in which a scheduler has to answer


def connect(address: str) -> Any:
    """Return a client of a scheduler.

    Parameters
    ----------
    address : str
        Such as tcp://host:8786.

    Raises
    ------
    ValueError
        If distributed is not installed, no scheduler answers, or it has another version.
    """
    try:
        import distributed
    except ModuleNotFoundError as error:
        raise ValueError(
            f"{error.name} is not installed, clusters need it: pip install 'ahf_ros[cluster]'"
        ) from error
    # What it logs of a scheduler that is away is said in other words.
    for name in list(logging.root.manager.loggerDict):
        if name.partition('.')[0] == 'distributed':
            logging.getLogger(name).setLevel(logging.CRITICAL)
    logging.getLogger('tornado.application').addFilter(_is_news)
    try:
        client = distributed.Client(address, timeout=_CONNECT, set_as_default=False)
    except Exception as error:  # a scheduler of another version may answer anything
        raise ValueError(
            f'scheduler is {address!r}, accepted is the address of a scheduler of '
            f'dask.distributed {distributed.__version__} that answers: {reason_of(error)}'
        ) from error
    try:
        check_version(client, address)
    except BaseException:
        client.close(timeout=1)
        raise
    return client


def refused_workers(client: Any) -> dict[str, str]:
    """Return the workers that cannot process tasks of this client, and why, by their address."""
    mine = _python(platform.python_version())
    refused = {}
    for worker, found in client.get_versions()['workers'].items():
        theirs = _python(found['host']['python'])
        if theirs != mine:
            refused[worker] = f'has Python {theirs}, accepted is {mine}'
    fit = [worker for worker in client.nthreads() if worker not in refused]
    if not fit:
        return refused
    answers = client.run(guarded_perform(), b'', '', release(), workers=fit, on_error='return')
    for worker, answer in answers.items():
        if isinstance(answer, BaseException):
            refused[worker] = f'does not work: {reason_of(answer)}'
        elif answer:
            refused[worker] = answer[1][1]
    return refused


def check_version(client: Any, address: str) -> None:
    """Refuse a scheduler of another version: pickled objects differ."""
    try:
        versions = client.get_versions()
        mine, theirs = (versions[of]['packages']['distributed'] for of in ('client', 'scheduler'))
    except Exception as error:
        raise ValueError(f'scheduler {address} cannot be asked: {reason_of(error)}') from error
    if mine != theirs:
        raise ValueError(
            f'scheduler {address} has dask.distributed {theirs}, accepted is {mine} as here'
        )


def _is_news(record: logging.LogRecord) -> bool:
    """Return whether a record is about anything but a connection that is lost or closed."""
    return not (record.exc_info and isinstance(record.exc_info[1], CONNECTION_ERRORS))


def _python(version: str) -> str:
    return '.'.join(version.split('.')[:2])
