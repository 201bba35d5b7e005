"""Surveys as tables: CSV, the ground control of ODM and OpenSfM, and RealityCapture."""

from collections.abc import Sequence

from ahf_ros.files.files import csv_table, text_of
from ahf_ros.network.export.survey import Mark, Survey


def csv_files(survey: Survey) -> dict[str, bytes]:
    """Return one table with a row for each mark, with its control coordinates if there are any."""
    rows: list[Sequence[object]] = [
        (
            *('image', 'label', 'id', 'family', 'x', 'y'),
            *('variance_x', 'covariance_xy', 'variance_y'),
            *('semi_major', 'semi_minor', 'angle', 'confidence'),
            *(('control_x', 'control_y', 'control_z') if survey.control else ()),
        )
    ]
    for photograph in survey.photographs:
        for mark in photograph.marks:
            of = mark.target
            found = [of.id, of.family, *_place(mark), *mark.covariance]
            shape = [of.semi_major, of.semi_minor, of.angle, of.confidence]
            point = survey.control.get(mark.label, [''] * 3) if survey.control else []
            rows.append([photograph.path, mark.label, *found, *shape, *point])
    return {'targets.csv': csv_table(rows)}


def odm_files(survey: Survey) -> dict[str, bytes]:
    """Return the ground control points of OpenDroneMap and OpenSfM.

    Each row is x, y, z, then x and y in the image, its name, and a label that is ignored.

    A ValueError is raised if there are no control points, if their coordinate reference system is
    none that the readers know, or if an image has a name with blanks, at which they split.
    """
    if not survey.control:
        raise ValueError('odm has only control points, accepted are results with control points')
    if not survey.crs.upper().startswith(('EPSG:', 'WGS84', '+PROJ')):
        raise ValueError(
            f'odm has no local coordinates, control_crs is {survey.crs!r}, accepted is EPSG:CODE, '
            'WGS84, WGS84 UTM ZONE or +proj=...'
        )
    lines = [survey.crs]
    for photograph in survey.photographs:
        if len(photograph.name.split()) != 1:
            raise ValueError(
                f'odm splits at blanks, accepted is an image without: {photograph.path!r}'
            )
        for mark in photograph.marks:
            if mark.label in survey.control:
                point = [repr(float(value)) for value in survey.control[mark.label]]
                lines.append(' '.join([*point, *_place(mark), photograph.name, mark.label]))
    return {'gcp_list.txt': text_of(lines)}


def realitycapture_files(survey: Survey) -> dict[str, bytes]:
    """Return the measurements in images and the ground control of RealityCapture."""
    rows = [
        (photograph.name, mark.label, *_place(mark))
        for photograph in survey.photographs
        for mark in photograph.marks
    ]
    files = {'control_points.csv': csv_table([('#image', 'point', 'x', 'y'), *rows])}
    if survey.control:
        ground = [(label, *map(float, point)) for label, point in survey.control.items()]
        files['ground_control.csv'] = csv_table([('#point', 'x', 'y', 'z'), *ground])
    return files


def _place(mark: Mark) -> tuple[str, str]:
    return f'{mark.x:.5f}', f'{mark.y:.5f}'
