"""The ROS 2 nodes, and nothing but them: what they do is done by the rooms below."""

import ahf_ros.blas  # noqa: F401  before numpy
