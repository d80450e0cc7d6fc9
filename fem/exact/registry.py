"""Closed forms of the exitance, looked up by the shape of a body, its medium, and the light in it.

To add one, write a function of the shape, the medium and the sources, and enter it in `FACTORIES`. `compare:` in a case
file, ``tetlux chart`` and ``tetlux stress`` look closed forms up here.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.fem.exact import cylinder, dipole, slab, sphere, sphere_light
from tetlux.fem.media.medium import Medium
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import BoolArray, FloatArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.solids import Cylinder, Shape, Slab, Sphere

# The closed form of an infinite body holds in a finite one at points farther from the ends than this many decay lengths
# of the slowest mode: the influence of an end falls by exp(-4) on the way there and back.
DECAY_LENGTHS = 2.0
# First zero of J_0, which gives the slowest mode of a cylinder.
FIRST_ZERO = 2.405

SurfaceField = Callable[[FloatArray], FloatArray]
Mask = Callable[[FloatArray], BoolArray]


@dataclass(frozen=True, eq=False)
class ClosedForm:
    """Exitance of one body in closed form.

    Attributes
    ----------
    name : {"series", "robin", "images", "dipole"}
    exitance : callable
        Exitance (n,) at points (n, 3) of the surface, W/unit².
    holds_at : callable
        Whether the closed form holds at points (n, 3), (n,): far from the ends of a body that it takes for infinite.
    same_model : bool
        Whether it solves the solver's equation with the solver's boundary condition, so that their difference is the
        discretisation error.
    """

    name: str
    exitance: SurfaceField
    holds_at: Mask
    same_model: bool = True


@dataclass(frozen=True, eq=False)
class IdealSources:
    """Sources for which closed forms are known.

    Attributes
    ----------
    positions, powers : (p, 3), (p,) ndarray
        Isotropic point sources, unit, and their powers, W.
    transmitted_irradiance : float
        Uniform diffuse light that enters the body, W/unit².
    emission : float
        Uniform emission of the volume, W/unit³.
    """

    positions: FloatArray
    powers: FloatArray
    transmitted_irradiance: float = 0.0
    emission: float = 0.0

    @property
    def are_points(self) -> bool:
        """Whether all sources are points."""
        return len(self.powers) > 0 and self.transmitted_irradiance == 0 and self.emission == 0

    def sum_of_points(self, exitance: Callable[[FloatArray], FloatArray], count: int) -> FloatArray:
        """Sum the exitance (n,) of all points, given the function from a position (3,) to that of unit power."""
        total = np.zeros(count)
        for position, power in zip(self.positions, self.powers, strict=True):
            total += power * exitance(position)
        return total


def ideal_sources(deposits: Sequence[Deposit]) -> IdealSources | None:
    """Describe deposits as ideal sources; None if a part of them is neither a point nor uniform."""
    terms = [deposit.terms for deposit in deposits]
    uniform = [(each.transmitted_irradiance, each.emission) for each in terms]
    if any(deposit.on_mesh is not None for deposit in deposits) or any(len(each.segments) for each in terms):
        return None
    if any(np.ndim(value) for row in uniform for value in row):
        return None
    return IdealSources(
        np.vstack([np.zeros((0, 3)), *(each.points for each in terms)]),
        np.concatenate([np.zeros(0), *(each.powers for each in terms)]),
        sum(float(transmitted) for transmitted, _ in uniform),
        sum(float(emission) for _, emission in uniform),
    )


def closed_forms(shape: Shape | None, medium: Medium, deposits: Sequence[Deposit]) -> dict[str, ClosedForm]:
    """Closed forms of the exitance of a body, by name.

    Parameters
    ----------
    shape : Sphere, Slab, Cylinder or another, optional
        ``surface.shape`` of the body.
    medium : Medium
        The medium of the whole body.
    deposits : sequence of Deposit
        The deposits of all lights.

    Returns
    -------
    dict of str to ClosedForm
        Closed forms of the solver's model first; empty if none is known.

    Raises
    ------
    InputError
        If a source is too close to the surface for a series, or to the end of a body that the closed form takes for
        infinite.

    Examples
    --------
    >>> import numpy as np
    >>> from tetlux.fem import Medium, PointSource
    >>> from tetlux.fem.body.body import Body
    >>> from tetlux.meshing import sphere
    >>> ball, medium = sphere(10.0), Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> deposit = PointSource((0.0, 0.0, 9.0)).deposit_in(Body(ball, (medium,)))
    >>> forms = closed_forms(ball.shape, medium, [deposit])
    >>> list(forms)
    ['series']
    >>> forms["series"].exitance(np.array([[0.0, 0.0, 10.0], [10.0, 0.0, 0.0]])).round(6).tolist()
    [0.042908, 8.8e-05]
    """
    sources = ideal_sources(deposits)
    factory = FACTORIES.get(type(shape))
    if sources is None or factory is None:
        return {}
    return {form.name: form for form in factory(shape, medium, sources)}


def polar_angle(points: FloatArray, pole: FloatArray, center: FloatArray) -> FloatArray:
    """Angle (n,) at the centre between points (n, 3) and a pole (3,), radians, accurate near 0 and pi too."""
    axis = pole - center
    length = float(np.linalg.norm(axis))
    # A source at the centre has no direction, and any direction will do.
    axis = axis / length if length > 0 else np.array([0.0, 0.0, 1.0])
    directions = points - center
    directions = directions / np.linalg.norm(directions, axis=1)[:, None]
    across = np.linalg.norm(np.cross(directions, axis), axis=1)
    return np.asarray(np.arctan2(across, directions @ axis))


def _in_sphere(shape: Sphere, medium: Medium, sources: IdealSources) -> list[ClosedForm]:
    center, radius = np.asarray(shape.center), shape.radius
    uniform = 0.0
    if sources.transmitted_irradiance:
        uniform += sources.transmitted_irradiance * sphere_light.diffuse_exitance(medium, radius=radius)
    if sources.emission:
        uniform += sources.emission * sphere_light.glow_exitance(medium, radius=radius)

    def series(points: FloatArray) -> FloatArray:
        def of_unit_power(position: FloatArray) -> FloatArray:
            distance, gamma = float(np.linalg.norm(position - center)), polar_angle(points, position, center)
            return sphere.point_exitance(medium, radius=radius, source_radius=distance, gamma=gamma)

        return sources.sum_of_points(of_unit_power, len(points)) + uniform

    form = ClosedForm("series", series, lambda points: np.ones(len(points), dtype=bool))
    return _check_forms([form], center + np.array([radius, 0.0, 0.0]))


def _in_slab(shape: Slab, medium: Medium, sources: IdealSources) -> list[ClosedForm]:
    if not sources.are_points:
        return []
    decay = math.hypot(medium.sigma_tr, math.pi / (shape.depth + 2.0 * medium.extrapolation_length))
    rim, half = DECAY_LENGTHS / decay, 0.5 * shape.width
    _check_room("rim", half - rim, float(np.abs(sources.positions[:, :2]).max()), rim)

    def away_from_rim(points: FloatArray) -> BoolArray:
        return np.asarray(np.abs(points[:, :2]).max(axis=1) < half - rim)

    def on_top(points: FloatArray) -> BoolArray:
        return np.asarray(points[:, 2] > -1e-9 * shape.width)

    def on_both_faces(exitance: Callable[..., FloatArray]) -> SurfaceField:
        def at(points: FloatArray) -> FloatArray:
            top = points[:, 2] > -0.5 * shape.depth

            def of_unit_power(position: FloatArray) -> FloatArray:
                rho, depth = np.hypot(*(points[:, :2] - position[:2]).T), -float(position[2])
                values = np.empty(len(points))
                for face, here in (("front", top), ("back", ~top)):
                    values[here] = exitance(medium, thickness=shape.depth, depth=depth, rho=rho[here], face=face)
                return values

            return sources.sum_of_points(of_unit_power, len(points))

        return at

    def of_dipole(points: FloatArray) -> FloatArray:
        def of_unit_power(position: FloatArray) -> FloatArray:
            rho = np.hypot(*(points[:, :2] - position[:2]).T)
            return dipole.flux(medium, depth=-float(position[2]), rho=rho)

        return sources.sum_of_points(of_unit_power, len(points))

    forms = [
        ClosedForm("robin", on_both_faces(slab.point_exitance), away_from_rim),
        ClosedForm("images", on_both_faces(slab.extrapolated_flux), away_from_rim, same_model=False),
        ClosedForm("dipole", of_dipole, lambda points: away_from_rim(points) & on_top(points), same_model=False),
    ]
    return _check_forms(forms, np.zeros(3))


def _in_cylinder(shape: Cylinder, medium: Medium, sources: IdealSources) -> list[ClosedForm]:
    if not sources.are_points:
        return []
    center, radius = np.asarray(shape.center), shape.radius
    end = DECAY_LENGTHS / math.hypot(medium.sigma_tr, FIRST_ZERO / (radius + medium.extrapolation_length))
    _check_room("end", 0.5 * shape.height - end, float(np.abs(sources.positions[:, 2] - center[2]).max()), end)

    def series(points: FloatArray) -> FloatArray:
        x = points - center

        def of_unit_power(position: FloatArray) -> FloatArray:
            source = position - center
            theta = np.arctan2(x[:, 1], x[:, 0]) - math.atan2(source[1], source[0])
            distance, z = float(np.hypot(source[0], source[1])), x[:, 2] - source[2]
            return cylinder.point_exitance(medium, radius=radius, source_radius=distance, theta=theta, z=z)

        return sources.sum_of_points(of_unit_power, len(points))

    def on_side(points: FloatArray) -> BoolArray:
        x = points - center
        return np.asarray((np.abs(x[:, 2]) < 0.5 * shape.height - end) & (np.hypot(x[:, 0], x[:, 1]) > 0.98 * radius))

    return _check_forms([ClosedForm("series", series, on_side)], center + np.array([radius, 0.0, 0.0]))


# The functions that make the closed forms of a body, by its shape.
FACTORIES: dict[type, Callable[..., list[ClosedForm]]] = {
    Sphere: _in_sphere,
    Slab: _in_slab,
    Cylinder: _in_cylinder,
}


def _check_room(side: str, room: float, farthest: float, margin: float) -> None:
    """Refuse a source so close to the end of a body that the closed form of the infinite body does not hold."""
    if farthest > room:
        raise InputError(
            f"the light is deposited less than {margin:.3g} from the body's {side}, where the closed form, which is "
            "that of an infinite body, does not hold",
            remedy="move the light or make the body larger",
        )


def _check_forms(forms: list[ClosedForm], place: FloatArray) -> list[ClosedForm]:
    """Evaluate each closed form once, so that one that does not exist for these sources raises its error at once."""
    for form in forms:
        form.exitance(place[None])
    return forms
