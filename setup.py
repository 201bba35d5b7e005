"""Install ahf_ros with pip: pure Python, without ROS. ros/ adds what nodes need."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

from setuptools import find_packages, setup

setup(
    version=ElementTree.parse(Path(__file__).with_name('package.xml')).findtext('version'),
    packages=find_packages(include=['ahf_ros', 'ahf_ros.*']),
    package_data={
        '': ['*.json', 'py.typed'],
        'ahf_ros.prints': ['ring_families/*'],
        'ahf_ros.files': ['html/*'],
        'ahf_ros.network.report': ['html/*'],
        'ahf_ros.views.report': ['page/*'],
    },
    # With this an editable installation is one path to the sources, new modules included.
    package_dir={'': '.'},
)
