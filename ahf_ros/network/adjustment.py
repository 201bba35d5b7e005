"""Bundle adjustment: from approximate values and observations to coordinates."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ahf_ros.base.blas import one_blas_thread
from ahf_ros.base.text import counted
from ahf_ros.network import image_points
from ahf_ros.network.calibration import undetermined, unlike_given, unlike_pixels
from ahf_ros.network.camera import PARAMETERS, parameters_of
from ahf_ros.network.datum import Datum
from ahf_ros.network.deviations import failed_checks, said
from ahf_ros.network.image_points import Layout
from ahf_ros.network.knowledge import gathered, kind, knowledge
from ahf_ros.network.least_squares import Knowledge, minimise
from ahf_ros.network.network import FloatArray, IntArray, Network, check_network
from ahf_ros.network.placing import placed
from ahf_ros.network.progress import stage
from ahf_ros.network.refinement import NEEDED, agreeing, free_parameters
from ahf_ros.network.rejection import Adjusted, adjusted, rejections, relocated, tested
from ahf_ros.network.similarity import similarity_between
from ahf_ros.network.solution import NetworkState, Solution
from ahf_ros.network.suspects import examined
from ahf_ros.network.testing import CRITICAL, MISFIT

Mask = NDArray[np.bool_]
_INNER = Datum('inner')
_MISFITS = (
    'sigma0 is {:.1f}: image points fit so many times worse than their covariances say. Do not '
    'trust the coordinates before the reason is found: a wrong focal length or calibration, '
    'wrong IDs, targets that moved, or covariances that are too small'
)


def adjust(
    network: Network,
    start: NetworkState,
    datum: Datum | None = None,
    release: tuple[str, ...] | None = None,
    test: bool = True,
    *,
    backward: bool = False,
    keep_suspects: bool = False,
) -> Solution:
    """Adjust a network and return coordinates, poses and cameras with their covariances.

    A bundle adjustment [3]_ of image points and of what is known [1]_, with tests of single
    observations [2]_.

    Parameters
    ----------
    network : Network
        What was observed and is known.
    start : NetworkState
        Approximate values, in any frame and scale. Photographs and points that are NaN are no
        part of the adjustment.
    datum : Datum, optional
        The frame of the coordinates. Without one, that of control points where there are some,
        else inner constraints on all targets.
    release : tuple of str, optional
        Names of `camera.PARAMETERS` that are estimated for each camera that is not fixed, and
        nothing else is known of. Without it, all are, beside what is usual of lenses.
    test : bool
        Whether wrong image points, scale bars and control points are found and left out, and
        targets at two places. Image points are tested by each other alone.
    backward : bool
        Whether distortion is a correction at the measured place, as DBAT and PhotoModeler have it.
    keep_suspects : bool
        Whether bars and control points that contradict the photographs are used all the same.

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
    >>> from ahf_ros.network.camera import pinhole, project
    >>> from ahf_ros.network.network import CameraView, Observations
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
    >>> start = NetworkState(lens[None], np.array(rotations), positions, points + 0.01, used)
    >>> solution = adjust(network, start)
    >>> float(np.abs(solution.residuals).max()) < 1e-6
    True
    """
    check_network(network)
    if backward and any(view.equidistant for view in network.cameras):
        raise ValueError('backward is True, accepted is False for equidistant fisheye lenses')
    try:
        with one_blas_thread():
            free = free_parameters(network, PARAMETERS if release is None else release)
            lenses = start.calibrations if release is None else None
            model = _Model(network, free, lenses, backward)
            if test:
                solution = _tested(model, start, datum or Datum(), keep_suspects)
            else:
                start, datum, warnings = placed(network, start, datum or Datum())
                solution = _solution(network, model.adjusted(start, datum), warnings)
    except np.linalg.LinAlgError as error:
        raise ValueError(
            'the network is singular: the targets of a photograph, or all, lie on a line, or bars '
            'and control points without variance repeat each other'
        ) from error
    if solution.sigma0 > MISFIT:
        misfit = _MISFITS.format(solution.sigma0)
        solution = replace(solution, warnings=(*solution.warnings, misfit))
    return solution


@dataclass(frozen=True)
class _Model:
    """What is adjusted: a network, free parameters (cameras, parameters), and usual lenses."""

    network: Network
    free: Mask
    lenses: FloatArray | None
    backward: bool

    def lay_out(self, state: NetworkState, datum: Datum = _INNER) -> Layout:
        """Return the layout of the used observations."""
        control = {point.name for point in self.network.control if not point.check}
        known = np.isin(self.network.targets, list(control))
        layout = image_points.lay_out(
            self.network,
            state,
            state.used,
            self.free,
            known=known if kind(self.network, datum) == 'control' else None,
            backward=self.backward,
        )
        if not len(layout.xy):
            raise ValueError('start: nothing to adjust; ' + NEEDED)
        return layout

    def known(self, layout: Layout, datum: Datum = _INNER) -> Knowledge:
        """Return what is known beside the photographs."""
        return knowledge(layout, gathered(self.network, layout, datum, self.lenses))

    def approximate(self, state: NetworkState) -> NetworkState:
        """Return values after a robust adjustment."""
        stage(
            'robust adjustment',
            counted(int(np.isfinite(state.positions[:, 0]).sum()), 'photograph'),
        )
        layout = self.lay_out(state)
        state, _ = minimise(layout, state, self.known(layout), 'cauchy')
        state = replace(state, used=agreeing(self.network, state, layout))
        layout = self.lay_out(state)
        spread = max(1.0, image_points.robust_spread(image_points.whitened_lengths(layout, state)))
        return relocated(self.network, state, layout, CRITICAL * spread)

    def adjusted(self, state: NetworkState, datum: Datum) -> Adjusted:
        """Return the adjustment in a datum."""
        return adjusted(
            self.network,
            state,
            lambda now: self.lay_out(now, datum),
            lambda layout: self.known(layout, datum),
        )


def _tested(model: _Model, start: NetworkState, datum: Datum, keep_suspects: bool) -> Solution:
    """Return the solution: of photographs alone, then with what of the rest they believe."""
    network = model.network
    alone = replace(model, network=replace(network, bars=(), control=()))
    state = alone.approximate(start)
    images, critical = tested(alone.network, state, alone.lay_out, alone.known)
    stage('scale bars, control points and frame')
    unit = images.unit
    factor = 1.0 if unit.plausible else unit.sigma0**2
    state, first, of_known = placed(network, images.state, datum)
    rows = images.layout.points
    points = state.points[rows]
    movement = similarity_between(images.state.points[rows], points)
    covariance = movement.turned(factor * images.precision.rest[: points.size, : points.size])
    known = gathered(network, images.layout, first, checks=True)
    checked = examined(network, known, points, covariance, keep_suspects)
    state, datum, _ = placed(checked.network, images.state, datum)
    seen = network.observations
    weighted = replace(
        checked.network, observations=replace(seen, covariance=factor * seen.covariance)
    )
    stage('adjustment')
    result = replace(model, network=weighted).adjusted(state, datum)
    rejected, of_targets = rejections(network, result, critical / np.sqrt(factor))
    warnings = of_known + checked.warnings + of_targets
    solution = _solution(checked.network, result, warnings)
    failed = failed_checks(solution, checked.suspects)
    return replace(
        solution,
        sigma0=unit.sigma0,
        scaled=not unit.plausible,
        rejected=network.set_aside + rejected,
        expected_rejections=images.tails.beyond(critical) * len(images.layout.xy),
        suspects=checked.suspects + failed,
        warnings=solution.warnings + said(failed, network.unit),
    )


def _solution(network: Network, result: Adjusted, warnings: tuple[str, ...]) -> Solution:
    """Return an adjustment in the network's order."""
    layout, every, unit = result.layout, result.every, result.unit
    factor = 1.0 if unit.plausible else unit.sigma0**2
    covariance = factor * result.precision.rest
    adjusted_points = np.isin(np.arange(len(network.targets)), layout.points)
    poses = np.full((len(network.photographs), 6, 6), np.nan)
    poses[layout.photographs] = factor * result.precision.poses
    points = np.full((3 * len(network.targets),) * 2, np.nan)
    coordinates = np.flatnonzero(np.repeat(adjusted_points, 3))
    points[np.ix_(coordinates, coordinates)] = covariance[: len(coordinates), : len(coordinates)]
    residuals = np.full(network.observations.xy.shape, np.nan)
    residuals[every.observations] = image_points.residuals(every, result.state)
    normalised = np.full(len(residuals), np.nan)
    normalised[every.observations] = result.lengths / np.sqrt(factor)
    warnings += undetermined(network, layout, result.state, covariance)
    warnings += unlike_given(network, result.state.calibrations)
    warnings += unlike_pixels(network, layout, result.state, covariance)
    if not result.converged:
        warnings += ('the adjustment did not converge: its coordinates are not final',)
    used = np.zeros(len(residuals), dtype=bool)
    used[layout.observations] = True
    state = replace(
        result.state,
        calibrations=_only(result.state.calibrations, np.unique(layout.camera)),
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
        tuple(
            tuple(np.array(parameters_of(view))[mask].tolist())
            for view, mask in zip(network.cameras, layout.free, strict=True)
        ),
        poses,
        points,
        unit.sigma0,
        unit.redundancy,
        network.set_aside,
        warnings,
        scaled=not unit.plausible,
        backward=layout.backward,
        converged=result.converged,
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
