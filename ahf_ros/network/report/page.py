"""The page of a network: one HTML file that needs nothing else."""

from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros.files.html_pages import page_script, page_style, page_template, script_json
from ahf_ros.network.camera import parameters_of
from ahf_ros.network.points import correlations, standard_deviations
from ahf_ros.network.report.figures import enlargement, image_figure, sensor_map, views
from ahf_ros.network.report.scene import scene
from ahf_ros.network.report.summary import (
    bar_rows,
    camera_rows,
    control_rows,
    left_out,
    rejected_rows,
    summary,
    unknown_rows,
)
from ahf_ros.network.solution import Solution
from ahf_ros.network.strength import FEW_RAYS, SMALL_ANGLE, rays_of, semi_axes
from ahf_ros.network.units import decimals
from ahf_ros.network.verdict import verdict
from ahf_ros.network.views import largest_angles

_PAGE = Path(__file__).parent / 'html'
_PICTURES = 60  # photographs whose residuals are drawn: those with the largest ones
_CORRELATED = 0.7  # correlation of two parameters of a camera that is listed


def network_page(solution: Solution, title: str) -> bytes:
    """Return the page of a network; raises a `MissingExtra` without jinja2."""
    text = page_template(_PAGE, 'network.html').render(
        title=title,
        style=page_style(_PAGE, 'network.css'),
        script=page_script(_PAGE, ('network',)),
        **_content(solution),
    )
    return text.encode('utf-8', 'backslashreplace')


def _content(solution: Solution) -> dict[str, Any]:
    enlarged = enlargement(solution)
    variances = np.diagonal(solution.point_covariances, axis1=1, axis2=2)
    photographs = _photographs(solution)
    drawn = sorted(photographs, key=lambda it: -it['largest'])[:_PICTURES]
    shown = {it['index'] for it in drawn}
    space = scene(solution)
    return {
        'unit': solution.network.unit,
        'summary': summary(solution),
        'warnings': solution.warnings,
        'verdict': verdict(solution),
        'scene': {'json': script_json(space), 'enlarged': space['enlarged']},
        'views': views(solution),
        'targets': _targets(solution),
        'digits': decimals(np.sqrt(np.maximum(variances[solution.determined], 0)).ravel()),
        'photographs': photographs,
        'pictures': [
            (it['name'], image_figure(solution, it['index'], enlarged))
            for it in photographs
            if it['index'] in shown
        ],
        'enlarged': enlarged,
        'cameras': _cameras(solution, enlarged),
        'bars': bar_rows(solution),
        'control': control_rows(solution),
        'left_out': left_out(solution),
        'unknown': unknown_rows(solution),
        'rejected': rejected_rows(solution),
    }


def _targets(solution: Solution) -> list[dict[str, Any]]:
    known, rays = solution.determined, rays_of(solution)
    angles = largest_angles(solution.network, solution.state)
    axes = semi_axes(solution)
    sigmas = standard_deviations(solution.covariance_of_points).reshape(-1, 3)
    longest = np.nanmax(axes[:, 0], initial=0) or 1.0
    return [
        {
            'name': solution.network.targets[index],
            'numbers': (*solution.state.points[index], *sigmas[index], axes[index, 0]),
            'rays': int(rays[index]),
            'few': rays[index] < FEW_RAYS,
            'angle': float(np.degrees(angles[index])),
            'small': not angles[index] >= SMALL_ANGLE,
            'share': float(axes[index, 0] / longest),
        }
        for index in np.flatnonzero(known)
    ]


def _photographs(solution: Solution) -> list[dict[str, Any]]:
    network, seen = solution.network, solution.network.observations
    rows = []
    posed = solution.oriented
    for index, name in enumerate(network.photographs):
        here = seen.photograph == index
        residuals = solution.residuals[here & solution.state.used]
        lengths = np.linalg.norm(residuals, axis=1)
        rows.append(
            {
                'index': index,
                'name': name,
                'posed': bool(posed[index]),
                'camera': network.cameras[network.camera_of[index]].name,
                'used': len(residuals),
                'seen': int(here.sum()),
                'rms': float(np.sqrt((residuals**2).mean())) if len(residuals) else None,
                'largest': float(lengths.max(initial=0)),
            }
        )
    return rows


def _cameras(solution: Solution, enlarged: float) -> list[dict[str, Any]]:
    cameras = []
    for index in np.flatnonzero(solution.calibrated).tolist():
        view = solution.network.cameras[index]
        correlation = correlations(solution.camera_covariances[index])
        names = parameters_of(view)
        free = [names.index(name) for name in solution.released[index]]
        correlated = [
            (names[first], names[second], correlation[first, second])
            for place, first in enumerate(free)
            for second in free[:place]
            if abs(correlation[first, second]) > _CORRELATED
        ]
        cameras.append(
            {
                'name': view.name,
                'rows': camera_rows(solution, index),
                'correlated': correlated,
                'map': sensor_map(solution, index, 3 * enlarged),
            }
        )
    return cameras
