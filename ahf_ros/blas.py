"""One BLAS thread for the processes of this package.

OpenCV uses all cores for pixels. Beside it, the threads of OpenBLAS spin between short products
and make an identification two to three times slower on two cores. Numpy reads the variable when
it is imported, so this module must come first. A value that is already set is kept.
"""

from __future__ import annotations

import os

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
