"""One thread for BLAS, in processes that are ours.

OpenCV's threads do the pixels. Those of OpenBLAS would spin beside them between short products and
make an identification two to three times slower on two cores. It is read when numpy is loaded, so
this module has to be imported first; a value that is set already is left alone.
"""

from __future__ import annotations

import os

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
