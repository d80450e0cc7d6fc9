"""Flux-limited diffusion over radiative transfer: why `tetlux.fem.solve` does not offer it.

Run ``python -m tests.tables.flux_limited_against_monte_carlo`` in the root of the repository (a minute or two).
Levermore and Pomraning (1981) let the diffusion coefficient depend on how steeply the fluence falls::

    D = lambda/(omega sigma_t'),  lambda = (coth R - 1/R)/R,  R = |grad phi|/(omega sigma_t' phi)

which is found by iterating: D from the fluence before, by the geometric mean with the D before. Their omega is what a
place scatters and emits over what it takes away, ``alpha' + Q0/(sigma_t' phi)``; "limited, alpha'" leaves the light's
own Q0 out of it. "asymptotic D" is one number for the whole body, ``sigma_a/k²`` with radiative transfer's own decay
``tanh(k/alpha') = k`` (k in sigma_t', isotropic scattering): it is linear and needs no iteration.

What it prints, in short, over Monte Carlo and in mean free paths 1/sigma_t' (albedo, n, g):

====================================================  =========  ===============  ==========  ============
scene                                                 diffusion  limited, alpha'  limited     asymptotic D
====================================================  =========  ===============  ==========  ============
pencil, ball of radius 10 (.99, 1.4, .8), 0-10°       0.933      0.951            0.955       0.929
the same, 60-90°                                      0.990      0.978            0.975       0.997
pencil, ball of radius 10 (.9, 1.4, .8), 0-10°        0.950      0.936            0.936       0.923
the same, 10-20°                                      1.134      1.098            1.093       1.143
the same, 90-120°                                     0.831      0.994            0.985       1.101
pencil, ball of radius 5 (.6, 1.4, .8), 10-20°        1.497      1.343            1.307       1.493
the same, 90-120°                                     0.367      0.761            0.727       1.081
wide beam, plate of 1 (.99, 1, .8), R                 1.004      0.326            0.213       1.005
wide beam, plate of 5 (.9, 1, 0), T                   1.016      1.067            1.060       1.081
wide beam, plate of 5 (.9, 1, .8), R                  1.030      0.690            0.515       1.041
wide beam, plate of 5 (.6, 1, 0), T                   0.937      1.443            1.074       1.383
wide beam, plate of 5 (.6, 1.4, .8), R                1.229      below 0          below 0     1.351
====================================================  =========  ===============  ==========  ============

It helps far from a thin beam where much is absorbed, little else: close to the light and in thin plates it is no
better, and with a forward source (delta-Eddington's Q1) it fails, since the fluence itself is near or below zero where
the light enters, and D has nothing to go by. It is nonlinear besides, so that lights no longer add up, closed forms
cannot be taken off, and the estimate of the error does not hold.
"""

import itertools
import math
import sys
import time
from collections.abc import Callable
from typing import Literal

import numpy as np
from scipy.linalg import solve_banded
from scipy.optimize import brentq

from tests.tables.diffusion_against_monte_carlo import entered, head, medium_of, ratio, ratios, row
from tetlux.fem import Medium, PencilBeam
from tetlux.fem.body.body import Body
from tetlux.fem.exact import monte_carlo
from tetlux.fem.exact.monte_carlo import SampleMean
from tetlux.fem.grading import grade_mesh, places_to_resolve
from tetlux.fem.linear.solver import solver_for
from tetlux.fem.media.coefficients import coefficients_of
from tetlux.fem.operators.assembly import Assembly
from tetlux.fem.operators.loads import load_vector
from tetlux.meshing import sphere, tetrahedralize
from tetlux.meshing.arrays import FloatArray

