"""Flux-limited diffusion over radiative transfer: why `tetlux.fem.solve` does not offer it.

Run ``python -m tests.tables.flux_limited_against_monte_carlo`` in the root of the repository (two minutes).
Levermore and Pomraning (1981) let the diffusion coefficient depend on how steeply the fluence falls::

    D = lambda(R)/(omega sigma_t'),  lambda(R) = (coth R - 1/R)/R,  R = |grad phi|/(omega sigma_t' phi)

which is found by iterating: D from the fluence before, by the geometric mean with the D before. Their omega is what a
place scatters and emits over what it takes away, ``alpha' + Q0/(sigma_t' phi)``; "limited, alpha'" leaves the light's
own Q0 out of it. "asymptotic D" is one number for the whole body, ``sigma_a/k²`` with radiative transfer's own decay
``tanh(k/alpha') = k`` (k in sigma_t', isotropic scattering): it needs no iteration.

What it prints, in short (model over Monte Carlo, mean free paths 1/sigma_t')::

{findings}
"""

import math
import sys
import time
from collections.abc import Callable
from typing import Literal

import numpy as np
from scipy.linalg import solve_banded
from scipy.optimize import brentq

from tests.tables.diffusion_against_monte_carlo import entered, head, medium_of, ratio, row
from tetlux.fem import Medium, PencilBeam
from tetlux.fem.assembly import Assembly
from tetlux.fem.coefficients import coefficients_of
from tetlux.fem.exact import monte_carlo
from tetlux.fem.exact.monte_carlo import Estimate
from tetlux.fem.grading import graded_towards, lit_points
from tetlux.fem.linear import solver_for
from tetlux.fem.loads import load_vector
from tetlux.meshing import sphere, tetrahedralize
from tetlux.meshing.arrays import FloatArray

Model = Literal["diffusion", "limited, alpha'", "limited", "asymptotic D"]
MODELS: tuple[Model, ...] = ("diffusion", "limited, alpha'", "limited", "asymptotic D")
SLAB_STEPS, BALL_STEPS, CELLS = 60, 15, 2000
# D changes by less than 1e-5 of itself then, but where the fluence is below zero.
FLOOR = 1e-12


def asymptotic(medium: Medium) -> float:
    """The D with which diffusion decays as radiative transfer does far from all light, unit."""
    albedo = medium.albedo
    decay = brentq(lambda k: math.tanh(k / albedo) - k, 1e-6, 1.0 - 1e-15)
    return float(medium.sigma_a / (decay * medium.sigma_t_prime) ** 2)


def limited(medium: Medium, slope: FloatArray, omega: FloatArray) -> FloatArray:
    """D where the fluence falls by `slope` = |grad phi|/phi."""
    ratio = slope / (omega * medium.sigma_t_prime)
    small = ratio < 1e-2
    safe = np.where(small, 1.0, ratio)
    share = np.where(small, 1.0 / 3.0 - ratio**2 / 45.0, (1.0 / np.tanh(safe) - 1.0 / safe) / safe)
    return np.asarray(share / (omega * medium.sigma_t_prime))


def iterated(
    model: Model,
    medium: Medium,
    q0: FloatArray,
    steps: int,
    solved: Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]],
) -> FloatArray:
    """Fluence by a model; `solved` gives it for D of the cells, and its mean and |grad phi| in each."""
    diffusion = np.full(len(q0), asymptotic(medium) if model == "asymptotic D" else medium.diffusion)
    fluence, mean, slope = solved(diffusion)
    for _ in range(steps if model.startswith("limited") else 0):
        mean = np.maximum(mean, FLOOR * mean.max())
        omega = medium.albedo + (q0 / (medium.sigma_t_prime * mean) if model == "limited" else 0.0 * q0)
        diffusion = np.sqrt(diffusion * limited(medium, slope / mean, omega))
        fluence, mean, slope = solved(diffusion)
    return fluence


