"""Names and orders of arguments that are given up: they work for one more release, and warn."""

import inspect
import warnings
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, TypeVar, cast

Function = TypeVar('Function', bound=Callable[..., Any])


def deprecated_arguments(
    positions: tuple[str, ...] = (), names: Mapping[str, str] | None = None
) -> Callable[[Function], Function]:
    """Return a decorator for functions that took arguments by position or by another name.

    Parameters
    ----------
    positions : tuple of str
        Names of what could be given by position after the arguments that still can, in order.
    names : mapping of str to str, optional
        Former names of arguments, and their names.

    Examples
    --------
    >>> @deprecated_arguments(positions=('upright',), names={'turned': 'upright'})
    ... def read(path, *, upright=False):
    ...     return path, upright
    >>> with warnings.catch_warnings(record=True) as caught:
    ...     warnings.simplefilter('always')
    ...     read('a.png', True), read('a.png', turned=True)
    (('a.png', True), ('a.png', True))
    >>> print(*(warning.message for warning in caught), sep=chr(10))
    read takes upright by keyword: upright=...
    read calls turned upright now
    """
    renamed = dict(names or {})

    def decorate(function: Function) -> Function:
        kinds = [it.kind for it in inspect.signature(function).parameters.values()]
        count = kinds.count(inspect.Parameter.POSITIONAL_OR_KEYWORD)
        called = function.__qualname__.rpartition('<locals>.')[2]

        @wraps(function)
        def call(*arguments: Any, **options: Any) -> Any:
            if count < len(arguments) <= count + len(positions):
                given = dict(zip(positions, arguments[count:], strict=False))
                if twice := given.keys() & options.keys():
                    raise TypeError(f'{called} got {", ".join(sorted(twice))} twice')
                _warn(f'{called} takes {", ".join(given)} by keyword: {next(iter(given))}=...')
                arguments, options = arguments[:count], {**given, **options}
            for old in renamed.keys() & options.keys():
                _warn(f'{called} calls {old} {renamed[old]} now')
                options[renamed[old]] = options.pop(old)
            return function(*arguments, **options)

        return cast(Function, call)

    return decorate


def _warn(text: str, level: int = 3) -> None:
    warnings.warn(text, DeprecationWarning, stacklevel=level)


def warn_of_name(owner: str, old: str, new: str) -> None:
    """Warn whoever called what called this by a name that is given up."""
    _warn(f'{owner} calls {old} {new} now', 4)
