"""A run held against closed forms: which, where, and by how much it differs."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tetlux.cases.schema import ClosedForm, SurfaceSpec
from tetlux.fem.exact import cylinder, dipole, half_space, slab, sphere
from tetlux.fem.lights import Deposit
from tetlux.fem.medium import Medium
from tetlux.fem.solution import Solution
from tetlux.meshing.arrays import BoolArray, FloatArray
from tetlux.meshing.errors import InputError, RunError

FOR_SHAPES: dict[str, tuple[ClosedForm, ...]] = {
    "slab": ("robin", "images", "dipole"),
    "sphere": ("series",),
    "cylinder": ("series",),
}
# What each closed form is, and what a difference from the finite elements therefore means.
MEANINGS: dict[ClosedForm, str] = {
    "robin": "the same equation and boundary on the infinite slab, solved exactly: the difference is discretisation",
    "images": "the slab with fluence zero on extrapolated planes (Contini 1997): beyond discretisation, the difference "
    "is the boundary model",
    "dipole": "the dipole, a half-space with fluence zero on an extrapolated plane (Farrell 1992), with this medium's "
    "A (classic for the published curve): beyond discretisation, the difference is the boundary model and the slab's "
    "other face",
    "series": "the same equation and boundary, solved exactly: the difference is discretisation",
}
# Relative differences are taken where the closed form is above this share of its largest value.
FLOOR = 1e-6
# Below this an exitance is lost to arithmetic, W/unit².
DARK = 1e-200

Field = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class Comparison:
    """Closed forms for one case.

    Attributes
    ----------
    coordinate : str
        Name of what exitance is drawn against, with its unit.
    along : callable
        That coordinate of points (n, 3).
    where : callable
        Which points (n, 3) the closed forms hold at.
    forms : dict
        Exitance at points (n, 3) by each closed form, W/unit².
    note : str
        What all of them leave out.
    single_valued : bool
        Whether the coordinate alone determines the exitance, so that closed forms are lines over it.
    """

    coordinate: str
    along: Field
    where: Callable[[FloatArray], BoolArray]
    forms: dict[ClosedForm, Field]
    note: str
    single_valued: bool


@dataclass(frozen=True, eq=False)
class Compared:
    """Finite elements beside closed forms, at the boundary nodes where these hold, in order of the coordinate.

    Attributes
    ----------
    coordinate : str
    along, exitance : (n,) ndarray
    forms : dict of (n,) ndarray
    differences : dict
        By closed form: ``l2``, relative, weighted by area; ``largest``, relative at a node; and ``at``.
    """

    coordinate: str
    along: FloatArray
    exitance: FloatArray
    forms: dict[ClosedForm, FloatArray]
    differences: dict[ClosedForm, dict[str, float]]
    note: str
    single_valued: bool


def are_points(deposits: list[Deposit]) -> bool:
    """Whether all light is deposited in points."""
    return not any(len(d.points) == 0 or len(d.starts) or d.on_mesh is not None for d in deposits)


def comparison_for(shape: SurfaceSpec, medium: Medium, deposits: list[Deposit], names: list[ClosedForm]) -> Comparison:
    """Closed forms of a built-in shape under point deposits.

    Raises
    ------
    InputError
        If there is none for this shape or this light.
    """
    kind = shape.kind
    known = FOR_SHAPES.get(kind, ())
    for name in names:
        if name not in known:
            have = f"for a {kind} there is {', '.join(known)}" if known else f"there is none for a {kind}"
            raise InputError(f'"{name}" is no closed form here; {have}.')
    if not are_points(deposits):
        raise InputError(
            'closed forms here are those of point sources; give pencil beams deposit: "point", and no diffuse light, '
            "beams of another kind or emission."
        )
    sources = np.vstack([d.points for d in deposits])
    powers = np.concatenate([d.powers for d in deposits])
    if shape.slab:
        found = _slab(shape.slab.width, shape.slab.depth, medium, sources, powers, names)
        sample = np.array([[0.0, 0.0, 0.0]])
    elif shape.sphere:
        center, radius = np.asarray(shape.sphere.center), shape.sphere.radius
        found = _sphere(radius, center, medium, sources, powers)
        sample = center[None] + [radius, 0.0, 0.0]
    else:
        assert shape.cylinder is not None
        center, radius = np.asarray(shape.cylinder.center), shape.cylinder.radius
        found = _cylinder(radius, shape.cylinder.height, center, medium, sources, powers)
        sample = center[None] + [radius, 0.0, 0.0]
    # A closed form that cannot be had for this source says so now, not after the run.
    for form in found.forms.values():
        form(sample)
    from_beam = any(d.specular > 0 or d.absorbed > 0 for d in deposits)
    note = "All use the same sources, isotropic points."
    return replace(found, note=f"{note} {source_model(medium)}" if from_beam else note)


def compare(comparison: Comparison, solution: Solution) -> Compared:
    """Hold a solution against closed forms at its boundary nodes.

    Raises
    ------
    RunError
        If there is nothing to compare: no node where the closed forms hold, or no light at them.
    """
    points = solution.mesh.boundary_points
    here = np.flatnonzero(comparison.where(points))
    along = comparison.along(points[here])
    here, along = here[np.argsort(along)], np.sort(along)
    exitance = solution.exitance[here]
    weights = solution.mesh.boundary_node_areas[here]
    forms = {name: form(points[here]) for name, form in comparison.forms.items()}
    differences = {}
    for name, truth in forms.items():
        largest = float(truth.max(initial=0.0))
        if not largest > DARK:
            raise RunError(
                f'compare: the closed form "{name}" has no light at the nodes where it holds; leave compare out.'
            )
        counted = truth > FLOOR * truth.max()
        relative = np.where(counted, exitance / np.where(counted, truth, 1.0) - 1.0, 0.0)
        worst = int(np.abs(relative).argmax())
        differences[name] = {
            "l2": float(math.sqrt(weights @ ((exitance - truth) / largest) ** 2 / (weights @ (truth / largest) ** 2))),
            "largest": float(relative[worst]),
            "at": float(along[worst]),
        }
    return Compared(
        comparison.coordinate, along, exitance, forms, differences, comparison.note, comparison.single_valued
    )


def source_model(medium: Medium) -> str:
    """What the choice of isotropic points for a beam's deposit is worth, by closed forms of the half-space."""
    rho = medium.mean_free_path * np.linspace(1.0, 10.0, 200)
    point = medium.albedo * half_space.point_exitance(medium, depth=medium.mean_free_path, rho=rho)
    line = half_space.pencil_exitance(medium, rho=rho)
    change = math.sqrt((rho @ (line - point) ** 2) / (rho @ point**2))
    return (
        "A pencil beam that fades along a line (delta-Eddington) instead would change the exitance of a half-space of "
        f"this medium by {change:.1%} in L2, between one and ten mean free paths from the entry."
    )


