"""Diffusion over radiative transfer, by regime and by source model: Markdown tables on the standard output.

Run ``python -m tests.tables.diffusion_against_monte_carlo`` in the root of the repository. Diffusion is its
closed form each time, so nothing here is the error of a mesh; radiative transfer is `tetlux.fem.exact.monte_carlo`.
"""

import math
import sys
import time
from collections.abc import Callable

import numpy as np

from tetlux.fem import Medium
from tetlux.fem.exact import half_space, monte_carlo, slab_plane, sphere, sphere_light
from tetlux.fem.exact.beam import Source
from tetlux.fem.exact.monte_carlo import SampleMean
from tetlux.fem.exact.numerics.bessel import SPHERICAL, inner_ratios, wall_rates
from tetlux.fem.exact.numerics.legendre import legendre_sum
from tetlux.fem.exact.numerics.quadrature import composite_rule, graded_rule
from tetlux.fem.exact.slab_plane import escape_front
from tetlux.fem.media.fresnel import reflectance
from tetlux.meshing.arrays import FloatArray

LINES: tuple[tuple[str, Source], ...] = (
    ("line, similarity", "similarity"),
    ("line, delta-Eddington", "delta-eddington"),
)
Exitance = Callable[[FloatArray], FloatArray]
Bins = tuple[tuple[int, int], ...]
# Above this standard error a ratio says nothing.
BLURRED = 0.05


def medium_of(albedo: float, g: float, eta: float) -> Medium:
    """Transport mean free path 1, the given reduced albedo."""
    return Medium(sigma_a=1.0 - albedo, sigma_s=albedo / (1.0 - g), g=g, eta=eta)


def entered(medium: Medium) -> float:
    """Share of a beam at right angles that is not reflected at once."""
    return 1.0 - float(reflectance(1.0, 1.0 / medium.eta))


def row(*cells: str) -> None:
    print("| " + " | ".join(cells) + " |")


def head(*cells: str) -> None:
    print()
    row(*cells)
    row(*["---"] * len(cells))


def ratio(model: float, truth: SampleMean) -> str:
    if truth.standard_error > BLURRED * truth.value or truth.value == 0.0:
        return "-"
    return f"{model / truth.value:.3f}"


def ratios(models: list[float], truths: list[SampleMean]) -> list[str]:
    return [ratio(model, truth) for model, truth in zip(models, truths, strict=True)]


def blur(truth: SampleMean) -> str:
    return f"{100.0 * truth.standard_error / truth.value:.2f} %" if truth.value else "-"


def bin_means(exitance: Exitance, bins: Bins) -> FloatArray:
    """Means over rings of the sphere, from one call; `exitance` is singular at 0 at most, like 1/gamma."""
    rules = [graded_rule(30, 12) if low == 0 else composite_rule(np.linspace(0.0, 1.0, 5), 12) for low, _ in bins]
    lows, highs = np.radians(bins).T
    gammas = [low + (high - low) * nodes for low, high, (nodes, _) in zip(lows, highs, rules, strict=True)]
    values = np.split(exitance(np.concatenate(gammas)), np.cumsum([gamma.size for gamma in gammas])[:-1])
    integrals = [
        (high - low) * (weights * np.sin(gamma)) @ value
        for low, high, (_, weights), gamma, value in zip(lows, highs, rules, gammas, values, strict=True)
    ]
    return np.asarray(np.array(integrals) / (np.cos(lows) - np.cos(highs)))


def estimates_of(run: monte_carlo.SphereResult, bins: Bins) -> list[SampleMean]:
    """What Monte Carlo found in each bin, and the whole."""
    where = [int(np.argmin(np.abs(run.edges - math.radians(low)))) for low, _ in bins]
    return [SampleMean(run.exitance[i], run.standard_error[i]) for i in where] + [run.exited]


