"""`FitResult`: values with their covariance, and what readings do not tell."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.fem.inverse.problem import FitProblem
from tetlux.fem.inverse.request import FitRequest
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.mesh import TetMesh

# A combination of unknowns is undetermined if its standard deviation is more than this share of the unknowns.
UNDETERMINED = 1.0
# Without noise given it is if it changes no reading by this share of what others change.
UNSEEN = 1e-6
# Share of the largest component from which an unknown belongs to an undetermined combination.
BELONGS = 0.3
# An unknown is at a bound if it is within this factor of it.
AT_BOUND = 1.001


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
    readings : (c, l, d) ndarray
        Of the model, times the gain, W/unit²: for each wavelength, light and detector.
    media : list of list of Medium
        For each wavelength that of the body and of each region.
    """

    values: dict[str, float]
    covariance: FloatArray
    residuals: FloatArray
    undetermined: tuple[str, ...]
    evaluations: int
    mesh: TetMesh
    readings: NumberArray
    media: list[list[Medium]]

    @property
    def errors(self) -> dict[str, float]:
        """Standard deviations of the values."""
        return dict(zip(self.values, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @property
    def correlation(self) -> FloatArray:
        """Correlation coefficients of the values, (u, u)."""
        deviations = np.sqrt(np.diag(self.covariance))
        return np.asarray(self.covariance / np.outer(deviations, deviations))

    @property
    def misfit(self) -> float:
        """Root mean square of the residuals by degrees of freedom: about 1 where noise and model are right."""
        return float(np.sqrt(self.residuals @ self.residuals / max(len(self.residuals) - len(self.values), 1)))

    __repr__ = one_line


def result_of(problem: FitProblem, request: FitRequest, values: FloatArray, evaluations: int) -> FitResult:
    """The result at values (u,), with what is not determined."""
    names, logarithms = problem.unknowns.names, np.log(values)
    residuals, jacobian = problem.residuals(logarithms), problem.jacobian(logarithms)
    variance = 1.0
    if not request.noise_is_known:
        variance = float(residuals @ residuals) / max(len(residuals) - len(values), 1)
    _, sizes, ways = np.linalg.svd(jacobian, full_matrices=False)
    sizes = np.maximum(sizes, np.finfo(float).tiny ** 0.25)
    of_logarithms = (ways.T * (variance / sizes**2)) @ ways
    lost = sizes <= UNSEEN * sizes[0]
    if request.noise_is_known:
        lost |= 1.0 / sizes > UNDETERMINED
    return FitResult(
        values=dict(zip(names, values.tolist(), strict=True)),
        covariance=values[:, None] * of_logarithms * values,
        residuals=residuals,
        undetermined=(*(_undetermined(names, way) for way in ways[lost]), *_at_bounds(request, values)),
        evaluations=evaluations,
        mesh=problem.mesh,
        readings=problem.fitted(logarithms),
        media=problem.unknowns.media(values),
    )


def _undetermined(names: Sequence[str], way: FloatArray) -> str:
    """A sentence on a combination of unknowns (u,) that readings do not tell."""
    belong = [
        name for name, share in zip(names, np.abs(way).tolist(), strict=True) if share > BELONGS * np.abs(way).max()
    ]
    if len(belong) == 1:
        return f"the readings do not tell {belong[0]}."
    signs = "a product" if len(set(np.sign(way[[names.index(name) for name in belong]]).tolist())) == 1 else "a ratio"
    return f"the readings do not tell {' and '.join(belong)} apart: {signs} of their powers is free."


def _at_bounds(request: FitRequest, values: FloatArray) -> list[str]:
    """Sentences on unknowns that ended at a bound."""
    found = []
    for name, value, (low, high) in zip(request.unknowns.names, values.tolist(), request.bounds.tolist(), strict=True):
        if value < AT_BOUND * low or value * AT_BOUND > high:
            found.append(f"{name} ended at its bound {low if value < AT_BOUND * low else high:g}.")
    return found
