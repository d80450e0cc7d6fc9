"""`FitResult`: values with their covariance, and what readings do not tell."""

from dataclasses import dataclass

import numpy as np

from tetlux.fem.inverse.parameters import FitUnknowns
from tetlux.fem.inverse.problem import FitProblem
from tetlux.fem.inverse.request import FitRequest
from tetlux.fem.media.medium import Medium
from tetlux.fem.sources.light import Light
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.mesh import TetMesh

# A combination of unknowns is undetermined if its standard deviation is more than this share of the unknowns, or of a
# decay length.
UNDETERMINED = 1.0
# Without noise given it is if it changes no reading by this share of what others change.
UNSEEN = 1e-6
# Share of the largest component from which an unknown belongs to an undetermined combination.
BELONGS = 0.3
# An unknown is at a bound if it is within this factor of it, a coordinate within that less 1 of a decay length.
AT_BOUND = 1.001


@dataclass(frozen=True, eq=False)
class FitResult:
    """What `tetlux.fem.fit` found.

    Attributes
    ----------
    values : dict of str to float
        The fitted value of each unknown, by its name. Absorption and scattering are in 1/unit, haemoglobin in mol/l,
        water and fat in fractions of the volume, coordinates in unit.
    covariance : (u, u) ndarray
        Covariance matrix of the values, in their order. It follows from the noise that was given, or from the
        residuals.
    residuals : (n,) ndarray
        ln(fitted reading/measured reading) over the relative noise, for each of the n measured readings; real and
        imaginary parts of modulated light.
    undetermined : tuple of str
        Sentences on unknowns that the readings do not determine; empty if there are none.
    evaluations : int
        How often readings and their derivatives were computed.
    mesh : TetMesh
        The mesh of the last step.
    readings : (c, l, d) ndarray
        What the fitted model reads, W/unit², for each of c wavelengths, l lights and d detectors; times the gain, if
        that is an unknown.
    media : list of list of Medium
        ``media[c]`` are the fitted media at wavelength c: that of the body, then those of the regions.
    lights : list of Light
        At the places that were fitted.

    Examples
    --------
    Absorption of a ball from three readings, which a known absorption of 0.02/mm made:

    >>> from tetlux.fem import Medium, PencilBeam, PointDetector, fit, solve
    >>> from tetlux.meshing import sphere
    >>> ball, truth = sphere(10.0), Medium(sigma_a=0.02, sigma_s_prime=1.0, eta=1.4)
    >>> beam, there = PencilBeam((0, 0, 20), (0, 0, -1)), [PointDetector((10, 0, z)) for z in (0, 3, 6)]
    >>> measured = solve(ball, truth, [beam], tolerance=None, detectors=there, detector_tolerance=0.02).readings
    >>> start = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> found = fit(ball, [beam], there, measured, ["sigma_a"], start, noise=0.02, detector_tolerance=0.05)
    >>> round(found.values["sigma_a"], 3)
    0.02
    >>> bool(found.errors["sigma_a"] < 0.001), found.undetermined  # standard error by 2 % of noise, 1/mm
    (True, ())
    """

    values: dict[str, float]
    covariance: FloatArray
    residuals: FloatArray
    undetermined: tuple[str, ...]
    evaluations: int
    mesh: TetMesh
    readings: NumberArray
    media: list[list[Medium]]
    lights: list[Light]

    @property
    def errors(self) -> dict[str, float]:
        """Standard error of each value, in its unit: the square root of its variance."""
        return dict(zip(self.values, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @property
    def correlation(self) -> FloatArray:
        """Correlation coefficients of the values, (u, u)."""
        deviations = np.sqrt(np.diag(self.covariance))
        return np.asarray(self.covariance / np.outer(deviations, deviations))

    @property
    def misfit(self) -> float:
        """Root mean square of the residuals per degree of freedom: about 1 where noise and model are right."""
        return float(np.sqrt(self.residuals @ self.residuals / max(len(self.residuals) - len(self.values), 1)))

    __repr__ = one_line


def result_of(problem: FitProblem, request: FitRequest, values: FloatArray, evaluations: int) -> FitResult:
    """The result at values (u,), with what is not determined."""
    unknowns = problem.unknowns
    names, parameters, slopes = unknowns.names, unknowns.parameters(values), unknowns.slopes(values)
    residuals, jacobian = problem.residuals(parameters), problem.jacobian(parameters)
    variance = 1.0
    if not request.noise_is_known:
        variance = float(residuals @ residuals) / max(len(residuals) - len(values), 1)
    _, sizes, ways = np.linalg.svd(jacobian, full_matrices=False)
    sizes = np.maximum(sizes, np.finfo(float).tiny ** 0.25)
    of_parameters = (ways.T * (variance / sizes**2)) @ ways
    lost = sizes <= UNSEEN * sizes[0]
    if request.noise_is_known:
        lost |= 1.0 / sizes > UNDETERMINED
    return FitResult(
        values=dict(zip(names, values.tolist(), strict=True)),
        covariance=slopes[:, None] * of_parameters * slopes,
        residuals=residuals,
        undetermined=(*(_undetermined(unknowns, way) for way in ways[lost]), *_at_bounds(request, values)),
        evaluations=evaluations,
        mesh=problem.mesh,
        readings=problem.fitted(parameters),
        media=unknowns.media(values),
        lights=unknowns.lights(problem.lights, values),
    )


def _undetermined(unknowns: FitUnknowns, way: FloatArray) -> str:
    """A sentence on a combination of unknowns (u,) that readings do not tell."""
    names, shares = unknowns.names, np.abs(way)
    belong = [name for name, share in zip(names, shares.tolist(), strict=True) if share > BELONGS * shares.max()]
    if len(belong) == 1:
        return f"the readings do not tell {belong[0]}."
    listed = ", ".join(belong[:-1]) + f" and {belong[-1]}"
    if any(name in unknowns.coordinates for name in belong):
        return f"the readings do not tell {listed} apart: a combination of them is free."
    signs = "a product" if len(set(np.sign(way[[names.index(name) for name in belong]]).tolist())) == 1 else "a ratio"
    return f"the readings do not tell {listed} apart: {signs} of their powers is free."


def _at_bounds(request: FitRequest, values: FloatArray) -> list[str]:
    """Sentences on unknowns that ended at a bound."""
    unknowns, found = request.unknowns, []
    # A factor of a value is a difference of parameters.
    apart = unknowns.parameters(values)[:, None] - np.stack([unknowns.parameters(b) for b in request.bounds.T], axis=1)
    for name, differences, limits in zip(unknowns.names, np.abs(apart), request.bounds.tolist(), strict=True):
        nearest = int(differences.argmin())
        if differences[nearest] < np.log(AT_BOUND):
            found.append(f"{name} ended at its bound {limits[nearest]:g}.")
    return found
