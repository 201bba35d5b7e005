"""Surveys as a project in Pix4D's Open Photogrammetry Format (OPF) 1.0."""

from __future__ import annotations

import json
import math
import uuid
from pathlib import Path
from typing import Any

from ahf_ros.interchange.export.survey import Survey

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
    camera_list = _item('camera_list')
    control = _item('input_control_points', {'id': camera_list['id'], 'type': 'camera_list'})
    return {
        'project.opf': _json(
            'project',
            id=_uuid('project'),
            name='ahf',
            description='Coded targets, identified by ahf_ros',
            items=[camera_list, control],
        ),
        'camera_list.json': _json('camera-list', cameras=cameras),
        'input_control_points.json': _json('input-control-points', gcps=fixed, mtps=tied),
    }


def _item(kind: str, *sources: dict[str, str]) -> dict[str, Any]:
    """Return an item of the project, with the file that holds it and the items it is made from."""
    resource = {'uri': f'{kind}.json', 'format': _format(kind.replace('_', '-'))}
    return {'id': _uuid(kind), 'type': kind, 'resources': [resource], 'sources': list(sources)}


def _json(kind: str, **content: Any) -> bytes:
    document = {'format': _format(kind), 'version': '1.0', **content}
    return (json.dumps(document, indent=1) + '\n').encode()


def _format(kind: str) -> str:
    return f'application/opf-{kind}+json'


def _uuid(kind: str) -> str:
    """Return an ID that is the same for the same input."""
    return str(uuid.uuid5(uuid.NAMESPACE_URL, f'ahf_ros/opf/{kind}'))
