"""A scene of the chart: a case, the places where its exitance is measured, and what it truly is there."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tetlux.cases.case import Case
from tetlux.cases.chart.measure import relative_error, surface_samples
from tetlux.cases.compare.comparison import are_points, comparison_for
from tetlux.cases.document import read_document
from tetlux.cases.schema import CaseSpec, SurfaceSpec
from tetlux.fem.grading import lit_points
from tetlux.fem.lights import Deposit
from tetlux.fem.medium import Medium
from tetlux.fem.solution import Solution
from tetlux.fem.solve import solve
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError, RunError

# The far finer run that is the reference where there is no closed form: the first of these tolerances that is met,
# or else the run that came closest.
REFERENCE_TOLERANCES, REFERENCE_TETRAHEDRA = (0.001, 0.002, 0.005), 500_000
QUICK_TOLERANCES = (0.01,)
# Other programs of the machine disturb a run: a short one is made so many times.
REPEATS = 3
# What is measured against such a reference is asked for no less than so many times the reference's own error.
COARSER = 3.0


@dataclass(frozen=True, eq=False)
class Samples:
    """Points on a surface (n, 3), outward unit normals there (n, 3), and the areas they stand for (n,), unit²."""

    points: FloatArray
    normals: FloatArray
    weights: FloatArray


@dataclass(frozen=True, eq=False)
class Reference:
    """What the exitance truly is.

    Attributes
    ----------
    kind : {"closed form", "finer run"}
    told : str
        What it is, for people.
    exitance : (n,) ndarray
        At the samples, W/unit².
    error : float
        What is known of its own relative L2 error; 0 for a closed form.
    """

    kind: str
    told: str
    exitance: FloatArray
    error: float = 0.0


@dataclass(frozen=True, eq=False)
class Scene:
    """A case that methods are measured on.

    Attributes
    ----------
    case : Case
    shape : SurfaceSpec
        What the case file says of the surface.
    deposits : list of Deposit
    samples : Samples
        Where exitance is compared.
    reference : Reference
    repeats : int
        How often a short run is made at most; the quickest counts.
    """

    case: Case
    shape: SurfaceSpec
    deposits: list[Deposit]
    samples: Samples
    reference: Reference
    repeats: int = 1

    @property
    def lit(self) -> tuple[FloatArray, FloatArray]:
        """See `tetlux.fem.grading.lit_points`."""
        return lit_points(self.deposits, self.case.medium)

    @property
    def sources(self) -> list[tuple[FloatArray, float]]:
        """Positions (3,) and powers, W, of all points where light is deposited."""
        return [(point, float(power)) for d in self.deposits for point, power in zip(d.points, d.powers, strict=True)]

    @property
    def in_points(self) -> bool:
        """Whether all light is deposited in points."""
        return are_points(self.deposits)

    def error_of(self, exitance: FloatArray) -> float:
        """Relative L2 error of an exitance (n,) at the samples."""
        return relative_error(exitance, self.reference.exitance, self.samples.weights)


def spec_of(case: Case) -> CaseSpec:
    """What the case file says."""
    return CaseSpec.model_validate(read_document(case.source).data)


def scene_of(case: Case, *, quick: bool = False) -> Scene:
    """Take samples of a case, and find out what is true there.

    Raises
    ------
    RunError
        If the run that is to be the reference fails, no light leaves the body, or it is of several media.
    """
    if not case.is_simple:
        raise RunError("a chart is of one channel and one even medium; leave lists, regions and fields out.")
    shape = spec_of(case).surface
    surface, medium = case.surface, case.medium
    deposits = [light.deposit_in(surface, medium) for light in case.lights]
    samples = Samples(*surface_samples(surface, *lit_points(deposits, medium)))
    measured = _in_closed_form(shape, medium, deposits, samples)
    if measured is None:
        # A surface is more than its triangles where these stand for a curve.
        samples = replace(samples, points=surface.project(samples.points)[0])
        measured = samples, _finer_run(case, samples, quick)
    if not measured[1].exitance.max(initial=0.0) > 0:
        raise RunError("no light leaves the body, so there is nothing to measure.")
    return Scene(case, shape, deposits, *measured, 1 if quick else REPEATS)


def _in_closed_form(
    shape: SurfaceSpec, medium: Medium, deposits: list[Deposit], samples: Samples
) -> tuple[Samples, Reference] | None:
    """None if there is none for this shape or light, or a source is too near to where it does not hold."""
    known = CLOSED_FORMS.get(shape.kind)
    try:
        return known(shape, medium, deposits, samples) if known else None
    except InputError:
        return None


def _finer_run(case: Case, samples: Samples, quick: bool) -> Reference:
    best: Solution | None = None
    for tolerance in QUICK_TOLERANCES if quick else REFERENCE_TOLERANCES:
        solution = solve(
            case.surface,
            case.medium,
            case.lights,
            tolerance=tolerance,
            most_tetrahedra=REFERENCE_TETRAHEDRA,
            cache=False,
        )
        if best is None or solution.error_estimate < best.error_estimate:
            best = solution
        if best.error_estimate <= tolerance:
            break
    assert best is not None
    told = f"tetlux itself on {len(best.mesh.tetrahedra):,} tetrahedra, estimated error {best.error_estimate:.2%}"
    return Reference("finer run", told, best.exitance_at(samples.points), best.error_estimate)


def _on_sphere(
    shape: SurfaceSpec, medium: Medium, deposits: list[Deposit], samples: Samples
) -> tuple[Samples, Reference]:
    """The whole sphere, the true one."""
    assert shape.sphere is not None
    comparison = comparison_for(shape, medium, deposits, ["series"])
    on_it = on_true_sphere(samples, np.asarray(shape.sphere.center), shape.sphere.radius)
    told = "the same equation and boundary on the true sphere, solved in closed form"
    return on_it, Reference("closed form", told, comparison.forms["series"](on_it.points))


def on_true_sphere(samples: Samples, center: FloatArray, radius: float) -> Samples:
    """Samples of the triangles of a sphere, taken to the sphere itself."""
    distances = np.linalg.norm(samples.points - center, axis=1)
    outward = (samples.points - center) / distances[:, None]
    # The solid angles of the pieces of triangles.
    seen = np.einsum("ij,ij->i", outward, samples.normals) * (radius / distances) ** 2
    return Samples(center + radius * outward, outward, samples.weights * seen)


def _on_slab(
    shape: SurfaceSpec, medium: Medium, deposits: list[Deposit], samples: Samples
) -> tuple[Samples, Reference]:
    """Both faces, as far from the rim as the endless slab of the closed form is the same body."""
    assert shape.slab is not None
    depth = shape.slab.depth
    turned = [replace(d, points=d.points * [1.0, 1.0, -1.0] - [0.0, 0.0, depth]) for d in deposits]
    parts, exitance = [], []
    for face, sources in ((1.0, deposits), (-1.0, turned)):
        comparison = comparison_for(shape, medium, sources, ["robin"])
        points = samples.points if face > 0 else samples.points * [1.0, 1.0, -1.0] - [0.0, 0.0, depth]
        here = comparison.where(points) & (face * samples.normals[:, 2] > 0.5)
        parts.append(Samples(samples.points[here], samples.normals[here], samples.weights[here]))
        exitance.append(comparison.forms["robin"](points[here]))
    both = Samples(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("points", "normals", "weights")))
    told = "the same equation and boundary on the endless slab, solved in closed form; both faces, away from the rim"
    return both, Reference("closed form", told, np.concatenate(exitance))


# Where the exitance of a whole body is known in closed form: its samples, and the reference at them.
CLOSED_FORMS: dict[str, Callable[[SurfaceSpec, Medium, list[Deposit], Samples], tuple[Samples, Reference]]] = {
    "sphere": _on_sphere,
    "slab": _on_slab,
}
