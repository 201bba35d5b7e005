"""Agisoft Metashape behind the detector `command`. Untested, because it needs a licence.

It follows the Metashape Python Reference (Chunk.addPhotos, Chunk.detectMarkers, Marker.label,
Marker.projections). Run it with the Python that Metashape is installed in:

    ahf identify *.jpg --expected-targets 54 --detector command \
        --command 'python metashape_detector.py' --detector-timeout 300
"""

import json
import sys

import Metashape


def main(path: str) -> None:
    """Print the 12-bit targets of one image."""
    chunk = Metashape.Document().addChunk()
    chunk.addPhotos([path])
    (camera,) = chunk.cameras
    chunk.detectMarkers(target_type=Metashape.CircularTarget12bit, tolerance=50)
    targets = []
    for marker in chunk.markers:
        number = marker.label.split()[-1]  # "target 17"
        place = marker.projections[camera]
        if place is not None and number.isdigit():
            # Metashape's pixel coordinates are 0.5 in the middle of the first pixel.
            x, y = place.coord.x - 0.5, place.coord.y - 0.5
            targets.append({'id': int(number), 'x': x, 'y': y})
    print(json.dumps({'targets': targets}))


if __name__ == '__main__':
    main(sys.argv[1])