def as_json(compared: Compared) -> dict[str, Any]:
    """A comparison as plain data."""
    return {
        "coordinate": compared.coordinate,
        "differences": {
            name: {**difference, "meaning": MEANINGS[name]} for name, difference in compared.differences.items()
        },
        "note": compared.note,
        "along": compared.along.tolist(),
        "fem": compared.exitance.tolist(),
        "closed_forms": {name: values.tolist() for name, values in compared.forms.items()},
    }


def _slab(
    width: float,
    thickness: float,
    medium: Medium,
    sources: FloatArray,
    powers: FloatArray,
    names: list[ClosedForm],
) -> Comparison:
    """The upper face, away from the rim, where the slab of the closed forms goes on."""

    def summed(one: Callable[[float, FloatArray], FloatArray]) -> Field:
        def form(points: FloatArray) -> FloatArray:
            total = np.zeros(len(points))
            for source, power in zip(sources, powers, strict=True):
                total += power * one(-float(source[2]), np.hypot(*(points[:, :2] - source[:2]).T))
            return total

        return form

    forms: dict[ClosedForm, Field] = {
        "robin": summed(lambda depth, rho: slab.point_exitance(medium, thickness=thickness, depth=depth, rho=rho)),
        "images": summed(lambda depth, rho: slab.extrapolated_flux(medium, thickness=thickness, depth=depth, rho=rho)),
        "dipole": summed(lambda depth, rho: dipole.flux(medium, depth=depth, rho=rho)),
    }
    # Light spreads along the slab like its slowest mode; what the rim takes has faded by exp(-4) there and back.
    decay = math.hypot(medium.sigma_tr, math.pi / (thickness + 2.0 * medium.extrapolation_length))
    rim = 2.0 / decay
    _check_room("rim", 0.5 * width - rim, np.abs(sources[:, :2]).max(), rim)
    first = sources[0, :2]

    def where(points: FloatArray) -> BoolArray:
        return np.asarray((points[:, 2] > -1e-9 * width) & (np.abs(points[:, :2]).max(axis=1) < 0.5 * width - rim))

    return Comparison(
        "distance from the source along the face",
        lambda points: np.hypot(*(points[:, :2] - first).T),
        where,
        {name: forms[name] for name in names},
        "",
        single_valued=len(np.unique(sources[:, :2].round(9), axis=0)) == 1,
    )


