"""Fifty scenes of layers and fields, each written in several ways: all ways must agree within twice the tolerance.

Run ``python -m tests.tables.both_ways [NAME...]`` in the root of the repository, where a name is that of a body or of
a light (all scenes: ten minutes of one core). For each scene it prints the largest difference between two ways of
writing it:

* of exited and of absorbed power, relative;
* of exitance near five points, a mean over twelve places within 0.75 of each, relative to the other way's value or to
  its root mean square over the surface, whichever is larger.

The exitance column is therefore no bound for single points: in collimated light exitance ripples from facet to facet,
and single points of two meshes differ by up to 11 % at a tolerance of 4 %; and where little light leaves, a difference
counts by the root mean square and not by the value itself.

It ends with exit code 1 if a difference is more than twice the tolerance, or if where there is a closed form a power is
that far from it.
"""

import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from tests.layers_made import CLEAR, DENSE, DOWN, layer
from tetlux.cases.file.load import load_cases
from tetlux.fem import (
    CollimatedBeam,
    DiffuseLight,
    Disc,
    Emission,
    EnvironmentLight,
    Light,
    Medium,
    PencilBeam,
    PointSource,
    Region,
    Solution,
    VaryingMedium,
    grid_field,
    solve,
)
from tetlux.fem.exact import layered
from tetlux.fem.lights.spots.plane import sunflower
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.meshing import Surface, sphere
from tetlux.meshing.arrays import FloatArray

TOLERANCE = 0.04
# A beam without width is singular where it enters, and would be refined there for ever.
MOST_TETRAHEDRA = {"pencil line": 40_000}
SIZE, DEPTH, UPPER, THIN = 20.0, 8.0, 3.0, 0.3


@dataclass(frozen=True)
class Way:
    """One way of writing a body down.

    Attributes
    ----------
    medium : Medium or VaryingMedium
    regions : tuple of Region
    layer : int, optional
        The region that is the upper layer, or None where it is none.
    """

    medium: AnyMedium
    regions: tuple[Region, ...] = ()
    layer: int | None = None


@dataclass(frozen=True)
class Written:
    """A body with all the ways of writing it down, and points of its surface at which exitance is compared."""

    surface: Surface
    ways: dict[str, Way]
    layers: tuple[tuple[Medium, float], ...] = ()


def plate(low: float, high: float) -> Surface:
    """The part between two depths of the plate."""
    return layer(low, high, SIZE)


def two_layers(depth: float, upper: Medium, lower: Medium, *, field: bool = False) -> Written:
    """A plate of two layers; with `field` also as a medium that varies, with either base."""
    above, below = plate(0.0, depth), plate(depth, DEPTH)
    ways = {
        "upper is the region": Way(lower, (Region(above, upper),), 1),
        "lower is the region": Way(upper, (Region(below, lower),), 0),
    }

    def step(of_upper: float, of_lower: float) -> Callable[[FloatArray], FloatArray]:
        return lambda points: np.where(points[:, 2] > -depth, of_upper, of_lower)

    if field:
        fields = {
            "sigma_a": step(upper.sigma_a, lower.sigma_a),
            "sigma_s_prime": step(upper.reduced_scattering, lower.reduced_scattering),
        }
        ways["varies, base of the upper"] = Way(VaryingMedium(base=upper, **fields))
        ways["varies, base of the lower"] = Way(VaryingMedium(base=lower, **fields))
    return Written(plate(0.0, DEPTH), ways, ((upper, depth), (lower, DEPTH - depth)))


def three_layers() -> Written:
    """A dense layer between two clear ones; any of the three may be the body."""
    ends = (0.0, 2.0, 4.0, DEPTH)
    media = (CLEAR, DENSE, replace_absorption(CLEAR, 0.02))
    ways = {}
    for body in range(3):
        others = [i for i in range(3) if i != body]
        regions = tuple(Region(plate(ends[i], ends[i + 1]), media[i]) for i in others)
        layer = 0 if body == 0 else 1 + others.index(0)
        ways[f"layer {body + 1} is the body"] = Way(media[body], regions, layer)
    return Written(plate(0.0, DEPTH), ways, tuple(zip(media, np.diff(ends).tolist(), strict=True)))


def replace_absorption(medium: Medium, sigma_a: float) -> Medium:
    """The same medium with another absorption."""
    return Medium(sigma_a=sigma_a, sigma_s=medium.sigma_s, g=medium.g, eta=medium.eta)


def smooth_field() -> Written:
    """A ball that scatters more and more towards the top: with either base, and from an array in a case file."""
    axis = np.arange(-9.0, 9.5, 1.0)
    values = np.broadcast_to(0.5 + 1.5 * (axis + 9.0) / 18.0, (len(axis),) * 3)
    field = grid_field(values, origin=(-9.0, -9.0, -9.0), spacing=1.0)
    ways = {}
    for base in (0.4, 2.0):
        medium = Medium(sigma_a=0.05, sigma_s_prime=base, eta=1.4)
        ways[f"base of {base:g}"] = Way(VaryingMedium(base=medium, sigma_s_prime=field))
    with tempfile.TemporaryDirectory() as folder:
        np.save(Path(folder) / "field.npy", values)
        case = Path(folder) / "case.yaml"
        case.write_text(
            "surface: {sphere: {radius: 8}}\n"
            "medium: {sigma_a: 0.05, eta: 1.4, "
            "sigma_s_prime: {array: {file: field.npy, origin: [-9, -9, -9], spacing: 1.0}}}\n"
            "lights: [point: {position: [0, 0, 0]}]\n"
        )
        (loaded,) = load_cases(case)
    ways["from an array"] = Way(loaded.channels[0].medium)
    return Written(sphere(8.0), ways)


