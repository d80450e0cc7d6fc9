"""How far diffusion is from radiative transfer, by one cause at a time: the figures of `tetlux.fem.validity.tables`.

Run ``python -m tests.tables.validity`` in the root of the repository (two minutes). Diffusion is its closed form each
time, radiative transfer is `tetlux.fem.exact.monte_carlo`; the figures are ``|diffusion/transfer - 1|`` of the
exitance, lengths in mean free paths 1/sigma_t'; they are means over the cases that a row does not tell apart:
refractive indices 1 and 1.4, mean cosines 0 and 0.8.
"""

import sys
import time
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from tests.tables.diffusion_against_monte_carlo import entered, line_under_a_beam, medium_of
from tetlux.fem import Medium
from tetlux.fem.exact import half_space, monte_carlo, slab
from tetlux.fem.exact.checks import Face
from tetlux.fem.exact.numerics.quadrature import composite_rule, graded_rule
from tetlux.fem.validity.tables import (
    ALBEDOS,
    COSINES,
    DIAMETERS,
    FAR_RINGS,
    INDICES,
    NEAR_RINGS,
    THICKNESSES,
    near_error,
    near_rows,
)
from tetlux.meshing.arrays import FloatArray

# Thicker than any light comes back from.
HALF_SPACE = 60.0
BLURRED = 0.06
# Of point sources below the surface.
DEPTHS = (0.25, 0.5, 1.0, 2.0, 4.0)


def ring_means(exitance: Callable[[FloatArray], FloatArray], edges: FloatArray) -> FloatArray:
    """Means over rings of a plane; `exitance` is singular at 0 at most."""
    means = []
    for low, high in pairwise(edges):
        nodes, weights = graded_rule(30, 12) if low == 0 else composite_rule(np.linspace(0.0, 1.0, 4), 12)
        radius = low + (high - low) * nodes
        means.append(2.0 * (weights * radius) @ exitance(radius) / (high + low))
    return np.array(means)


def off(model: FloatArray, truth: FloatArray, error: FloatArray) -> FloatArray:
    """Errors of a model, nan where Monte Carlo, with this standard error, is blurred."""
    return np.where(error < BLURRED * truth, np.abs(model / np.where(truth > 0, truth, 1.0) - 1.0), np.nan)


def pencil(medium: Medium, edges: FloatArray, photons: int) -> tuple[FloatArray, FloatArray]:
    """Errors of a pencil beam's exitance on a half-space, its deposit a point and a line, by ring."""
    run = monte_carlo.slab(medium, thickness=HALF_SPACE, light="pencil", edges=edges, photons=photons)
    share = entered(medium)
    point = ring_means(lambda rho: half_space.point_exitance(medium, depth=medium.mean_free_path, rho=rho), edges)
    line = ring_means(lambda rho: half_space.pencil_exitance(medium, rho=rho), edges)
    return (
        off(share * medium.albedo * point, run.front, run.front_error),
        off(share * line, run.front, run.front_error),
    )


def photons_for(albedo: float) -> int:
    """Light that is absorbed soon is followed quickly, and little of it gets far."""
    return {0.99: 400_000, 0.9: 1_500_000}.get(albedo, 6_000_000)


def text(values: FloatArray) -> str:
    return "(" + ", ".join("nan" if np.isnan(value) else f"{value:.2f}" for value in values) + "),"


def point_sources(albedo: float, eta: float, photons: int) -> tuple[list[float], list[float]]:
    """Distances of rings on a half-space from isotropic points below them, and errors of their exitance there."""
    medium, distances, errors = medium_of(albedo, 0.0, eta), [], []
    edges = np.array([0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0])
    middles = 0.5 * (edges[1:] + edges[:-1])
    for depth in DEPTHS:
        run = monte_carlo.slab(medium, thickness=HALF_SPACE, light="point", depth=depth, edges=edges, photons=photons)

        def exitance(rho: FloatArray, depth: float = depth) -> FloatArray:
            return half_space.point_exitance(medium, depth=depth, rho=rho)

        distances += np.hypot(depth, middles).tolist()
        errors += off(ring_means(exitance, edges), run.front, run.front_error).tolist()
    return distances, errors


def from_there_on(errors: FloatArray) -> FloatArray:
    """The largest error of each ring and those after it: close by, where diffusion errs either way, none is 0."""
    return np.maximum.accumulate(errors[::-1])[::-1]


def near_and_far() -> None:
    edges = np.array([*NEAR_RINGS, *FAR_RINGS[1:]])
    count = len(NEAR_RINGS) - 1
    near: dict[tuple[str, float], FloatArray] = {}
    far, wide = [], np.zeros((len(INDICES), len(ALBEDOS)))
    for i, albedo in enumerate(ALBEDOS):
        away = []
        for g in COSINES:
            rings = []
            for j, eta in enumerate(INDICES):
                medium = medium_of(albedo, g, eta)
                photons = photons_for(albedo) // (1 if g == 0 else 2 if albedo > 0.8 else 4)
                point, line = pencil(medium, edges, photons)
                rings.append(point[:count])
                away += [point[count:], line[count:]]
                run = monte_carlo.slab(medium, thickness=HALF_SPACE, light="beam", photons=200_000)
                reflected = entered(medium) * half_space.pencil_total(medium)
                wide[j, i] += abs(reflected / run.reflectance.value - 1.0) / len(COSINES)
            near[f"beam, g {g:g}", albedo] = from_there_on(np.mean(rings, axis=0))
        far.append(np.nanmean(away, axis=0))
        found = [point_sources(albedo, eta, 400_000) for eta in INDICES]
        distances, errors = (np.array([x for pair in found for x in pair[k]]) for k in (0, 1))
        ring = np.digitize(distances, NEAR_RINGS) - 1
        means = np.array([np.nanmean(errors[ring == k]) for k in range(count)])
        near["point source", albedo] = from_there_on(means)
    print("\n## Near a thin beam's entry (deposit: point), or a point source; rings:", NEAR_RINGS)
    for (name, albedo), row in sorted(near.items()):
        print(f"    {text(row)}  # {name}, albedo {albedo:g}")
    print("\n## Far from a thin beam, deposited as a point or a line; rings:", FAR_RINGS)
    for albedo, row in zip(ALBEDOS, far, strict=True):
        print(f"    {text(row)}  # albedo {albedo:g}")
    print("\n## A wide beam on a half-space: reflectance, by albedo:", ALBEDOS)
    for eta, row in zip(INDICES, wide, strict=True):
        print(f"    {text(row)}  # n {eta:g}")