def _check_room(side: str, room: float, farthest: float, margin: float) -> None:
    """Refuse a source so near to the end of the body that the endless one of the closed form is another body."""
    if farthest > room:
        raise InputError(
            f"the light is deposited less than {margin:.3g} from the body's {side}, where the endless one of the "
            "closed form is another; move the light, make the body larger, or leave compare out."
        )


def _sphere(radius: float, center: FloatArray, medium: Medium, sources: FloatArray, powers: FloatArray) -> Comparison:
    def angle(points: FloatArray, source: FloatArray) -> FloatArray:
        axis = source - center
        length = float(np.linalg.norm(axis))
        # A source in the middle shines alike everywhere.
        axis = axis / length if length > 0 else np.array([0.0, 0.0, 1.0])
        directions = points - center
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        # Accurate near 0 and pi, where the arc cosine is not.
        across = np.linalg.norm(np.cross(directions, axis), axis=1)
        return np.asarray(np.arctan2(across, directions @ axis))

    def series(points: FloatArray) -> FloatArray:
        total = np.zeros(len(points))
        for source, power in zip(sources, powers, strict=True):
            source_radius = float(np.linalg.norm(source - center))
            gamma = angle(points, source)
            total += power * sphere.point_exitance(medium, radius=radius, source_radius=source_radius, gamma=gamma)
        return total

    return Comparison(
        "angle from the source, °",
        lambda points: np.degrees(angle(points, sources[0])),
        lambda points: np.ones(len(points), dtype=bool),
        {"series": series},
        "",
        single_valued=len(sources) == 1,
    )


def _cylinder(
    radius: float, height: float, center: FloatArray, medium: Medium, sources: FloatArray, powers: FloatArray
) -> Comparison:
    """The side, away from the ends, where the cylinder of the closed form goes on."""

    def series(points: FloatArray) -> FloatArray:
        total = np.zeros(len(points))
        x = points - center
        for source, power in zip(sources - center, powers, strict=True):
            theta = np.arctan2(x[:, 1], x[:, 0]) - math.atan2(source[1], source[0])
            total += power * cylinder.point_exitance(
                medium,
                radius=radius,
                source_radius=float(np.hypot(source[0], source[1])),
                theta=theta,
                z=x[:, 2] - source[2],
            )
        return total

    # As for the slab; 2.405 is the first zero of J_0.
    end = 2.0 / math.hypot(medium.sigma_tr, 2.405 / (radius + medium.extrapolation_length))
    _check_room("end", 0.5 * height - end, np.abs(sources[:, 2] - center[2]).max(), end)

    def where(points: FloatArray) -> BoolArray:
        x = points - center
        return (np.abs(x[:, 2]) < 0.5 * height - end) & (np.hypot(x[:, 0], x[:, 1]) > 0.98 * radius)

    return Comparison(
        "distance from the source",
        lambda points: np.linalg.norm(points - sources[0], axis=1),
        where,
        {"series": series},
        "",
        single_valued=len(sources) == 1 and float(np.hypot(*(sources[0] - center)[:2])) < 1e-9 * radius,
    )
