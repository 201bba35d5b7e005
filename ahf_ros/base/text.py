"""Untrusted text, made fit for logs, terminals, JSON and messages."""

from collections.abc import Sequence

MAXIMUM_LENGTH = 300
"""Number of characters of a foreign text that are passed on."""


def printable(text: str, longest: int = MAXIMUM_LENGTH) -> str:
    r"""Return a text with everything escaped that a log or a message may not hold.

    Parameters
    ----------
    text : str
        Of any length; lone surrogates and control characters are accepted.
    longest : int
        Number of characters that are kept.

    Examples
    --------
    >>> printable('a' + chr(0xd800))
    'a\\ud800'
    """
    shown = text[:longest].encode('utf-8', 'backslashreplace').decode()
    return ''.join(it if it.isprintable() else ascii(it)[1:-1] for it in shown)


def shown(value: object) -> str:
    """Return the representation of any object, printable and of bounded length."""
    try:
        return printable(repr(value))
    except Exception:  # an object may raise anything when it describes itself
        return f'a {type(value).__name__}'


def reason_of(error: BaseException) -> str:
    """Return the type and the text of any exception, printable and of bounded length."""
    try:
        text = str(error)
    except Exception:  # an exception may have no text
        text = ''
    return printable(f'{type(error).__name__}: {text}')


def counted(number: int, noun: str) -> str:
    """Return a number of things in words.

    Examples
    --------
    >>> counted(1, 'page'), counted(2, 'page')
    ('1 page', '2 pages')
    """
    return f'{number} {noun}' + 's' * (number != 1)


def listed(names: Sequence[str], most: int = 8) -> str:
    """Return names with commas, and of long lists the number of the others.

    Examples
    --------
    >>> listed(['A', 'B'], 2), listed(['A', 'B', 'C', 'D'], 2)
    ('A, B', 'A, B and 2 more')
    """
    more = f' and {len(names) - most} more' if len(names) > most else ''
    return ', '.join(names[:most]) + more