def pencil_on_a_ball(title: str, medium: Medium, radius: float, photons: int) -> None:
    bins: Bins = ((0, 10), (10, 20), (20, 30), (30, 40), (60, 90))
    edges = np.radians([0, 10, 20, 30, 40, 60, 90, 180])
    run = monte_carlo.sphere(medium, radius=radius, light="pencil", edges=edges, photons=photons)
    estimates = estimates_of(run, bins)
    depth = medium.mean_free_path
    share = entered(medium)

    def point(gamma: FloatArray) -> FloatArray:
        return medium.albedo * sphere.point_exitance(medium, radius=radius, source_radius=radius - depth, gamma=gamma)

    total = medium.albedo * sphere.point_total(medium, radius=radius, source_radius=radius - depth)
    models: dict[str, tuple[Exitance, float]] = {"point, alpha'": (point, total)}
    for name, source in LINES:

        def line(gamma: FloatArray, source: Source = source) -> FloatArray:
            return sphere_light.pencil_exitance(medium, radius=radius, gamma=gamma, source=source)

        models[name] = line, sphere_light.pencil_total(medium, radius=radius, source=source)
    print(f"\n### {title}")
    head("source", *(f"{low}-{high}°" for low, high in bins), "total")
    for name, (exitance, total) in models.items():
        means = [*bin_means(exitance, bins), total]
        row(name, *ratios([share * mean for mean in means], estimates))
    row("Monte Carlo, W/unit² and W", *(f"{e.value:.4g}" for e in estimates))
    row("its standard error", *(blur(e) for e in estimates))


def beam_on_a_half_space(photons: int) -> None:
    print("\n## Wide beam on a half-space: reflectance")
    head("albedo'", "n", "g", "point, alpha'", *(name for name, _ in LINES), "Monte Carlo", "its standard error")
    for eta in (1.0, 1.4):
        for albedo in (0.99, 0.9, 0.6):
            for g in (0.0, 0.8):
                medium = medium_of(albedo, g, eta)
                # Less than e^-25 of the light comes back from there.
                thick = min(12.5 / medium.sigma_tr, 80.0)
                truth = monte_carlo.slab(medium, thickness=thick, light="beam", photons=photons).reflectance
                share = entered(medium)
                found = [albedo * half_space.point_total(medium, depth=1.0)]
                found += [half_space.pencil_total(medium, source=source) for _, source in LINES]
                row(
                    f"{albedo:g}",
                    f"{eta:g}",
                    f"{g:g}",
                    *(ratio(share * value, truth) for value in found),
                    f"{truth.value:.5f}",
                    blur(truth),
                )


def beam_on_a_slab(photons: int) -> None:
    print("\n## Wide beam on a slab")
    print(
        "\nR and T are what has been scattered; T + b adds what passes unscattered in each one's own sense, "
        "which a model with a forward peak taken out counts more of. Thickness L in mean free paths 1/sigma_t'."
    )
    names = ("point", "similarity", "delta-Edd.")
    head(
        *("albedo'", "n", "g", "L"),
        *(f"{what} {name}" for what in ("R", "T", "T + b") for name in names),
        *("Monte Carlo R", "T", "b", "standard errors of R, T"),
    )
    for eta in (1.0, 1.4):
        for albedo in (0.99, 0.9, 0.6):
            for g in (0.0, 0.8):
                for thickness in (2.0, 5.0, 10.0):
                    medium = medium_of(albedo, g, eta)
                    # Little light comes through where much is absorbed, and that run is short.
                    count = photons * (1 if albedo > 0.95 else 3)
                    truth = monte_carlo.slab(medium, thickness=thickness, light="beam", photons=count)
                    passed = SampleMean(
                        truth.transmittance.value + truth.ballistic.value,
                        math.hypot(truth.transmittance.standard_error, truth.ballistic.standard_error),
                    )
                    share = entered(medium)
                    depth = np.array([1.0, thickness - 1.0])
                    front, back = albedo * escape_front(medium, thickness, depth)
                    models = [(front, back, 0.0)]
                    for _, source in LINES:
                        models.append(
                            (
                                slab_plane.beam_reflectance(medium, thickness=thickness, source=source),
                                slab_plane.beam_transmittance(medium, thickness=thickness, source=source),
                                slab_plane.ballistic_transmittance(medium, thickness=thickness, source=source),
                            )
                        )
                    row(
                        *(f"{value:g}" for value in (albedo, eta, g, thickness)),
                        *(ratio(share * m[0], truth.reflectance) for m in models),
                        *(ratio(share * m[1], truth.transmittance) for m in models),
                        *(ratio(share * (m[1] + m[2]), passed) for m in models),
                        f"{truth.reflectance.value:.4g}",
                        f"{truth.transmittance.value:.4g}",
                        f"{truth.ballistic.value:.2g}",
                        f"{blur(truth.reflectance)}, {blur(truth.transmittance)}",
                    )


