"""`fit`: coefficients or chromophores of a body from what detectors read."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from tetlux.fem.inverse.problem import FitProblem
from tetlux.fem.inverse.unknowns import Unknowns, unknowns_of
from tetlux.fem.known.split import check_lights
from tetlux.fem.media.medium import Medium
from tetlux.fem.media.region import Region, check_list_of_regions
from tetlux.fem.outcome.detector_kinds import Detector
from tetlux.fem.outcome.reading import Reading
from tetlux.fem.solve import solve
from tetlux.fem.sources.light import Light
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# The mesh is made anew once a coefficient is farther from that which it was made for than this factor.
FAR = 1.25
MOST_MESHES = 6
# Of the first mesh, for media that are only guessed.
FIRST_TOLERANCE = 0.03
# Accuracies of logarithms of unknowns, on the first mesh and on others.
ROUGH, FINE = 2e-2, 1e-3
# Unknowns end within this factor of their start.
WIDEST = 1e3
# A combination of unknowns is undetermined if its standard deviation is more than this share of the unknowns.
UNDETERMINED = 1.0
# Share of the largest component from which an unknown belongs to an undetermined combination.
BELONGS = 0.3


@dataclass(frozen=True, eq=False)
class FitResult:
    """What a fit found.

    Attributes
    ----------
    values : dict of str to float
        The unknowns.
    covariance : (u, u) ndarray
        Of the values, in their order; by the noise that was given, or by the residuals.
    residuals : (n,) ndarray
        Logarithms of readings of the model less those measured, over the noise.
    undetermined : tuple of str
        Sentences on what the readings do not tell.
    evaluations : int
        How often readings and their derivatives were computed.
    mesh : TetMesh
        The last one.
    """

    values: dict[str, float]
    covariance: FloatArray
    residuals: FloatArray
    undetermined: tuple[str, ...]
    evaluations: int
    mesh: TetMesh

    @property
    def errors(self) -> dict[str, float]:
        """Standard deviations of the values."""
        return dict(zip(self.values, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    __repr__ = one_line


def fit(
    surface: Surface,
    lights: Sequence[Light],
    detectors: Sequence[Detector],
    readings: npt.ArrayLike | Sequence[Reading] | Sequence[Sequence[Reading]],
    unknowns: Sequence[str],
    start: Medium | Mapping[str, Any],
    *,
    regions: Sequence[Region] = (),
    noise: npt.ArrayLike | None = None,
    frequency: float = 0.0,
    detector_tolerance: float = 0.005,
) -> FitResult:
    """Fit coefficients of a body to readings.

    Logarithms of readings are fitted by least squares (Levenberg and Marquardt's, Moré 1978), with the derivatives of
    `tetlux.fem.sensitivity`, on a fixed mesh. A mesh is made anew where coefficients have moved far.

    Parameters
    ----------
    surface : Surface
    lights : sequence of Light
        At least one; each has readings of its own.
    detectors : sequence of detectors
    readings : (d,), (l, d) or (c, l, d) array_like, or readings
        Measured exitance, W/unit², of each detector, light and wavelength; complex with a frequency; nan where there is
        none.
    unknowns : sequence of str
        Of the body ``"sigma_a"`` and ``"sigma_s_prime"``; of region 1 ``"1.sigma_a"`` and so on; of tissue ``"hbo2"``,
        ``"hhb"``, ``"water"``, ``"fat"``, ``"a"`` and ``"b"``. ``"gain"`` is an unknown factor of all readings.
    start : Medium, or mapping
        The medium of the body to begin with; or the arguments of `tetlux.fem.tissue`, with its wavelengths. What is not
        unknown stays as it is there.
    regions : sequence of Region
        With media to begin with, or one for each wavelength.
    noise : float or array_like, optional
        Relative standard deviation of all or of each reading. If it is not given, it is estimated by the residuals.
    frequency : float
        Of modulated light, Hz.
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
    wanted = unknowns_of(unknowns, start, regions)
    measured = _measured(readings, len(wanted.media(wanted.start)), len(lights), len(detectors))
    relative = _noise(noise, measured)
    numbers = np.isfinite(measured).sum() * (2 if np.iscomplexobj(measured) else 1)
    if len(wanted.names) > numbers:
        raise InputError(
            f"there are {len(wanted.names)} unknowns and {numbers} readings; give fewer unknowns or more readings.",
            field="unknowns",
        )
    values, tolerance, evaluations = wanted.start, max(detector_tolerance, FIRST_TOLERANCE), 0
    for _ in range(MOST_MESHES):
        mesh = _mesh(surface, wanted.media(values), lights, detectors, regions, frequency, tolerance)
        problem = FitProblem(surface, mesh, lights, detectors, regions, wanted, measured, relative, frequency)
        is_last_tolerance = tolerance <= detector_tolerance
        before, values = values, _least_squares(problem, values, ROUGH if not is_last_tolerance else FINE)
        evaluations += problem.evaluations
        if is_last_tolerance and _ratio(wanted, before, values) <= FAR:
            break
        tolerance = detector_tolerance
    return _result(problem, values, evaluations, estimate_noise=noise is None)


def _least_squares(problem: FitProblem, values: FloatArray, accuracy: float) -> FloatArray:
    """Values (u,) that fit best, from values (u,)."""
    # Imported here, since SciPy's optimizers take a tenth of the time that tetlux.fem takes to import.
    from scipy.optimize import least_squares  # noqa: PLC0415

    found = least_squares(
        problem.residuals,
        np.log(values),
        jac=problem.jacobian,
        bounds=(np.log(problem.unknowns.start / WIDEST), np.log(problem.unknowns.start * WIDEST)),
        xtol=accuracy,
        ftol=accuracy**2,
        gtol=None,
    )
    logarithms: FloatArray = np.asarray(found.x, dtype=float)
    return np.asarray(np.exp(logarithms))


def _mesh(
    surface: Surface,
    media: list[list[Medium]],
    lights: Sequence[Light],
    detectors: Sequence[Detector],
    regions: Sequence[Region],
    frequency: float,
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
    )
    mesh: TetMesh = solutions[0].mesh
    return mesh


def _ratio(unknowns: Unknowns, before: FloatArray, after: FloatArray) -> float:
    """The largest factor between coefficients by values (u,) before and after."""
    old, new = (
        np.array(
            [[medium.sigma_a, medium.reduced_scattering] for channel in unknowns.media(values) for medium in channel]
        )
        for values in (before, after)
    )
    there = (old > 0) & (new > 0)
    return float(np.exp(np.abs(np.log(new[there] / old[there])).max(initial=0.0)))


def _result(problem: FitProblem, values: FloatArray, evaluations: int, *, estimate_noise: bool) -> FitResult:
    """The result at values (u,), with what is not determined."""
    names, logarithms = problem.unknowns.names, np.log(values)
    residuals, jacobian = problem.residuals(logarithms), problem.jacobian(logarithms)
    variance = 1.0
    if estimate_noise:
        variance = float(residuals @ residuals) / max(len(residuals) - len(values), 1)
    _, sizes, ways = np.linalg.svd(jacobian, full_matrices=False)
    sizes = np.maximum(sizes, np.finfo(float).tiny ** 0.25)
    of_logarithms = (ways.T * (variance / sizes**2)) @ ways
    # Without noise given, a combination that changes no reading by a millionth of the others is undetermined.
    lost = sizes <= 1e-6 * sizes[0]
    if not estimate_noise:
        lost |= 1.0 / sizes > UNDETERMINED
    sentences = tuple(_undetermined(names, way) for way in ways[lost])
    covariance = values[:, None] * of_logarithms * values
    found = dict(zip(names, values.tolist(), strict=True))
    return FitResult(found, covariance, residuals, sentences, evaluations, problem.mesh)


def _undetermined(names: Sequence[str], way: FloatArray) -> str:
    """A sentence on a combination of unknowns (u,) that readings do not tell."""
    belong = [
        name for name, share in zip(names, np.abs(way).tolist(), strict=True) if share > BELONGS * np.abs(way).max()
    ]
    if len(belong) == 1:
        return f"the readings do not tell {belong[0]}."
    signs = "a product" if len(set(np.sign(way[[names.index(name) for name in belong]]).tolist())) == 1 else "a ratio"
    return f"the readings do not tell {' and '.join(belong)} apart: {signs} of their powers is free."


def _measured(
    readings: npt.ArrayLike | Sequence[Reading] | Sequence[Sequence[Reading]],
    channels: int,
    lights: int,
    detectors: int,
) -> NumberArray:
    """Measured readings as an array (c, l, d)."""
    rows: Any = readings
    if isinstance(rows, Sequence):
        rows = [
            each.exitance
            if isinstance(each, Reading)
            else [one.exitance if isinstance(one, Reading) else one for one in each]
            if isinstance(each, Sequence)
            else each
            for each in rows
        ]
    values = np.asarray(rows)
    if values.dtype.kind not in "iufc" or values.size != channels * lights * detectors:
        raise InputError(
            f"readings have shape {values.shape}; give {channels} x {lights} x {detectors} numbers, one for each "
            "wavelength, light and detector.",
            field="readings",
        )
    values = values.reshape(channels, lights, detectors)
    known = values[~np.isnan(values)]
    if not np.isfinite(known).all() or (known == 0 if np.iscomplexobj(values) else known <= 0).any():
        raise InputError(
            "a reading is 0 or below: that detector is in the dark; leave it out, or give nan.", field="readings"
        )
    return values


def _noise(noise: npt.ArrayLike | None, measured: NumberArray) -> FloatArray:
    """Relative standard deviations as an array (c, l, d)."""
    given = np.asarray(1.0 if noise is None else noise, dtype=float)
    if not (np.isfinite(given).all() and (given > 0).all()):
        raise InputError("noise is a relative standard deviation of readings, greater than 0.", field="noise")
    if given.size not in (1, measured.size):
        raise InputError(f"noise has shape {given.shape}; give one number, or one for each reading.", field="noise")
    shape = measured.shape
    return np.full(shape, given.item()) if given.size == 1 else given.reshape(shape)
