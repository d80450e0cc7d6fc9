"""Which closed forms a run is compared with, and along which coordinate."""

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

# By shape: the names of its closed forms.
NAMES: dict[type, tuple[str, ...]] = {
    Slab: ("robin", "images", "dipole"),
    Sphere: ("series",),
    Cylinder: ("series",),
}


@dataclass(frozen=True, eq=False)
class Coordinate:
    """What exitance is drawn against.

    Attributes
    ----------
    name : str
        With its unit, unless that is the case's unit of length.
    along : callable
        Its values (n,) at points (n, 3).
    single_valued : bool
        Whether it alone determines the exitance, so that closed forms are lines over it.
    """

    name: str
    along: Callable[[FloatArray], FloatArray]
    single_valued: bool


@dataclass(frozen=True, eq=False)
class Comparison:
    """Closed forms for one case.

    Attributes
    ----------
    coordinate : Coordinate
    forms : dict of str to ClosedForm
    holds_at : callable
        Whether points (n, 3) are compared, (n,).
    note : str
        What all closed forms leave out.
    """

    coordinate: Coordinate
    forms: dict[str, ClosedForm]
    holds_at: Callable[[FloatArray], BoolArray]
    note: str


def comparison_for(shape: Shape | None, medium: Medium, deposits: list[Deposit], names: Sequence[str]) -> Comparison:
    """Closed forms of a built-in shape that holds point sources.

    Parameters
    ----------
    shape : Sphere, Slab, Cylinder or another, optional
        ``surface.shape`` of the body.
    medium : Medium
        Of the whole body.
    deposits : list of Deposit
        What the lights leave in it.
    names : sequence of str
        Of the closed forms wanted.

    Raises
    ------
    InputError
        If one is not known for this shape or for these lights.
    """
    _check_names(shape, names)
    sources = ideal_sources(deposits)
    if sources is None or not sources.are_points:
        raise InputError(
            'closed forms here are those of point sources; give pencil beams deposit: "point", and no diffuse light, '
            "beams of another kind or emission."
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
        _compared_places(shape, list(forms.values())),
        f"{note} {source_model(medium)}" if scattered_from_beam else note,
    )


def _check_names(shape: Shape | None, names: Sequence[str]) -> None:
    known = NAMES.get(type(shape), ())
    kind = "file" if shape is None else type(shape).__name__.lower()
    for name in names:
        if name not in known:
            have = f"for a {kind} there is {', '.join(known)}" if known else f"there is none for a {kind}"
            raise InputError(f'"{name}" is no closed form here; {have}.')


def _compared_places(shape: Shape | None, forms: Sequence[ClosedForm]) -> Callable[[FloatArray], BoolArray]:
    """Where all closed forms hold; of a slab, on its upper face."""

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


def source_model(medium: Medium) -> str:
    """Say what it changes that a beam's deposit is isotropic points, by closed forms of the half-space."""
    rho = medium.mean_free_path * np.linspace(1.0, 10.0, 200)
    point = medium.albedo * half_space.point_exitance(medium, depth=medium.mean_free_path, rho=rho)
    line = half_space.pencil_exitance(medium, rho=rho)
    change = math.sqrt((rho @ (line - point) ** 2) / (rho @ point**2))
    return (
        "A pencil beam that fades along a line (delta-Eddington) instead would change the exitance of a half-space of "
        f"this medium by {change:.1%} in L2, between one and ten mean free paths from the entry."
    )
