#!/usr/bin/env bash
# Build and test with colcon, in a workspace of its own, as on a ROS installation. make test-colcon
# runs it; the whole takes half an hour.
#
#   test/colcon.sh WORKSPACE [PYTEST OPTION ...]
#   test/colcon.sh /tmp/workspace -k nodes
#
# Where no ROS is sourced, ROS 2 comes from PyPI into WORKSPACE/venv, with colcon.
set -e
root=$(cd "$(dirname "$0")/.." && pwd)
workspace=$(mkdir -p "${1:?usage: test/colcon.sh WORKSPACE [PYTEST OPTION ...]}" && cd "$1" && pwd)
shift
export PYTEST_ADDOPTS="$*"
export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
export AHF_PHOTOS="${AHF_PHOTOS:-$root/../shared/photos}"

rm -rf "$workspace/src/ahf_ros"
mkdir -p "$workspace/src/ahf_ros"
(cd "$root" && git ls-files -z --cached --others --exclude-standard | xargs -0 tar c) |
    tar x -C "$workspace/src/ahf_ros"
cd "$workspace"

if [ -z "$ROS_DISTRO" ]; then
    if [ ! -e venv/ready ]; then
        python3 -m venv venv
        wheels=$(cd "$root" && python3 -c "
import configparser
of = configparser.ConfigParser()
of.read('distributions.ini')
print(of['jazzy']['build'], of['jazzy']['run'])")
        # shellcheck disable=SC2086
        venv/bin/pip install --quiet colcon-common-extensions cmake catkin_pkg 'empy<4' $wheels \
            "$root[test]"
        # Only what it needs: colcon builds the package itself.
        venv/bin/pip uninstall --quiet --yes ahf_ros
        touch venv/ready
    fi
    export PATH="$workspace/venv/bin:$PATH"
    export AMENT_PREFIX_PATH="$workspace/venv" CMAKE_PREFIX_PATH="$workspace/venv"
fi

underlay=$AMENT_PREFIX_PATH
colcon build --base-paths src --cmake-args -DBUILD_TESTING=ON -DAHF_ROS_ALL_TESTS=ON \
    "-DPython3_EXECUTABLE=$(command -v python3)"
. install/setup.sh
export AMENT_PREFIX_PATH="$AMENT_PREFIX_PATH:$underlay"
colcon test --base-paths src --event-handlers console_cohesion+
colcon test-result --all
