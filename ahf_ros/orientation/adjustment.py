"""Bundle adjustment: from approximate values and observations to coordinates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ahf_ros.blas import one_blas_thread
from ahf_ros.orientation import normals
from ahf_ros.orientation.calibration import released
from ahf_ros.orientation.camera import PARAMETERS
from ahf_ros.orientation.datum import Datum
from ahf_ros.orientation.knowledge import gathered, kind, knowledge
from ahf_ros.orientation.least_squares import (
    Knowledge,
    minimise,
    normal_equations,
)
from ahf_ros.orientation.network import FloatArray, IntArray, Network, Rejection, check_network
from ahf_ros.orientation.normals import Layout
from ahf_ros.orientation.placing import placed
from ahf_ros.orientation.precision import precision
from ahf_ros.orientation.refinement import NEEDED, agreeing, free_parameters
from ahf_ros.orientation.rejection import Adjusted, adjusted, rejections, relocated, tested
from ahf_ros.orientation.solution import Solution, Start
from ahf_ros.orientation.testing import CRITICAL, UnitWeight, unit_weight
from ahf_ros.orientation.zoom import zoomed

_CHECKED = 1e-6  # share of a variance that others must leave for a condition to be tested
_MISFIT = 3.0  # sigma0 that is no matter of weights
_MISFITS = (
    'sigma0 is {:.1f}: image points fit so many times worse than their covariances say. Do not '
    'trust the coordinates before the reason is found: a wrong focal length or calibration, '
    'wrong IDs, targets that moved, or covariances that are too small'
)


def adjust(
    network: Network,
    start: Start,
    datum: Datum | None = None,
    release: tuple[str, ...] | None = None,
    test: bool = True,
    *,
    backward: bool = False,
) -> Solution:
    """Adjust a network and return coordinates, poses and cameras with their covariances.

    A bundle adjustment [3]_ of image points and of what is known [1]_, with tests of single
    observations [2]_.

    Parameters
    ----------
    network : Network
        What was observed and is known.
    start : Start
        Approximate values, in any frame and scale. Photographs and points that are NaN are no
        part of the adjustment.
    datum : Datum, optional
        The frame of the coordinates. Without one, that of control points where there are some,
        else inner constraints on all targets.
    release : tuple of str, optional
        Names of `camera.PARAMETERS` that are estimated for each camera that is not fixed. Without
        it, those that the network determines are released in stages.
    test : bool
        Whether wrong observations are found and left out, and targets at two places.
    backward : bool
        Whether distortion is a correction at the measured place, as DBAT and PhotoModeler have it.

    Returns
    -------
    Solution
        Covariances are scaled by the variance of unit weight where its test refuses 1.

    Raises
    ------
    ValueError
        For observations that are not finite or have a singular covariance, for bars or control
        points that contradict each other or the photographs, for a datum without a frame, and
        where nothing is left to adjust.

    References
    ----------
    .. [1] Förstner & Wrobel, Photogrammetric Computer Vision, Springer 2016, chapter 15.
    .. [2] Baarda, A testing procedure for use in geodetic networks, 1968.
    .. [3] Triggs et al., Bundle adjustment: a modern synthesis, 2000.

    Examples
    --------
    >>> import cv2
    >>> from ahf_ros.orientation.camera import pinhole, project
    >>> from ahf_ros.orientation.network import CameraView, Observations
    >>> source = np.random.default_rng(1)
    >>> points, turns = source.uniform(-1, 1, (20, 3)), source.uniform(-0.5, 0.5, (6, 3))
    >>> rotations = [cv2.Rodrigues(turn + (0, 0, roll))[0] for roll, turn in enumerate(turns)]
    >>> lens = pinhole(1500.0, 1600, 1200)
    >>> xy = np.concatenate([project(lens, it, -5 * it[2], points) for it in rotations])
    >>> photograph, point = np.divmod(np.arange(len(xy)), len(points))
    >>> seen = Observations(photograph, point, xy, np.tile(1e-4 * np.eye(2), (len(xy), 1, 1)))
    >>> cameras = (CameraView('camera', 1600, 1200),)
    >>> names = tuple('123456'), tuple('ABCDEFGHIJKLMNOPQRST')
    >>> network = Network(names[0], np.zeros(6, int), cameras, names[1], seen)
    >>> positions = np.array([-5 * it[2] for it in rotations])
    >>> used = np.ones(len(xy), bool)
    >>> start = Start(lens[None], np.array(rotations), positions, points + 0.01, used)
    >>> solution = adjust(network, start)
    >>> float(np.abs(solution.residuals).max()) < 1e-6
    True
    """
    check_network(network)
    try:
        with one_blas_thread():
            start, datum, warnings = placed(network, start, datum or Datum())
            return _adjusted(network, start, datum, release, test, backward, warnings)
    except np.linalg.LinAlgError as error:
        raise ValueError(
            'the network is singular: the targets of a photograph, or all, lie on a line, or bars '
            'and control points without variance repeat each other'
        ) from error


def _adjusted(
    network: Network,
    start: Start,
    datum: Datum,
    release: tuple[str, ...] | None,
    test: bool,
    backward: bool,
    warnings: tuple[str, ...],
) -> Solution:
    """Return the solution from approximate values in the frame of what is known."""
    has_control = kind(network, datum) == 'control'
    known_points = np.isin(
        network.targets, [point.name for point in network.control if not point.check]
    )

    def lay_out(state: Start, free: NDArray[np.bool_]) -> Layout:
        layout = normals.lay_out(
            network,
            state,
            state.used,
            free,
            known=known_points if has_control else None,
            backward=backward,
        )
        if not len(layout.xy):
            raise ValueError('start: nothing to adjust; ' + NEEDED)
        return layout

    def known(layout: Layout) -> Knowledge:
        return knowledge(layout, gathered(network, layout, datum))

    def fit(free: NDArray[np.bool_], state: Start) -> tuple[Start, tuple[FloatArray, ...]]:
        layout = lay_out(state, free)
        fitted, _ = minimise(layout, state, known(layout), 'cauchy' if test else 'squares')
        if test:
            fitted = replace(fitted, used=agreeing(network, fitted, layout))
            layout = lay_out(fitted, free)
        covariance = precision(*normal_equations(layout, fitted, known(layout))).rest
        spread = normals.robust_spread(normals.whitened_lengths(layout, fitted))
        return fitted, _of_cameras(layout, max(1.0, spread) ** 2 * covariance)

    if release is None:
        free, state, of_cameras = released(network, start, fit)
        warnings += of_cameras
    else:
        free, state = free_parameters(network, release), start
    if test:
        state, _ = fit(free, state)
        layout = lay_out(state, free)
        warnings += zoomed(network, layout, state)
        spread = max(1.0, normals.robust_spread(normals.whitened_lengths(layout, state)))
        state = relocated(network, state, layout, spread)
        result = tested(
            network,
            state,
            lambda now: lay_out(now, free),
            known,
            lambda done: weight(done).plausible,
        )
    else:
        result = adjusted(network, state, lambda now: lay_out(now, free), known)
    return _solution(network, datum, result, warnings, test)


def weight(result: Adjusted) -> UnitWeight:
    """Return the variance of unit weight of an adjustment, with its test."""
    layout, conditions = result.layout, result.knowledge(result.state)
    lengths = normals.whitened_lengths(layout, result.state)
    unknowns = layout.unknowns + 6 * len(layout.photographs)
    redundancy = layout.xy.size + len(conditions.gaps) - unknowns
    return unit_weight(float((lengths**2).sum()) + conditions.cost, redundancy)


def _solution(
    network: Network, datum: Datum, result: Adjusted, warnings: tuple[str, ...], test: bool
) -> Solution:
    """Return an adjustment in the network's order, with what was rejected."""
    layout, every, unit = result.layout, result.every, weight(result)
    factor = 1.0 if unit.plausible else unit.sigma0**2
    covariance = factor * result.precision.rest
    adjusted_points = np.isin(np.arange(len(network.targets)), layout.points)
    poses = np.full((len(network.photographs), 6, 6), np.nan)
    poses[layout.photographs] = factor * result.precision.poses
    points = np.full((3 * len(network.targets),) * 2, np.nan)
    coordinates = np.flatnonzero(np.repeat(adjusted_points, 3))
    points[np.ix_(coordinates, coordinates)] = covariance[: len(coordinates), : len(coordinates)]
    residuals = np.full(network.observations.xy.shape, np.nan)
    residuals[every.observations] = normals.residuals(every, result.state)
    normalised = np.full(len(residuals), np.nan)
    normalised[every.observations] = result.lengths / np.sqrt(factor)
    rejected: tuple[Rejection, ...] = ()
    if test:
        rejected, of_targets = rejections(network, result)
        warnings += of_targets + doubtful(network, result, datum, np.sqrt(factor))
    if unit.sigma0 > _MISFIT:
        warnings += (_MISFITS.format(unit.sigma0),)
    if not result.converged:
        warnings += ('the adjustment did not converge: its coordinates are not final',)
    used = np.zeros(len(residuals), dtype=bool)
    used[layout.observations] = True
    state = replace(
        result.state,
        used=used,
        rotations=_only(result.state.rotations, layout.photographs),
        positions=_only(result.state.positions, layout.photographs),
        points=_only(result.state.points, layout.points),
    )
    return Solution(
        network,
        state,
        residuals,
        normalised,
        _of_cameras(layout, covariance),
        tuple(tuple(np.array(PARAMETERS)[mask].tolist()) for mask in layout.free),
        poses,
        points,
        unit.sigma0,
        unit.redundancy,
        network.set_aside + rejected,
        warnings,
        scaled=not unit.plausible,
        backward=layout.backward,
        converged=result.converged,
    )


