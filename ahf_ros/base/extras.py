"""What needs a package that `pip install ahf_ros` leaves out, and how to install that."""

from importlib.util import find_spec
from typing import NamedTuple

REQUIRED = ('numpy', 'opencv-python-headless', 'rich', 'ruamel.yaml', 'threadpoolctl')
"""What the package needs without any extra, as pyproject.toml has it; colcon keeps no record."""


class Extra(NamedTuple):
    """What an extra is for, and the modules that it brings."""

    purpose: str
    modules: tuple[str, ...]


EXTRAS = {
    'bag': Extra('ahf bag', ('mcap', 'rosbags', 'zstandard')),
    'cluster': Extra('--scheduler', ('distributed',)),
    'completion': Extra('completion in the shell', ('argcomplete',)),
    'dataframe': Extra('to_dataframe', ('pandas',)),
    'heic': Extra('images of HEIC', ('pillow_heif',)),
    'orient': Extra('ahf orient and compare', ('jinja2', 'PIL', 'scipy')),
    'print': Extra('PDF of ahf targets', ('reportlab',)),
    'report': Extra('ahf report', ('jinja2',)),
    'urls': Extra('images behind URLs', ('fsspec',)),
    'video': Extra('image_transport ffmpeg', ('av',)),
}
"""The extras for users, as pyproject.toml has them."""


class MissingExtra(ModuleNotFoundError):
    """A package is not installed that an extra brings; the text says how to install it."""


def missing(extra: str, *modules: str) -> str:
    """Return what of an extra is not installed, and how to install it; empty where all is.

    `modules` restricts it to those that are needed.
    """
    purpose, brought = EXTRAS[extra]
    lost = ', '.join(name for name in modules or brought if find_spec(name) is None)
    advice = f"pip install 'ahf_ros[{extra}]'"
    return lost and f'{lost} not installed, needed for {purpose}: {advice}'


def need(extra: str, *modules: str) -> None:
    """Raise a `MissingExtra` unless all of an extra, or these of its modules, are installed."""
    if said := missing(extra, *modules):
        raise MissingExtra(said)
