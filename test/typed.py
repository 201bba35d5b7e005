"""What type checkers say of options: mypy reports each `ignore` that nothing needs."""

import numpy as np

from ahf_ros import create_detector, create_identifier, identify

image = np.zeros((9, 9), np.uint8)
identify(image, family='metashape12', min_radius=4, expected_targets=3, search='published')
create_identifier(polarity='dark', threads=1)
create_detector('ring', polarity='dark')
identify(image, expected=3)  # type: ignore[call-arg]
identify(image, min_radius='4')  # type: ignore[arg-type]
create_identifier(polarity='black')  # type: ignore[arg-type]
create_detector(threads=1)  # type: ignore[call-arg]
identify(image, 'ring')  # type: ignore[call-arg]