Model = Literal["diffusion", "limited, alpha'", "limited", "asymptotic D"]
MODELS: tuple[Model, ...] = ("diffusion", "limited, alpha'", "limited", "asymptotic D")
# Fluence, and its mean and |grad phi| in each cell.
Solved = tuple[FloatArray, FloatArray, FloatArray]
# Albedo, index, mean cosine, radius.
BALLS = (
    (0.99, 1.4, 0.8, 10.0),
    (0.99, 1.4, 0.0, 10.0),
    (0.9, 1.4, 0.8, 10.0),
    (0.6, 1.4, 0.8, 5.0),
    (0.6, 1.0, 0.0, 5.0),
    (0.99, 1.4, 0.8, 2.0),
)
SLAB_STEPS, BALL_STEPS, CELLS = 60, 15, 2000
# Where the fluence is below this share of its largest value, it is taken for that.
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
    solved: Callable[[FloatArray], Solved],
) -> FloatArray:
    """Fluence by a model, from what solves for it with given D of the cells."""
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
    robin = 0.5 / medium.boundary_factor

    def solved(diffusion: FloatArray) -> Solved:
        bands = np.zeros((3, CELLS + 1))
        bands[1] = medium.sigma_a * corners
        bands[1, [0, -1]] += robin
        bands[1, 1:] += diffusion / step
        bands[1, :-1] += diffusion / step
        bands[0, 1:] = bands[2, :-1] = -diffusion / step
        fluence = solve_banded((1, 1), bands, load)
        return fluence, 0.5 * (fluence[1:] + fluence[:-1]), np.abs(np.diff(fluence)) / step

    fluence = iterated(model, medium, scattered / step, SLAB_STEPS, solved)
    return robin * float(fluence[0]), robin * float(fluence[-1])


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
    head("albedo'", "n", "g", "radius", "model", *(f"{low}-{high}°" for low, high in itertools.pairwise(degrees)))
    for albedo, eta, g, radius in BALLS:
        medium, edges = medium_of(albedo, g, eta), np.radians(degrees)
        run = monte_carlo.sphere(medium, radius=radius, light="pencil", edges=edges, photons=photons)
        truth = [SampleMean(*pair) for pair in zip(run.exitance, run.standard_error, strict=True)]
        for model, exitance in zip(MODELS, exitances_of_ball(medium, radius, edges), strict=True):
            row(*(f"{value:g}" for value in (albedo, eta, g, radius)), model, *ratios(exitance.tolist(), truth))


def exitances_of_ball(medium: Medium, radius: float, edges: FloatArray) -> list[FloatArray]:
    """Means over rings by each model, all on one mesh."""
    surface = sphere(radius=radius)
    deposit = PencilBeam((0.0, 0.0, 3.0 * radius), (0.0, 0.0, -1.0)).deposit_in(Body(surface, (medium,)))
    mesh = tetrahedralize(surface, edge_length=radius / 9.0)
    mesh = grade_mesh(mesh, surface, *places_to_resolve([deposit]), 200_000, longest=0.35)
    load = load_vector(mesh, coefficients_of(medium), deposit.terms)
    assembly, robin = Assembly(mesh), 0.5 / medium.boundary_factor
    corners = mesh.points[mesh.tetrahedra]
    inverse = np.linalg.inv(corners[:, 1:] - corners[:, :1])

    def solved(diffusion: FloatArray) -> Solved:
        fluence = solver_for(assembly.matrix(diffusion, medium.sigma_a, robin), 1).solve(load).x
        at = fluence[mesh.tetrahedra]
        slope = (inverse @ (at[:, 1:] - at[:, :1])[..., None])[..., 0]
        return fluence, at.mean(axis=1), np.linalg.norm(slope, axis=1)

    q0 = (load / mesh.node_volumes)[mesh.tetrahedra].mean(axis=1)
    middles = mesh.points[mesh.boundary_faces].mean(axis=1)
    polar = np.arccos(np.clip(middles[:, 2] / np.linalg.norm(middles, axis=1), -1.0, 1.0))
    ring = np.digitize(polar, edges)
    area = np.bincount(ring, mesh.boundary_areas)[1 : len(edges)]
    found = []
    for model in MODELS:
        fluence = iterated(model, medium, q0, BALL_STEPS, solved)
        power = mesh.boundary_areas * robin * fluence[mesh.boundary_faces].mean(axis=1)
        found.append(np.bincount(ring, power)[1 : len(edges)] / area)
    return found


def main() -> None:
    """Print both tables."""
    started = time.perf_counter()
    print("# Flux-limited diffusion over Monte Carlo")
    wide_beams(150_000)
    pencils(300_000)
    print(f"\nMade in {time.perf_counter() - started:.0f} s.", file=sys.stderr)


if __name__ == "__main__":
    main()