def thin() -> None:
    print("\n## A ball in a wide beam (n 1, albedo 0.99): mean over its surface, by diameter:", DIAMETERS)
    bins = np.radians(np.arange(0, 181, 10))
    weights = -0.5 * np.diff(np.cos(bins))
    for g in COSINES:
        errors = []
        for diameter in DIAMETERS:
            medium = medium_of(0.99, g, 1.0)
            run = monte_carlo.sphere(medium, radius=0.5 * diameter, light="beam", edges=bins, photons=600_000)
            exitance = line_under_a_beam(medium, 0.5 * diameter, "delta-eddington")
            nodes, rule = composite_rule(np.linspace(0.0, 1.0, 3), 8)
            gamma = bins[:-1, None] + np.diff(bins)[:, None] * nodes
            sine = np.sin(gamma) * rule
            mean = (exitance(gamma.ravel()).reshape(gamma.shape) * sine).sum(axis=1) / sine.sum(axis=1)
            error = off(mean, run.exitance, run.standard_error)
            known = np.isfinite(error)
            errors.append(float(weights[known] @ error[known] / weights[known].sum()))
        print(f"    {text(np.array(errors))}  # g {g:g}")


def plates() -> None:
    print("\n## A pencil beam on a plate: mean over rings and faces, 1 to 8 from its axis, by thickness:", THICKNESSES)
    edges = np.array([1.0, 2.0, 4.0, 8.0])
    for g in COSINES:
        errors = []
        for thickness in THICKNESSES:
            found = []
            for eta in INDICES:
                medium = medium_of(0.99, g, eta)
                run = monte_carlo.slab(medium, thickness=thickness, light="pencil", edges=edges, photons=200_000)
                faces: tuple[tuple[Face, FloatArray, FloatArray], ...] = (
                    ("front", run.front, run.front_error),
                    ("back", run.back, run.back_error),
                )
                for face, truth, error in faces:

                    def exitance(
                        rho: FloatArray, medium: Medium = medium, length: float = thickness, face: Face = face
                    ) -> FloatArray:
                        depth = min(1.0, 0.5 * length)
                        return slab.point_exitance(medium, thickness=length, depth=depth, rho=rho, face=face)

                    model = entered(medium) * medium.albedo * ring_means(exitance, edges)
                    found.append(off(model, truth, error))
            errors.append(np.nanmean(found))
        print(f"    {text(np.array(errors))}  # g {g:g}")


def discs() -> None:
    print("\n## A round beam (deposit: point; n 1.4, albedo 0.99) on a half-space, in its middle and outside its edge")
    edges = np.concatenate([np.arange(0.0, 2.0, 0.05), np.arange(2.0, 6.0, 0.2), np.arange(6.0, 20.1, 0.5)])
    middles, areas = np.sqrt(0.5 * (edges[1:] ** 2 + edges[:-1] ** 2)), np.pi * np.diff(edges**2)
    turns = np.pi * (np.arange(64) + 0.5) / 64
    for g in COSINES:
        medium = medium_of(0.99, g, 1.4)
        run = monte_carlo.slab(medium, thickness=HALF_SPACE, light="pencil", edges=edges, photons=400_000)

        def exitance(rho: FloatArray, medium: Medium = medium) -> FloatArray:
            return half_space.point_exitance(medium, depth=medium.mean_free_path, rho=rho)

        point = ring_means(exitance, edges)
        point *= entered(medium) * medium.albedo
        for radius in (0.5, 1.0, 2.0, 4.0, 8.0):
            found = []
            for outside in (-radius, 0.5, 1.0, 2.0):
                away = radius + outside
                # The share of each ring round this place that lies in the disc.
                apart = away**2 + middles[:, None] ** 2 - 2.0 * away * middles[:, None] * np.cos(turns)
                caught = areas * (apart < radius**2).mean(axis=1)
                measured = abs(caught @ point / (caught @ run.front) - 1.0)
                distance = np.hypot(max(outside, 0.0), radius)
                expected = near_error(near_rows(np.array([medium.albedo]), np.array([g])), np.array([distance]))[0]
                found.append(f"{max(outside, 0.0):g} outside: {measured:.2f}, expected {expected:.2f}")
            print(f"    g {g:g}, radius {radius:g}:", "; ".join(found).replace("0 outside", "middle", 1))


def main() -> None:
    """Print all tables as the code has them."""
    started = time.perf_counter()
    print("# Expected errors of diffusion")
    near_and_far()
    thin()
    plates()
    discs()
    print(f"\nMade in {time.perf_counter() - started:.0f} s.", file=sys.stderr)


if __name__ == "__main__":
    main()
