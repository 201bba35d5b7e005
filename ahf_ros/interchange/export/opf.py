"""Surveys as a project in Pix4D's Open Photogrammetry Format (OPF) 1.0."""

from __future__ import annotations

import json
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

_FILES = {'camera_list': 'camera_list.json', 'input_control_points': 'input_control_points.json'}
_PROJECT = 'project.opf'


def opf_files(survey: Survey) -> dict[str, bytes]:
    """Return a project, the list of its cameras and the control points.

    Points without coordinates are manual tie points. The accuracy of a mark is its standard
    deviation, px.

    Raises
    ------
    ValueError
        If there are control points of unknown standard deviation, which the format requires.
    """
    if survey.control and not survey.sigma:
        raise ValueError('opf has a standard deviation, accepted is a control sigma above 0')
    cameras = [
        {'id': number, 'uri': Path(photograph.path).absolute().as_uri()}
        for number, photograph in enumerate(survey.photographs, start=1)
    ]
    marks: dict[str, list[dict[str, Any]]] = {label: [] for label in survey.labels}
    for number, photograph in enumerate(survey.photographs, start=1):
        for it in photograph.marks:
            marks[it.label].append(
                {'camera_id': number, 'position_px': [it.x, it.y], 'accuracy': it.sigma}
            )
    fixed, tied = [], []
    for label in survey.labels:
        point = {'id': label, 'is_checkpoint': False, 'marks': marks[label]}
        if label in survey.control:
            fixed.append({**point, 'geolocation': _geolocation(survey, label)})
        else:
            tied.append(point)
    return {
        _PROJECT: _json('project', id=_uuid('project'), name='ahf', **_items()),
        _FILES['camera_list']: _json('camera-list', cameras=cameras),
        _FILES['input_control_points']: _json('input-control-points', gcps=fixed, mtps=tied),
    }


def _geolocation(survey: Survey, label: str) -> dict[str, Any]:
    return {
        'crs': {'definition': survey.crs or LOCAL_CRS},
        'coordinates': [float(value) for value in survey.control[label]],
        'sigmas': [survey.sigma] * 3,
    }


def _items() -> dict[str, Any]:
    """Return the items of the project, each with the file that holds it."""
    items = []
    for kind, file in _FILES.items():
        resource = {'uri': file, 'format': _format(kind.replace('_', '-'))}
        items.append({'id': _uuid(kind), 'type': kind, 'resources': [resource], 'sources': []})
    items[1]['sources'] = [{'id': items[0]['id'], 'type': items[0]['type']}]
    return {'description': 'Coded targets, identified by ahf_ros', 'items': items}


def _json(kind: str, **content: Any) -> bytes:
    document = {'format': _format(kind), 'version': '1.0', **content}
    return (json.dumps(document, indent=1) + '\n').encode()


def _format(kind: str) -> str:
    return f'application/opf-{kind}+json'


def _uuid(kind: str) -> str:
    """Return an ID that is the same for the same input."""
    return str(uuid.uuid5(uuid.NAMESPACE_URL, f'ahf_ros/opf/{kind}'))
