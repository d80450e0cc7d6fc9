"""`fit`: coefficients or chromophores of a body, and places of lights, from what detectors read."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from tetlux.fem.inverse.parameters import FitUnknowns
from tetlux.fem.inverse.problem import FitProblem
from tetlux.fem.inverse.request import Bounds, FitRequest, Readings, Starts, make_request
from tetlux.fem.inverse.result import FitResult, result_of
from tetlux.fem.known.split import check_lights
from tetlux.fem.media.medium import Medium
from tetlux.fem.media.region import Region, check_list_of_regions
from tetlux.fem.outcome.detector_kinds import Detector
from tetlux.fem.solve import solve
from tetlux.fem.sources.light import Light
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import count
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# The mesh is made anew once a coefficient is farther from that which it was made for than this factor, or a light from
# its place there than so many mean free paths.
FAR, FAR_PLACE = 1.25, 1.0
MOST_MESHES = 6
# Of the first mesh, for media that are only guessed.
FIRST_TOLERANCE = 0.03
# Accuracies of parameters of unknowns, on the first mesh and on others.
ROUGH, FINE = 2e-2, 1e-3
# Relative error of readings by the mesh.
DETECTOR_TOLERANCE = 0.005
# Parameters begin this share of the way between their bounds away from these.
INSET = 1e-6

Report = Callable[[str], None]


def fit(
    surface: Surface,
    lights: Sequence[Light],
    detectors: Sequence[Detector],
    readings: Readings,
    unknowns: Sequence[str],
    start: Starts,
    *,
    regions: Sequence[Region] = (),
    noise: npt.ArrayLike | None = None,
    bounds: Bounds | None = None,
    frequency: float = 0.0,
    outside_index: float = 1.0,
    detector_tolerance: float = DETECTOR_TOLERANCE,
) -> FitResult:
    """Fit coefficients of a body and places of lights to readings.

    Logarithms of readings are fitted by least squares (Levenberg and Marquardt's, Moré 1978), with the derivatives of
    `tetlux.fem.sensitivity`, on a fixed mesh. A mesh is made anew where coefficients or lights have moved far.

    Parameters
    ----------
    surface : Surface
    lights : sequence of Light
        At least one; each has readings of its own.
    detectors : sequence of detectors
        Where the readings were measured.
    readings : (d,), (l, d) or (c, l, d) array_like, or sequence of Reading
        Measured exitance, W/unit², of each detector, light and wavelength; complex with a frequency; nan where there is
        none.
    unknowns : sequence of str
        Of the body ``"sigma_a"`` and ``"sigma_s_prime"``; of region 1 ``"1.sigma_a"`` and so on; of tissue ``"hbo2"``,
        ``"hhb"``, ``"water"``, ``"fat"``, ``"a"`` and ``"b"``. ``"gain"`` is an unknown factor of all readings.
        ``"light1.x"``, ``"light1.y"`` and ``"light1.z"`` are the coordinates of the first light, if it is a point, or
        of the origin of a pencil beam; they begin where the light is.
    start : Medium, mapping, or sequence of these
        The medium of the body to begin with; or the arguments of `tetlux.fem.tissue`, with its wavelengths. What is not
        unknown stays as it is there. A sequence is of the body and of each region, in place of the media of these.
    regions : sequence of Region
        With media to begin with, or one for each wavelength.
    noise : float or array_like, optional
        Relative standard deviation of all or of each reading. If it is not given, it is estimated by the residuals.
    bounds : mapping of str to (float, float), optional
        Least and largest value of unknowns; of others a thousandth and a thousand times the start, and no bounds of
        coordinates.
    frequency : float
        Of modulated light, Hz.
    outside_index : float
        Refractive index of what surrounds the body, for modulated light.
    detector_tolerance : float
        Relative error of readings by the mesh.

    Returns
    -------
    FitResult

    Raises
    ------
    InputError
        If an argument is not sensible, there are more unknowns than readings, or a detector is in the dark.
    RunError
        If the linear solver fails.

    Examples
    --------
    >>> from tetlux.fem import Medium, PencilBeam, PointDetector, fit, solve
    >>> from tetlux.meshing import sphere
    >>> ball, truth = sphere(10.0), Medium(sigma_a=0.02, sigma_s_prime=1.2, eta=1.4)
    >>> beam, there = PencilBeam((0, 0, 20), (0, 0, -1)), [PointDetector((10, 0, z)) for z in (0, 3, 6)]
    >>> read = solve(ball, truth, [beam], tolerance=None, detectors=there, detector_tolerance=0.01).readings
    >>> start = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> found = fit(ball, [beam], there, read, ["sigma_a", "sigma_s_prime"], start, detector_tolerance=0.02)
    >>> round(found.values["sigma_a"], 3), round(found.values["sigma_s_prime"], 1)
    (0.02, 1.2)
    """
    check_lights(lights)
    check_list_of_regions(regions)
    request = make_request(
        surface.unit,
        lights,
        len(detectors),
        readings,
        unknowns,
        start,
        regions=regions,
        noise=noise,
        bounds=bounds,
        frequency=frequency,
    )
    return fit_request(
        surface,
        lights,
        detectors,
        request,
        regions=regions,
        frequency=frequency,
        outside_index=outside_index,
        detector_tolerance=detector_tolerance,
    )


def fit_request(
    surface: Surface,
    lights: Sequence[Light],
    detectors: Sequence[Detector],
    request: FitRequest,
    *,
    regions: Sequence[Region],
    frequency: float,
    outside_index: float,
    detector_tolerance: float,
    report: Report = lambda _: None,
) -> FitResult:
    """Fit what a request asks for; see `fit`. `report` is called with a line for each mesh."""
    wanted = request.unknowns
    values, tolerance, evaluations = wanted.start, max(detector_tolerance, FIRST_TOLERANCE), 0
    for number in range(MOST_MESHES):
        media, placed = wanted.media(values), wanted.lights(lights, values)
        mesh = _mesh(surface, media, placed, detectors, regions, frequency, outside_index, tolerance)
        problem = FitProblem(
            surface, mesh, placed, detectors, regions, wanted, request.readings, request.noise, frequency, outside_index
        )
        is_last_tolerance = tolerance <= detector_tolerance
        before, values = values, _least_squares(problem, request, values, FINE if is_last_tolerance else ROUGH)
        evaluations += problem.evaluations
        found = ", ".join(f"{name} {value:.4g}" for name, value in zip(wanted.names, values.tolist(), strict=True))
        size = count(len(mesh.tetrahedra), "tetrahedron", "tetrahedra")
        report(f"fitted on mesh {number + 1}, {size}, by {count(problem.evaluations, 'evaluation')}: {found}")
        if is_last_tolerance and not _is_far(wanted, before, values):
            break
        tolerance = detector_tolerance
    return result_of(problem, request, values, evaluations)


def _least_squares(problem: FitProblem, request: FitRequest, values: FloatArray, accuracy: float) -> FloatArray:
    """Values (u,) that fit best, from values (u,)."""
    # Imported here, since SciPy's optimizers take a tenth of the time that tetlux.fem takes to import.
    from scipy.optimize import least_squares  # noqa: PLC0415

    unknowns, limits = problem.unknowns, request.bounds.T
    low, high = (unknowns.parameters(limit) for limit in limits)
    found = least_squares(
        problem.residuals,
        _within(unknowns.parameters(values), low, high),
        jac=problem.jacobian,
        bounds=(low, high),
        xtol=accuracy,
        ftol=accuracy**2,
        gtol=None,
    )
    return unknowns.values(np.asarray(found.x, dtype=float))


def _within(parameters: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Parameters (u,) moved strictly within bounds (u,), as the optimizer begins."""
    inset = np.where(np.isfinite(high - low), INSET * (high - low), 0.0)
    return np.asarray(np.clip(parameters, low + inset, high - inset))


def _mesh(
    surface: Surface,
    media: list[list[Medium]],
    lights: Sequence[Light],
    detectors: Sequence[Detector],
    regions: Sequence[Region],
    frequency: float,
    outside_index: float,
    tolerance: float,
) -> TetMesh:
    """A mesh that is fine enough for all detectors and channels of media."""
    inner = [replace(region, medium=[channel[n] for channel in media]) for n, region in enumerate(regions, 1)]
    solutions = solve(
        surface,
        [channel[0] for channel in media],
        lights,
        regions=inner,
        tolerance=None,
        detectors=detectors,
        detector_tolerance=tolerance,
        frequency=frequency,
        outside_index=outside_index,
    )
    mesh: TetMesh = solutions[0].mesh
    return mesh


def _is_far(unknowns: FitUnknowns, before: FloatArray, after: FloatArray) -> bool:
    """Whether coefficients or lights are far away from one another by values (u,) before and after."""
    media, moved = unknowns.media(after), ~unknowns.positive
    if moved.any() and np.abs(after - before)[moved].max() > FAR_PLACE * media[0][0].mean_free_path:
        return True
    old, new = (
        np.array([[medium.sigma_a, medium.reduced_scattering] for channel in each for medium in channel])
        for each in (unknowns.media(before), media)
    )
    there = (old > 0) & (new > 0)
    return bool(np.abs(np.log(new[there] / old[there])).max(initial=0.0) > np.log(FAR))
