"""Identification of coded photogrammetric targets under difficult light."""

from pkgutil import extend_path

# The generated messages (ahf_ros.msg, ahf_ros.srv) may live in another directory of sys.path:
# an installed copy when Python runs from a checkout, or the build tree.
__path__ = extend_path(__path__, __name__)