def points_under_a_beam(medium: Medium, radius: float) -> Exitance:
    """Exitance of a ball in a beam (n 1) whose rays each leave their power at one mean free path.

    The series of `sphere` summed over all rays; a ray that crosses less than two mean free paths leaves it in
    the middle of its chord, as `PencilBeam` does.
    """
    order = 300
    nodes, weights = composite_rule(np.linspace(0.0, 1.0, 41), 12)
    mu, weight = nodes, weights * nodes  # rays by the cosine at which they enter
    height = mu - np.minimum(medium.mean_free_path / radius, mu)
    r = np.sqrt(height**2 + 1.0 - mu**2)
    x = medium.sigma_tr * radius
    growth = wall_rates(order, np.array([x]), SPHERICAL).growth[:, 0]
    legendre = np.polynomial.legendre.legvander(height / r, order).T
    power = medium.albedo * (inner_ratios(order, x, r, SPHERICAL) * legendre) @ weight
    series = 0.5 * (2.0 * np.arange(order + 1) + 1.0) * power
    series /= 1.0 + medium.extrapolation_length / radius * growth
    return lambda gamma: legendre_sum(series, gamma)


def line_under_a_beam(medium: Medium, radius: float, source: Source) -> Exitance:
    return lambda gamma: sphere_light.beam_exitance(medium, radius=radius, gamma=gamma, source=source)


def beam_on_a_ball(photons: int) -> None:
    print("\n## Wide beam on a ball: exitance by angle from the pole that faces it (n 1)")
    bins: Bins = ((0, 10), (40, 50), (85, 95), (130, 140), (160, 180))
    edges = np.radians(sorted({edge for pair in bins for edge in pair}))
    head("albedo'", "g", "radius", "source", *(f"{low}-{high}°" for low, high in bins), "exited")
    scenes = [(albedo, radius) for albedo in (0.99, 0.9) for radius in (2.0, 5.0, 10.0)] + [(0.6, 5.0)]
    for albedo, radius in scenes:
        for g in (0.0, 0.8):
            medium = medium_of(albedo, g, 1.0)
            run = monte_carlo.sphere(medium, radius=radius, light="beam", edges=edges, photons=photons)
            estimates = estimates_of(run, bins)
            start = (f"{albedo:g}", f"{g:g}", f"{radius:g}")

            points = points_under_a_beam(medium, radius)
            # A mean over the whole ball is its total over 4 pi a², of pi a² that came in.
            total = 4.0 * float(bin_means(points, ((0, 180),))[0])
            row(*start, "point, alpha'", *ratios([*bin_means(points, bins), total], estimates))
            # Without a forward peak both lines are one.
            for name, source in LINES if g else LINES[1:]:
                line = line_under_a_beam(medium, radius, source)
                total = sphere_light.beam_total(medium, radius=radius, source=source) / (math.pi * radius**2)
                row(*start, name, *ratios([*bin_means(line, bins), total], estimates))
            row(*start, "Monte Carlo", *(f"{e.value:.4g} ± {blur(e)}" for e in estimates))


def main() -> None:
    """Print all tables."""
    started = time.perf_counter()
    print("# Diffusion over Monte Carlo")
    print("\nLengths in mean free paths 1/sigma_t', except in the first medium, whose 1/sigma_t' is 0.99.")
    print("\n## Pencil beam on a ball of radius 10: exitance by angle from its entry")
    tissue = Medium(sigma_a=0.01, sigma_s=5.0, g=0.8, eta=1.4)
    pencil_on_a_ball("sigma_a 0.01, sigma_s 5, g 0.8, n 1.4 (albedo' 0.990)", tissue, 10.0, 600_000)
    for albedo, g, eta in ((0.99, 0.95, 1.4), (0.99, 0.0, 1.4), (0.99, 0.8, 1.0), (0.9, 0.8, 1.4), (0.6, 0.8, 1.4)):
        count = 400_000 if g < 0.9 else 150_000
        pencil_on_a_ball(f"albedo' {albedo:g}, g {g:g}, n {eta:g}", medium_of(albedo, g, eta), 10.0, count)
    beam_on_a_half_space(100_000)
    beam_on_a_slab(100_000)
    beam_on_a_ball(800_000)
    print(f"\nMade in {time.perf_counter() - started:.0f} s.", file=sys.stderr)


if __name__ == "__main__":
    main()
