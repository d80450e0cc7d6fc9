"""`Comparison`: the closed forms that a run is compared with, and the coordinate that they are drawn over."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.fem.exact import half_space
from tetlux.fem.exact.registry import ClosedForm, IdealSources, closed_forms, ideal_sources, polar_angle
from tetlux.fem.lights import Deposit
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import BoolArray, FloatArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.solids import Cylinder, Shape, Slab, Sphere

# Names of the closed forms of each shape.
NAMES: dict[type, tuple[str, ...]] = {
    Slab: ("robin", "images", "dipole"),
    Sphere: ("series",),
    Cylinder: ("series",),
}


@dataclass(frozen=True, eq=False)
class Coordinate:
    """The coordinate that exitance is drawn over.

    Attributes
    ----------
    name : str
        With its unit, unless that is the case's unit of length.
    along : callable
        Maps points (n, 3) to its values (n,).
    single_valued : bool
        Whether the exitance is a function of this coordinate alone, so that closed forms are drawn as lines.
    """

    name: str
    along: Callable[[FloatArray], FloatArray]
    single_valued: bool


@dataclass(frozen=True, eq=False)
class Comparison:
    """The closed forms that one case is compared with.

    Attributes
    ----------
    coordinate : Coordinate
    forms : dict of str to ClosedForm
    holds_at : callable
        Maps points (n, 3) to whether they are compared, (n,).
    note : str
        An assumption that all the closed forms share.
    """

    coordinate: Coordinate
    forms: dict[str, ClosedForm]
    holds_at: Callable[[FloatArray], BoolArray]
    note: str


def comparison_for(shape: Shape | None, medium: Medium, deposits: list[Deposit], names: Sequence[str]) -> Comparison:
    """Choose the closed forms of a built-in shape with point sources.

    Parameters
    ----------
    shape : Sphere, Slab, Cylinder or another, optional
        ``surface.shape`` of the body.
    medium : Medium
        The medium of the whole body.
    deposits : list of Deposit
        The deposits of the lights.
    names : sequence of str
        Names of the closed forms that are wanted.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        If there is no such closed form for this shape or these lights.
    """
    _check_names(shape, names)
    sources = ideal_sources(deposits)
    if sources is None or not sources.are_points:
        raise InputError(
            'closed forms exist for point sources only; give point sources, or pencil beams with deposit: "point", '
            "or leave compare out."
        )
    try:
        known = closed_forms(shape, medium, deposits)
    except InputError as error:
        if error.remedy is None:
            raise
        raise InputError(error.text, remedy=f"{error.remedy}, or leave compare out") from error
    forms = {name: known[name] for name in names}
    scattered_from_beam = any(d.ledger.specular > 0 or d.ledger.absorbed > 0 for d in deposits)
    note = "All use the same sources, isotropic points."
    return Comparison(
        _coordinate(shape, sources),
        forms,
        _places_to_compare(shape, list(forms.values())),
        f"{note} {describe_source_model(medium)}" if scattered_from_beam else note,
    )


def _check_names(shape: Shape | None, names: Sequence[str]) -> None:
    known = NAMES.get(type(shape), ())
    kind = "file" if shape is None else type(shape).__name__.lower()
    for name in names:
        if name not in known:
            have = f"for a {kind} give {', '.join(known)}" if known else f"a {kind} has none, so leave compare out"
            raise InputError(f'there is no closed form "{name}" here; {have}.')


def _places_to_compare(shape: Shape | None, forms: Sequence[ClosedForm]) -> Callable[[FloatArray], BoolArray]:
    """Choose points where all closed forms hold; for a slab only those on its upper face."""

    def holds_at(points: FloatArray) -> BoolArray:
        front = points[:, 2] > -1e-9 * shape.width if isinstance(shape, Slab) else np.ones(len(points), dtype=bool)
        return np.asarray(np.all([front, *(form.holds_at(points) for form in forms)], axis=0))

    return holds_at


def _coordinate(shape: Shape | None, sources: IdealSources) -> Coordinate:
    positions, first = sources.positions, sources.positions[0]
    if isinstance(shape, Slab):
        return Coordinate(
            "distance from the source along the face",
            lambda points: np.hypot(*(points[:, :2] - first[:2]).T),
            single_valued=len(np.unique(positions[:, :2].round(9), axis=0)) == 1,
        )
    assert isinstance(shape, Sphere | Cylinder)
    center = np.asarray(shape.center)
    if isinstance(shape, Sphere):
        return Coordinate(
            "angle from the source, °",
            lambda points: np.degrees(polar_angle(points, first, center)),
            single_valued=len(positions) == 1,
        )
    on_axis = float(np.hypot(*(first - center)[:2])) < 1e-9 * shape.radius
    return Coordinate(
        "distance from the source",
        lambda points: np.linalg.norm(points - first, axis=1),
        single_valued=len(positions) == 1 and on_axis,
    )


def describe_source_model(medium: Medium) -> str:
    """Describe by how much a point deposit differs from a line deposit, by closed forms of the half-space."""
    rho = medium.mean_free_path * np.linspace(1.0, 10.0, 200)
    point = medium.albedo * half_space.point_exitance(medium, depth=medium.mean_free_path, rho=rho)
    line = half_space.pencil_exitance(medium, rho=rho)
    change = math.sqrt((rho @ (line - point) ** 2) / (rho @ point**2))
    return (
        "A pencil beam deposited along a line instead (delta-Eddington) would change the exitance of a half-space of "
        f"this medium by {change:.1%} in L2, between one and ten mean free paths from the entry."
    )
