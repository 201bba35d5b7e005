"""Run a node by `python -m ahf_ros.nodes NODE`, as its executable does."""

import sys

from ahf_ros.nodes.start import NODES, start

if len(sys.argv) < 2 or sys.argv[1] not in NODES:
    sys.exit(f'accepted is the name of a node: {", ".join(NODES)}')
node = sys.argv.pop(1)
sys.exit(start(node))