def doubtful(network: Network, result: Adjusted, datum: Datum, sigma0: float) -> tuple[str, ...]:
    """Return warnings of bars and control points whose tests fail; they are used all the same."""
    known = gathered(network, result.layout, datum)
    names = ['scale bar ' + '-'.join(bar.ends) for bar in known.bars]
    names += [f'control point {point.name}' for point in known.control for _ in range(3)]
    conditions = result.knowledge(result.state)
    rows, gaps = conditions.rows[: len(names)], conditions.gaps[: len(names)]
    variances = conditions.variances[: len(names)]
    computed = ((rows @ result.precision.rest) * rows).sum(axis=1)
    checked = variances - computed > _CHECKED * variances
    with np.errstate(invalid='ignore', divide='ignore'):
        tests = np.abs(gaps) / np.sqrt(variances - computed) / sigma0
    failed = {
        name: f'{gap:.4g} {network.unit}'.rstrip() + f', {size:.1f} standard deviations'
        for name, gap, size, tested in zip(names, gaps, tests, checked, strict=True)
        if tested and size > CRITICAL
    }
    return tuple(
        f'{name} contradicts the rest: known minus adjusted {text}'
        for name, text in failed.items()
    )


def _of_cameras(layout: Layout, covariance: FloatArray) -> tuple[FloatArray, ...]:
    """Return the covariances (10, 10) of each camera's parameters, zero where kept fixed."""
    padded = np.pad(covariance, (0, 1))
    return tuple(padded[np.ix_(columns, columns)] for columns in layout.columns)


def _only(values: FloatArray, places: IntArray) -> FloatArray:
    """Return values with NaN outside the given places."""
    kept = np.full_like(values, np.nan)
    kept[places] = values[places]
    return kept
