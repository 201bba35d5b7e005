"""Import the markers of markers.xml, beside this file, into the active chunk of Metashape.

Run it with Tools > Run Script. A camera is found by its label or by the name of its photograph,
with or without the extension. Markers of the same label are moved; others stay as they are.
"""

import xml.etree.ElementTree as ElementTree
from pathlib import Path, PureWindowsPath
from typing import Any


def import_markers(path: str | Path, metashape: Any) -> list[str]:
    """Import markers into the active chunk.

    Parameters
    ----------
    path : str or Path
        Markers as XML, as Metashape itself exports them.
    metashape : module
        The module of Metashape's console.

    Returns
    -------
    list of str
        Names of the cameras that the chunk does not have.
    """
    chunk = metashape.app.document.chunk
    root = ElementTree.parse(path).getroot()
    markers = _labelled_markers(root, chunk, metashape)
    names = {it.get('id'): it.get('label', '') for it in root.iterfind('chunk/cameras/camera')}
    cameras = _cameras_by_name(chunk)
    missing = set()
    for element in root.iterfind('chunk/frames/frame/markers/marker'):
        marker = markers[element.get('marker_id')]
        for location in element.iterfind('location'):
            name = names[location.get('camera_id')]
            camera = cameras.get(name) or cameras.get(PureWindowsPath(name).stem)
            if camera is None:
                missing.add(name)
                continue
            place = metashape.Vector([float(location.get(axis, 'nan')) for axis in 'xy'])
            # The second argument is whether it is pinned; Metashape knows it by its place only.
            marker.projections[camera] = metashape.Marker.Projection(place, True)
    return sorted(missing)


def _labelled_markers(root: Any, chunk: Any, metashape: Any) -> dict[str | None, Any]:
    """Return the markers of a chunk by the IDs of a document, with their coordinates."""
    markers = {marker.label: marker for marker in chunk.markers}
    by_id = {}
    for element in root.iterfind('chunk/markers/marker'):
        label = element.get('label')
        marker = markers.get(label) or chunk.addMarker()
        marker.label = label
        by_id[element.get('id')] = marker
        reference = element.find('reference')
        if reference is not None:
            place = [float(reference.get(axis, 'nan')) for axis in 'xyz']
            marker.reference.location = metashape.Vector(place)
            marker.reference.enabled = True
    return by_id


def _cameras_by_name(chunk: Any) -> dict[str, Any]:
    """Return the cameras of a chunk by label and by name of the photograph."""
    cameras: dict[str, Any] = {}
    for camera in chunk.cameras:
        paths = [camera.label] + ([camera.photo.path] if camera.photo else [])
        for path in map(PureWindowsPath, paths):  # takes both kinds of slashes
            cameras.setdefault(path.name, camera)
            cameras.setdefault(path.stem, camera)
    return cameras


def _markers_file(metashape: Any) -> Path:
    """Return markers.xml beside this file, or what the user chooses if it is not there."""
    beside = Path(globals().get('__file__', 'script')).with_name('markers.xml')
    if beside.is_file():
        return beside
    return Path(metashape.app.getOpenFileName('markers.xml'))


if __name__ == '__main__':
    import Metashape

    for missing in import_markers(_markers_file(Metashape), Metashape):
        print(f'{missing} is not in the active chunk')
