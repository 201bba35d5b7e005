"""The release of this package that is installed."""

from importlib.metadata import PackageNotFoundError, version


def release() -> str:
    """Return the version of the installed package, or what stands for it in a checkout."""
    try:
        return version('ahf_ros')
    except PackageNotFoundError:
        return 'not installed'
