"""Run the command line by `python -m ahf_ros.cli`."""

import sys

from ahf_ros.cli import main

sys.exit(main())