BODIES: dict[str, Callable[[], Written]] = {
    "dense over clear": lambda: two_layers(UPPER, DENSE, CLEAR, field=True),
    "clear over dense": lambda: two_layers(UPPER, CLEAR, DENSE),
    "thin and dense over clear": lambda: two_layers(THIN, DENSE, CLEAR),
    "three layers": three_layers,
    "field": smooth_field,
}


LIGHTS: dict[str, Callable[[Way], Light]] = {
    "pencil point": lambda _: PencilBeam((0.3, 0.2, 20.0), DOWN),
    "slanting pencil": lambda _: PencilBeam((-20.0, 0.2, 20.0), (1.0, 0.0, -1.0)),
    "pencil line": lambda _: PencilBeam((0.3, 0.2, 20.0), DOWN, deposit="line"),
    "pencil with radius": lambda _: PencilBeam((0.3, 0.2, 20.0), DOWN, radius=2.0),
    "collimated": lambda _: CollimatedBeam((0.2, 0.1, -1.0)),
    "spot": lambda _: CollimatedBeam(DOWN, spot=Disc((0.0, 0.0, 20.0), 2.5)),
    "diffuse": lambda _: DiffuseLight(1.0),
    "environment": lambda _: EnvironmentLight(np.array([[1.0, 0.5], [0.2, 0.4]])),
    "emission": lambda way: Emission(1.0, region=way.layer),
    "point source": lambda _: PointSource((0.3, 0.2, -1.5)),
}
PLACES = np.array([[3.0, 0.0, 10.0], [0.0, -5.0, 10.0], [10.0, 0.0, -2.0], [0.0, 3.0, -10.0], [6.0, 6.0, 10.0]])

# Taken to the nearest points of the surface.
ABOUT = (PLACES[:, None] + sunflower(12, 0.75, np.array([0.6, 0.0, -0.8]))).reshape(-1, 3)


def differences(solutions: list[Solution]) -> tuple[float, float, float]:
    """Largest relative differences between solutions: exited power, absorbed power, exitance at points."""
    exited, absorbed, exitance = 0.0, 0.0, 0.0
    for one, other in combinations(solutions, 2):
        exited = max(exited, abs(one.power.exited / other.power.exited - 1.0))
        absorbed = max(absorbed, abs(one.power.absorbed / other.power.absorbed - 1.0))
        first, second = (each.exitance_at(ABOUT).reshape(len(PLACES), -1).mean(axis=1) for each in (one, other))
        scale = np.maximum(np.abs(second), root_mean_square(other))
        exitance = max(exitance, float(np.abs((first - second) / scale).max()))
    return exited, absorbed, exitance


def root_mean_square(solution: Solution) -> float:
    """Of the exitance over the surface, W/unit²."""
    areas = solution.mesh.boundary_node_areas
    return float(np.sqrt(areas @ solution.exitance**2 / areas.sum()))


def from_closed_form(written: Written, light: Light, solution: Solution) -> float:
    """How far exited power is from that of the plate without end, 0 where there is no closed form."""
    if not written.layers or not isinstance(light, PointSource):
        return 0.0
    media, thicknesses = zip(*written.layers, strict=True)
    depth = -light.position[2]
    both = [layered.point_total(media, thicknesses, depth=depth, face=face) for face in ("front", "back")]
    return abs(float(solution.power.exited) / sum(both) - 1.0)


def scenes(wanted: list[str]) -> Iterator[tuple[str, str]]:
    """Names of bodies and lights."""
    unknown = [name for name in wanted if name not in (*BODIES, *LIGHTS)]
    if unknown:
        sys.exit(f"there is no body and no light {unknown[0]!r}; there are: {', '.join((*BODIES, *LIGHTS))}")
    for body in BODIES:
        for light in LIGHTS:
            if not wanted or body in wanted or light in wanted:
                yield body, light


def main(wanted: list[str]) -> int:
    """Print the table; 1 if ways of writing a scene disagree."""
    started, failed, count = time.perf_counter(), 0, 0
    known: dict[str, Written] = {}
    print("| body | light | ways | exited | absorbed | exitance | agree |\n|---|---|---|---|---|---|---|")
    for body, light in scenes(wanted):
        written = known.get(body) or BODIES[body]()
        known[body] = written
        ways = list(written.ways.values())
        if light == "emission" and any(way.layer is not None for way in ways):
            # A medium that varies has no region that could glow.
            ways = [way for way in ways if way.layer is not None]
        lights = [LIGHTS[light](way) for way in ways]
        solutions = [
            solve(
                written.surface,
                way.medium,
                [one],
                regions=way.regions,
                tolerance=TOLERANCE,
                most_tetrahedra=MOST_TETRAHEDRA.get(light, 200_000),
            )
            for way, one in zip(ways, lights, strict=True)
        ]
        found = differences(solutions)
        off = from_closed_form(written, lights[0], solutions[0])
        agree = max(*found, off) <= 2.0 * TOLERANCE
        failed, count = failed + (not agree), count + 1
        figures = " | ".join(f"{100 * value:.2f} %" for value in found)
        print(f"| {body} | {light} | {len(solutions)} | {figures} | {'yes' if agree else 'NO'} |", flush=True)
    print(f"\n{count - failed} of {count} scenes agree within {2 * TOLERANCE:.0%}.")
    print(f"Made in {time.perf_counter() - started:.0f} s.", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