def slab(model: Model, medium: Medium, thickness: float) -> tuple[float, float]:
    """Reflectance and transmittance of a wide beam by delta-Eddington, of the light that has entered."""
    step = thickness / CELLS
    star, cosine = medium.delta_eddington
    extinction = medium.sigma_a + star
    ends = np.exp(-extinction * np.linspace(0.0, thickness, CELLS + 1))
    scattered = -star / extinction * np.diff(ends)
    load = np.zeros(CELLS + 1)
    load[1:] += 0.5 * scattered
    load[:-1] += 0.5 * scattered
    forward = cosine * scattered / (step * medium.sigma_t_prime)
    load[1:] += forward
    load[:-1] -= forward
    corners = np.full(CELLS + 1, step)
    corners[[0, -1]] *= 0.5
    escape = 0.5 / medium.boundary_factor

    def solved(diffusion: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        bands = np.zeros((3, CELLS + 1))
        bands[1] = medium.sigma_a * corners
        bands[1, [0, -1]] += escape
        bands[1, 1:] += diffusion / step
        bands[1, :-1] += diffusion / step
        bands[0, 1:] = bands[2, :-1] = -diffusion / step
        fluence = solve_banded((1, 1), bands, load)
        return fluence, 0.5 * (fluence[1:] + fluence[:-1]), np.abs(np.diff(fluence)) / step

    fluence = iterated(model, medium, scattered / step, SLAB_STEPS, solved)
    return escape * float(fluence[0]), escape * float(fluence[-1])


def wide_beams(photons: int) -> None:
    print("\n## Wide beam on a slab")
    head("albedo'", "n", "g", "L", *(f"{what} {model}" for what in ("R", "T") for model in MODELS))
    for eta in (1.0, 1.4):
        for albedo in (0.99, 0.9, 0.6):
            for g in (0.0, 0.8):
                for thickness in (1.0, 2.0, 5.0, 10.0):
                    medium = medium_of(albedo, g, eta)
                    truth = monte_carlo.slab(medium, thickness=thickness, light="beam", photons=photons)
                    found = [slab(model, medium, thickness) for model in MODELS]
                    row(
                        *(f"{value:g}" for value in (albedo, eta, g, thickness)),
                        *(ratio(entered(medium) * front, truth.reflectance) for front, _ in found),
                        *(ratio(entered(medium) * back, truth.transmittance) for _, back in found),
                    )


def pencils(photons: int) -> None:
    print("\n## Pencil beam, deposited in a point, on a ball: exitance by angle from its entry")
    degrees = (0, 10, 20, 30, 45, 60, 90, 120)
    edges = np.radians(degrees)
    head("albedo'", "n", "g", "radius", "model", *(f"{a}-{b}°" for a, b in zip(degrees, degrees[1:], strict=False)))
    scenes = ((0.99, 1.4, 0.8, 10.0), (0.99, 1.4, 0.0, 10.0), (0.9, 1.4, 0.8, 10.0))
    scenes += ((0.6, 1.4, 0.8, 5.0), (0.6, 1.0, 0.0, 5.0), (0.99, 1.4, 0.8, 2.0))
    for albedo, eta, g, radius in scenes:
        medium = medium_of(albedo, g, eta)
        truth = monte_carlo.sphere(medium, radius=radius, light="pencil", edges=edges, photons=photons)
        surface = sphere(radius=radius)
        deposit = PencilBeam((0.0, 0.0, 3.0 * radius), (0.0, 0.0, -1.0)).deposit_in(surface, medium)
        mesh = tetrahedralize(surface, edge_length=radius / 9.0)
        mesh = graded_towards(mesh, surface, *lit_points([deposit], medium), 200_000, longest=0.35)
        load = load_vector(mesh, coefficients_of(medium), deposit)
        assembly = Assembly(mesh)
        corners = mesh.points[mesh.tetrahedra]
        inverse = np.linalg.inv(corners[:, 1:] - corners[:, :1])

        def solved(diffusion: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            matrix = assembly.matrix(diffusion, medium.sigma_a, 0.5 / medium.boundary_factor)
            fluence = solver_for(matrix, 1).solve(load[:, None])[:, 0]
            at = fluence[mesh.tetrahedra]
            slope = np.linalg.norm((inverse @ (at[:, 1:] - at[:, :1])[..., None])[..., 0], axis=1)
            return fluence, at.mean(axis=1), slope

        middles = mesh.points[mesh.boundary_faces].mean(axis=1)
        ring = np.digitize(np.arccos(np.clip(middles[:, 2] / np.linalg.norm(middles, axis=1), -1.0, 1.0)), edges)
        area = np.bincount(ring, mesh.boundary_areas)[1 : len(edges)]
        for model in MODELS:
            fluence = iterated(
                model, medium, (load / mesh.node_volumes)[mesh.tetrahedra].mean(axis=1), BALL_STEPS, solved
            )
            power = mesh.boundary_areas * fluence[mesh.boundary_faces].mean(axis=1) * 0.5 / medium.boundary_factor
            exitance = np.bincount(ring, power)[1 : len(edges)] / area
            estimates = map(Estimate, truth.exitance, truth.standard_error)
            cells = [ratio(value, estimate) for value, estimate in zip(exitance, estimates, strict=True)]
            row(*(f"{value:g}" for value in (albedo, eta, g, radius)), model, *cells)


def main() -> None:
    """Print both tables."""
    started = time.perf_counter()
    print("# Flux-limited diffusion over Monte Carlo")
    wide_beams(150_000)
    pencils(300_000)
    print(f"\nMade in {time.perf_counter() - started:.0f} s.", file=sys.stderr)


if __name__ == "__main__":
    main()
