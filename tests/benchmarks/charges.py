"""Charges fitted to the boundary: how good, how fast, and are they honest? ``python -m tests.benchmarks.charges``.

Without arguments: a pencil beam as a point on each body, with 100, 300 and 800 charges. `--scenes N` draws N scenes,
300 charges each: a body, a source .3 to 10 mean free paths below a random point of it, albedo .8 to .9999, index 1 to
1.5, the body 10 to 80 mean free paths across. Further arguments are files of surfaces, which join the bodies. Scenes
with an estimate that is not .5 to 4 times the error, or a bound below it, are listed at the end, as are those whose
truth is not known well enough to tell.

`--fitted` prints what finite elements do with fitted charges subtracted, beside the half-space: on a mesh that is
cached, as seconds are only those of this process; the truth is that of fitted charges on a mesh of 25,000 nodes and
more, whose estimate is printed.

Seconds are of the processor, of all threads, the least of three runs, from a surface whose trees are built. The truth
is the series for balls, and elsewhere the same method with as many charges as `--truth` says. It is known to within
the difference of the two best fits, whose charges are placed independently; there are more charges, up to `MOST_TRUTH`,
while that is more than `KNOWN_SHARE` of the error.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tetlux.fem import Medium, PencilBeam, PointSource, solve
from tetlux.fem.body.body import Body
from tetlux.fem.charges.adapt import COUNT_FACTOR, FittedCharges, LightSources, fit_charges, fit_sequence
from tetlux.fem.charges.check import norm
from tetlux.fem.charges.kernel import equation_of
from tetlux.fem.charges.placement import distance_from
from tetlux.fem.charges.samples import Samples, cells_of, draw
from tetlux.fem.charges.samples import scaled as scaled_spacing
from tetlux.fem.exact import sphere as exact_sphere
from tetlux.fem.known.split import Subtract
from tetlux.meshing import Surface, box, cylinder, read_surface, refine, slab, sphere, tetrahedralize, torus
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.repair.pipeline import surface_from_arrays
from tetlux.meshing.surface.triangles import triangle_areas

TISSUE = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
DARKER = Medium(sigma_a=0.02, sigma_s_prime=1.0, eta=1.4)
# Nodes of the mesh of the truth.
FINE = 25_000
# Charges of the truth at most, and how well it has to be known, as a share of the error.
MOST_TRUTH, KNOWN_SHARE = 3_000, 0.5
HARE = Path(__file__).parents[2] / "cases" / "library" / "hare.stl"


@dataclass(frozen=True, eq=False)
class Scene:
    """A body, a medium and a point source; the radius of a ball, whose source lies on the z axis."""

    name: str
    surface: Surface
    medium: Medium
    source: FloatArray
    radius: float | None = None

    def fit(self, charges: int) -> FittedCharges:
        """About so many charges."""
        lights = LightSources(self.source, np.ones((1, 1)), np.zeros(1))
        return fit_charges(self.surface, equation_of(self.medium), lights, tolerance=0.0, most=charges)

    def truth_at(self, samples: Samples, charges: int) -> tuple[FloatArray, float]:
        """The exitance at samples, and within which relative L2 error it is known."""
        points = samples.points
        if self.radius is not None:
            gamma, depth = np.arctan2(np.hypot(points[:, 0], points[:, 1]), points[:, 2]), float(self.source[0, 2])
            found = exact_sphere.point_exitance(self.medium, radius=self.radius, source_radius=depth, gamma=gamma)
            return found, 0.0
        lights = LightSources(self.source, np.ones((1, 1)), np.zeros(1))
        fits = list(fit_sequence(self.surface, equation_of(self.medium), lights, most=charges))
        best, second = sorted(fits, key=lambda fit: fit.errors.estimate)[:2]
        right = best.field.exitance(points)[:, 0]
        apart = norm(samples.areas, second.field.exitance(points)[:, 0] - right)
        return right, apart / norm(samples.areas, right)


def lit(name: str, surface: Surface, medium: Medium, beam: PencilBeam, radius: float | None = None) -> Scene:
    """A pencil beam as a point."""
    return Scene(name, surface, medium, beam.deposit_in(Body(surface, (medium,))).terms.points, radius)


def named(files: list[str]) -> list[Scene]:
    """The bodies of the table."""
    down = PencilBeam((0, 0, 100), (0, 0, -1))
    hare = read_surface(HARE)
    scenes = [
        lit("ball 10", sphere(10.0), TISSUE, down, 10.0),
        lit("ball 30", sphere(30.0), TISSUE, down, 30.0),
        lit("torus", torus(10.0, 4.0), TISSUE, PencilBeam((25, 0, 15), (-1, 0, -1))),
        lit("box", box((20.0, 20.0, 20.0)), TISSUE, PencilBeam((3, 2, 20), (0, 0, -1))),
        lit("cylinder", cylinder(5.0, 20.0), DARKER, PencilBeam((20, 0, 1), (-1, 0, 0))),
        lit("hare, ear", hare, TISSUE, PencilBeam((2, -30, 30), (0.08, 1, -0.1))),
        lit("hare, back", hare, TISSUE, PencilBeam((-40, 0, 12), (1, 0, 0))),
        lit("hare, side", hare, TISSUE, PencilBeam((0, -30, 10), (0, 1, 0))),
    ]
    for file in files:
        surface = scaled(read_surface(file))
        middles = surface.points[surface.faces].mean(axis=1)
        for axis in range(3):
            direction = -np.eye(3)[axis]
            # Aimed at the triangle nearest to the middle.
            away = np.linalg.norm(np.delete(middles - middles.mean(axis=0), axis, axis=1), axis=1)
            start = middles[away.argmin()] - 30.0 * direction
            beam = PencilBeam(tuple(start.tolist()), tuple(direction.tolist()))
            scenes.append(lit(f"{Path(file).stem} from {'xyz'[axis]}", surface, TISSUE, beam))
    return scenes


def scaled(surface: Surface) -> Surface:
    """The same, 26 mm from corner to corner."""
    return surface_from_arrays(surface.points * (26.0 / surface.diagonal), surface.faces, name=surface.name)


def ellipsoid(axes: FloatArray) -> Surface:
    """A sphere stretched along its axes."""
    ball = sphere(1.0)
    return surface_from_arrays(ball.points * axes, ball.faces, name="ellipsoid")


def random_scenes(count: int, files: list[str], first: int) -> Iterator[Scene]:
    """Scenes drawn from their numbers, so that one of them can be looked at again."""
    hare, others = read_surface(HARE), [read_surface(file) for file in files]
    bodies: list[Callable[[np.random.Generator], Surface]] = [
        lambda _: sphere(1.0),
        lambda rng: ellipsoid(rng.uniform(0.4, 1.0, 3)),
        lambda rng: torus(1.0, rng.uniform(0.2, 0.7)),
        lambda rng: box(tuple(rng.uniform(0.3, 1.0, 3))),
        lambda rng: cylinder(1.0, rng.uniform(0.5, 5.0)),
        lambda rng: slab(1.0, rng.uniform(0.1, 0.3)),
        lambda _: hare,
        *(lambda _, surface=surface: surface for surface in others),
    ]
    for number in range(first, first + count):
        rng = np.random.default_rng(number)
        surface = bodies[number % len(bodies)](rng)
        albedo, eta = 1.0 - 10.0 ** rng.uniform(-4.0, np.log10(0.2)), rng.uniform(1.0, 1.5)
        free_path = surface.diagonal / 10.0 ** rng.uniform(1.0, np.log10(80.0))
        medium = Medium(sigma_a=(1.0 - albedo) / free_path, sigma_s_prime=albedo / free_path, eta=eta)
        ball = number % len(bodies) == 0
        depth, source = 0.0, np.zeros((1, 3))
        while not depth:
            depth = free_path * 10.0 ** rng.uniform(np.log10(0.3), 1.0)
            source = np.array([[0.0, 0.0, 1.0 - depth]]) if ball else below(surface, depth, rng)
            away = float(np.linalg.norm(surface.closest(source)[0] - source))
            # Not through the other side, nor much nearer to it.
            if not surface.contains(source)[0] or away < 0.7 * depth or (ball and depth > 1.0):
                depth = 0.0
        name = f"{number} {surface.name}, albedo {albedo:.4f}, n {eta:.2f}, "
        name += f"{surface.diagonal / free_path:.0f} mfp across, source {depth / free_path:.2g} deep"
        yield Scene(name, surface, medium, source, 1.0 if ball else None)


def below(surface: Surface, depth: float, rng: np.random.Generator) -> FloatArray:
    """A point so deep below a random one of the surface, (1, 3)."""
    areas = triangle_areas(surface.points, surface.faces)[1]
    face = np.array([rng.choice(len(areas), p=areas / areas.sum())])
    flat = np.einsum("i,ij->j", rng.dirichlet([1.0, 1.0, 1.0]), surface.points[surface.faces[face[0]]])
    point, normal = surface.on_curve(face, flat[None])
    return np.asarray(point - depth * normal)


@dataclass(frozen=True)
class Row:
    """A line of the table; estimate, bound and what the truth is known to as multiples of the error."""

    text: str
    estimate: float
    bound: float
    known: float

    @property
    def is_missed(self) -> bool:
        """Whether the estimate or the bound is not what it should be."""
        return not 0.5 <= self.estimate <= 4.0 or self.bound < 1.0


def row(scene: Scene, charges: int, truth: int, repeats: int) -> Row:
    """Fit charges to a scene, and compare with the truth."""
    scene.surface.rays.first(scene.source, np.array([[0.0, 0.0, 1.0]]))
    scene.surface.project(scene.source)
    seconds = []
    for _ in range(repeats):
        started = time.process_time()
        fitted = scene.fit(charges)
        seconds.append(time.process_time() - started)
    samples, errors = fitted.placement.checked, fitted.errors
    exitance = fitted.field.exitance(samples.points)[:, 0]
    while True:
        right, known = scene.truth_at(samples, truth)
        size = norm(samples.areas, right)
        error = norm(samples.areas, exitance - right) / size
        truth = round(COUNT_FACTOR * truth)
        if known <= KNOWN_SHARE * error or truth > MOST_TRUTH:
            break
    bright = right > 1e-6 * right.max()
    faint = bright & (right < 0.01 * right.max())
    off = np.abs(exitance - right)
    median = float(np.median(off[faint] / right[faint])) if faint.any() else 0.0
    columns = [scene.name, str(len(fitted.placement.charges)), f"{min(seconds):.2f}", f"{error:.4%}"]
    columns += [f"{errors.estimate:.4%}", f"{errors.estimate / error:.2f}"]
    columns += [f"{errors.bound:.3%}", f"{errors.bound / error:.1f}", f"{known:.4%}"]
    columns += [f"{median:.2%}", f"{(off[bright] / right[bright]).max():.1%}"]
    text = "| " + " | ".join(columns) + " |"
    return Row(text, errors.estimate / error, errors.bound / error, known / error)


def fitted_rows(scene: Scene) -> Iterator[str]:
    """Lines of the table of finite elements, with fitted charges subtracted and with the half-space."""
    light, mesh = PointSource(tuple(scene.source[0].tolist())), tetrahedralize(scene.surface)
    distance = distance_from(scene.surface, scene.source)
    spacing = scaled_spacing(distance, 0.2)
    samples = draw(cells_of(scene.surface, spacing), np.random.default_rng(3))
    if scene.radius is None:
        while len(mesh.points) < FINE:
            mesh = refine(mesh, np.ones(len(mesh.tetrahedra), dtype=bool), scene.surface)
        best = solve(scene.surface, scene.medium, [light], mesh=mesh, tolerance=0.0005)
        right, known = best.exitance_on(samples.points), best.error_estimate
    else:
        right, known = scene.truth_at(samples, 0)
    faint = (right < 0.01 * right.max()) & (right > 1e-6 * right.max())
    ways: list[tuple[Subtract, float]] = [("fitted", t) for t in (0.02, 0.005)]
    ways += [("half-space", t) for t in (0.02, 0.005, 0.002)]
    for subtract, tolerance in ways:
        seconds = []
        for _ in range(2):
            started = time.process_time()
            solution = solve(scene.surface, scene.medium, [light], tolerance=tolerance, subtract=subtract)
            seconds.append(time.process_time() - started)
        off = np.abs(solution.exitance_on(samples.points) - right)
        error = norm(samples.areas, off) / norm(samples.areas, right)
        charges = sum(len(patch.charges.positions) for patch in solution.patches)
        yield (
            f"| {scene.name} | {subtract} | {tolerance} | {charges} | {len(solution.mesh.points):,} | "
            f"{min(seconds):.2f} | {error:.3%} | {solution.error_estimate / error:.2f} | "
            f"{np.median(off[faint] / right[faint]):.2%} | {known:.3%} |"
        )


HEAD = """| body | charges | seconds | error | estimate | over error | bound | over error | truth known to | \
median error below 1 % of the brightest | worst within six decades |
|---|---|---|---|---|---|---|---|---|---|---|"""


def main() -> None:
    """Print the table asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=0)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--truth", type=int, default=1600)
    parser.add_argument("--charges", type=int, nargs="+", default=[100, 300, 800])
    parser.add_argument("files", nargs="*")
    parser.add_argument("--fitted", action="store_true")
    given = parser.parse_args()
    if given.fitted:
        print(
            "| body | subtracted | tolerance | charges | nodes | seconds | error | estimate over error | "
            "median error below 1 % of the brightest | estimate of truth |"
        )
        print("|---|---|---|---|---|---|---|---|---|---|")
        for scene in named(given.files):
            for text in fitted_rows(scene):
                print(text, flush=True)
        return
    print(HEAD)
    if not given.scenes:
        for scene in named(given.files):
            for charges in given.charges:
                print(row(scene, charges, given.truth, 3).text, flush=True)
        return
    rows = []
    for scene in random_scenes(given.scenes, given.files, given.first):
        rows.append(row(scene, 300, given.truth, 1))
        print(rows[-1].text, flush=True)
    report(rows)


def report(rows: list[Row]) -> None:
    """Print what random scenes are together."""
    estimates = np.array([each.estimate for each in rows])
    bounds = np.array([each.bound for each in rows])
    print(f"estimate over error: {np.quantile(estimates, [0.0, 0.05, 0.5, 0.95, 1.0]).round(2)}")
    print(f"bound over error: least {bounds.min():.2f}, median {np.median(bounds):.1f}")
    print(f"estimate not within .5 to 4, or bound below 1: {sum(each.is_missed for each in rows)} of {len(rows)}")
    for each in rows:
        if each.is_missed or each.known > KNOWN_SHARE:
            known = f"truth known to {each.known:.2g} of the error"
            print(f"  {'missed' if each.is_missed else 'in doubt'}, {known}: {each.text}")


if __name__ == "__main__":
    main()
