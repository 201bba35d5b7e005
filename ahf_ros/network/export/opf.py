"""Surveys as a project in Pix4D's Open Photogrammetry Format (OPF) 1.0."""

import json
import math
import uuid
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ahf_ros.network.export.survey import Survey

LOCAL_CRS = (
    'ENGINEERINGCRS["local",ENGINEERINGDATUM["local"],CS[Cartesian,3],'
    'AXIS["(X)",east,ORDER[1]],AXIS["(Y)",north,ORDER[2]],AXIS["(Z)",up,ORDER[3]],'
    'LENGTHUNIT["metre",1.0]]'
)
"""Coordinate reference system of control points that come with none."""


def opf_files(survey: Survey) -> dict[str, bytes]:
    """Return a project, the list of its cameras and the control points.

    Points without coordinates are manual tie points. The accuracy of a mark is its standard
    deviation, px. The format requires the one of control points: a ValueError is raised if it is
    unknown.
    """
    if survey.control and not survey.sigma:
        raise ValueError('opf has a standard deviation, accepted is a control sigma above 0')
    cameras = []
    points: dict[str, dict[str, Any]] = {
        label: {'id': label, 'is_checkpoint': False, 'marks': []} for label in survey.labels
    }
    for number, photograph in enumerate(survey.photographs, start=1):
        cameras.append({'id': number, 'uri': Path(photograph.path).absolute().as_uri()})
        for it in photograph.marks:
            sigma = math.sqrt((it.covariance[0] + it.covariance[2]) / 2)
            points[it.label]['marks'].append(
                {'camera_id': number, 'position_px': [it.x, it.y], 'accuracy': sigma}
            )
    for label, coordinates in survey.control.items():
        points[label]['geolocation'] = {
            'crs': {'definition': survey.crs or LOCAL_CRS},
            'coordinates': [float(value) for value in coordinates],
            'sigmas': [survey.sigma] * 3,
        }
    fixed = [point for point in points.values() if 'geolocation' in point]
    tied = [point for point in points.values() if 'geolocation' not in point]
    camera_list = opf_item('camera_list')
    control = opf_item('input_control_points', sources=('camera_list',))
    return {
        'project.opf': opf_json(
            'project',
            id=opf_uuid('project'),
            name='ahf',
            description='Coded targets, identified by ahf_ros',
            items=[camera_list, control],
        ),
        'camera_list.json': opf_json('camera-list', cameras=cameras),
        'input_control_points.json': opf_json('input-control-points', gcps=fixed, mtps=tied),
    }


def opf_item(kind: str, sources: Sequence[str] = (), files: Sequence[str] = ()) -> dict[str, Any]:
    """Return an item of a project, made from others, and the files of other kinds that hold it."""
    resources = [
        {'uri': f'{name}.json', 'format': _format(name.replace('_', '-'))}
        for name in files or [kind]
    ]
    made_from = [{'id': opf_uuid(it), 'type': it} for it in sources]
    return {'id': opf_uuid(kind), 'type': kind, 'resources': resources, 'sources': made_from}


def opf_json(kind: str, **content: Any) -> bytes:
    """Return a file of a kind."""
    document = {'format': _format(kind), 'version': '1.0', **content}
    return (json.dumps(document, indent=1) + '\n').encode()


def _format(kind: str) -> str:
    return f'application/opf-{kind}+json'


def opf_uuid(kind: str) -> str:
    """Return an ID that is the same for the same input."""
    return str(uuid.uuid5(uuid.NAMESPACE_URL, f'ahf_ros/opf/{kind}'))
