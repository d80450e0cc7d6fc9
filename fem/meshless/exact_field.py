"""`ExactField`: fluence, exitance and exited power of a whole body in closed form, and its error in a finite body.

A slab is finite, and its series is that of the endless one. Their difference w solves the diffusion equation without a
source, with the right-hand side ``-(phi/(2A) + D dphi/dn)`` of the endless slab's fluence on the rim and 0 on both
faces. By the maximum principle |w|/(2A) is nowhere larger than the largest right-hand side.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.fem.exact import slab, sphere, sphere_light
from tetlux.fem.exact.checks import Face
from tetlux.fem.exact.numerics.bessel import SPHERICAL, order_needed
from tetlux.fem.exact.numerics.quadrature import CUTOFF
from tetlux.fem.exact.registry import IdealSources, ideal_sources, polar_angle
from tetlux.fem.media.medium import Medium
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.solids import Shape, Slab, Sphere

# Errors of the series of a ball relative to the largest value on the surface, the second for sources less than 1/500 of
# the radius below the surface: see `sphere.point_exitance`.
BALL_ERROR, BALL_ERROR_OF_SHALLOW, SHALLOW = 1e-12, 1e-9, 1.0 / 500.0
# Error of the series of a slab, relative to its value at each point: see `slab.point_fluence`.
SLAB_ERROR = 1e-10
# Most orders of the series of a ball: ten thousand points take some ten seconds.
MOST_ORDERS = 100_000
# Seconds that a series takes for each order and point, and that of a slab for each point.
SECONDS_OF_ORDER, SECONDS_OF_SLAB_POINT = 6e-9, 2e-5
# Points across each side of the rim at which its right-hand side is computed, besides those nearest to sources, and the
# factor by which the largest is multiplied for what lies between them.
RIM_POINTS, RIM_DEPTHS, RIM_SAFETY = 9, 3, 1.5
# Step of the derivative across the rim, as a share of the mean free path.
RIM_STEP = 1e-3
# Circles around the entry of a source over which the square of the exitance is integrated, and their largest radius in
# depths of the source.
CIRCLES, LARGEST_CIRCLE = 24, 8.0

FACES: tuple[Face, Face] = ("front", "back")

Field = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class ExactField:
    """Diffuse light in one body in closed form.

    Attributes
    ----------
    name : str
        What it is, for people.
    fluence : callable
        Fluence (n,) at points (n, 3) inside, W/unit².
    exitance : callable
        Exitance (n,) at points (n, 3) of the surface, W/unit².
    exited : float
        Power that leaves, W.
    area : float
        Of the body, unit².
    bound : float
        The error of the exitance is not larger anywhere on the surface, W/unit².
    relative : float
        A further error, relative to the exitance at each point.
    peak : float
        The exitance at the entry of the brightest source, W/unit².
    norm : float
        The root of the integral of the square of the exitance over the surface is not smaller, W/unit.
    seconds_per_point : float
        What the exitance takes for each point, about.
    """

    name: str
    fluence: Field
    exitance: Field
    exited: float
    area: float
    bound: float
    relative: float
    peak: float
    norm: float
    seconds_per_point: float

    @property
    def error(self) -> float:
        """Largest relative L2 error of the exitance."""
        return self.bound * float(np.sqrt(self.area)) / self.norm + self.relative

    def errors_at(self, points: FloatArray) -> FloatArray:
        """Largest relative errors of the exitance at points (n, 3) of the surface, (n,)."""
        with np.errstate(divide="ignore"):
            return np.asarray(self.bound / np.abs(self.exitance(points)) + self.relative)

    def error_in_the_dark(self, share: float) -> float:
        """Largest relative error where the exitance is at least that share of its peak."""
        return self.bound / (share * self.peak) + self.relative


def exact_field(shape: Shape | None, medium: Medium, deposits: Sequence[Deposit]) -> ExactField:
    """The diffuse light of all deposits in closed form.

    Parameters
    ----------
    shape : Sphere, Slab or another, optional
        ``surface.shape`` of the body.
    medium : Medium
        Of the whole body.
    deposits : sequence of Deposit

    Raises
    ------
    InputError
        If no closed form is known, or its series is too long.

    Examples
    --------
    >>> import numpy as np
    >>> from tetlux.fem import Medium, PointSource
    >>> from tetlux.fem.body.body import Body
    >>> from tetlux.meshing import sphere
    >>> ball, medium = sphere(10.0), Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> deposit = PointSource((0.0, 0.0, 9.0)).deposit_in(Body(ball, (medium,)))
    >>> field = exact_field(ball.shape, medium, [deposit])
    >>> field.exitance(np.array([[0.0, 0.0, 10.0], [10.0, 0.0, 0.0]])).round(6).tolist()
    [0.042908, 8.8e-05]
    """
    sources = ideal_sources(deposits)
    if not isinstance(shape, Sphere | Slab):
        raise InputError("the body is no ball and no slab, of which closed forms are known")
    if sources is None:
        raise InputError("there is no closed form for beams along lines, spots, or light that is not uniform")
    return _in_ball(shape, medium, sources) if isinstance(shape, Sphere) else _in_slab(shape, medium, sources)


def _in_ball(shape: Sphere, medium: Medium, sources: IdealSources) -> ExactField:
    center, radius = np.asarray(shape.center), shape.radius
    distances = np.linalg.norm(sources.positions - center, axis=1)
    orders = [order_needed(medium.sigma_tr * radius, r / radius, SPHERICAL, CUTOFF) for r in distances.tolist()]
    if max(orders, default=0) > MOST_ORDERS:
        raise InputError(f"a source is so close below the surface that its series has {max(orders):.1g} orders")
    if sources.emission:
        raise InputError("there is no closed form of the fluence of a ball that emits light")
    transmitted, area = sources.transmitted_irradiance, 4.0 * np.pi * radius**2
    uniform = transmitted * sphere_light.diffuse_exitance(medium, radius=radius) if transmitted else 0.0
    exited, norm = area * uniform, uniform * float(np.sqrt(area))
    for power, distance in zip(sources.powers.tolist(), distances.tolist(), strict=True):
        exited += power * sphere.point_total(medium, radius=radius, source_radius=distance)
    if orders:
        norm += _norm_of_brightest(shape, medium, sources.powers, distances)

    def exitance(points: FloatArray) -> FloatArray:
        def of_unit_power(position: FloatArray) -> FloatArray:
            distance, gamma = float(np.linalg.norm(position - center)), polar_angle(points, position, center)
            return sphere.point_exitance(medium, radius=radius, source_radius=distance, gamma=gamma)

        return sources.sum_of_points(of_unit_power, len(points)) + uniform

    peak = float(exitance(_entries(sources, center, radius)).max())
    shallow = distances.max(initial=0.0) > (1.0 - SHALLOW) * radius
    return ExactField(
        name="exact series of a ball",
        fluence=_fluence_in_ball(shape, medium, sources),
        exitance=exitance,
        exited=exited,
        area=area,
        bound=(BALL_ERROR_OF_SHALLOW if shallow else BALL_ERROR) * peak,
        relative=0.0,
        peak=peak,
        norm=norm,
        seconds_per_point=SECONDS_OF_ORDER * sum(orders),
    )


def _fluence_in_ball(shape: Sphere, medium: Medium, sources: IdealSources) -> Field:
    center, radius, transmitted = np.asarray(shape.center), shape.radius, sources.transmitted_irradiance

    def fluence(points: FloatArray) -> FloatArray:
        # Rounding puts points of the surface outside.
        apart = np.minimum(np.linalg.norm(points - center, axis=1), radius)

        def of_unit_power(position: FloatArray) -> FloatArray:
            with np.errstate(invalid="ignore"):
                gamma = np.nan_to_num(polar_angle(points, position, center))  # the centre has no angle
            distance = float(np.linalg.norm(position - center))
            places = apart[:, None] * np.column_stack([np.sin(gamma), np.zeros_like(gamma), np.cos(gamma)])
            return sphere.point_fluence(medium, radius=radius, source_radius=distance, points=places)

        total = sources.sum_of_points(of_unit_power, len(points))
        if transmitted:
            total += transmitted * sphere_light.diffuse_fluence(medium, radius=radius, distance=apart)
        return total

    return fluence


def _norm_of_brightest(shape: Sphere, medium: Medium, powers: FloatArray, distances: FloatArray) -> float:
    """Root of the integral of the square of the exitance around the entry of the brightest source of a ball."""
    radius = shape.radius
    brightest = int((powers / (radius - distances)).argmax())
    distance = float(distances[brightest])
    return float(powers[brightest]) * _norm_around_entry(
        lambda t: sphere.point_exitance(medium, radius=radius, source_radius=distance, gamma=t / radius),
        lambda t: 2.0 * np.pi * radius * np.sin(t / radius),
        radius - distance,
        np.pi * radius,
    )


def _entries(sources: IdealSources, center: FloatArray, radius: float) -> FloatArray:
    """The points of a ball's surface nearest to sources, and one more, (p + 1, 3)."""
    directions = np.vstack([sources.positions - center, [[1.0, 0.0, 0.0]]])
    lengths = np.linalg.norm(directions, axis=1)
    directions[lengths == 0.0] = [1.0, 0.0, 0.0]
    return np.asarray(center + radius * directions / np.linalg.norm(directions, axis=1)[:, None])


def _in_slab(shape: Slab, medium: Medium, sources: IdealSources) -> ExactField:
    if not sources.are_points:
        raise InputError("closed forms of a slab are those of points")
    thickness, area = shape.depth, 2.0 * shape.width**2 + 4.0 * shape.width * shape.depth
    robin = 0.5 / medium.boundary_factor

    def fluence(points: FloatArray) -> FloatArray:
        def of_unit_power(position: FloatArray) -> FloatArray:
            # Rounding puts points of the faces outside.
            places = points - np.array([*position[:2], 0.0])
            places[:, 2] = np.clip(-places[:, 2], 0.0, thickness)
            return slab.point_fluence(medium, thickness=thickness, depth=-float(position[2]), points=places)

        return sources.sum_of_points(of_unit_power, len(points))

    exited = 0.0
    for power, z in zip(sources.powers.tolist(), sources.positions[:, 2].tolist(), strict=True):
        exited += power * slab.point_total(medium, thickness=thickness, depth=-z, face="front")
        exited += power * slab.point_total(medium, thickness=thickness, depth=-z, face="back")
    norm = max(_norm_of_slab(shape, medium, sources, face) for face in FACES)
    feet = np.vstack([sources.positions * [1.0, 1.0, 0.0], sources.positions * [1.0, 1.0, 0.0] - [0.0, 0.0, thickness]])
    return ExactField(
        name="series of an endless slab",
        fluence=fluence,
        exitance=lambda points: robin * fluence(points),
        exited=exited,
        area=area,
        bound=_largest_on_rim(shape, medium, sources, fluence),
        relative=SLAB_ERROR,
        peak=robin * float(fluence(feet).max()),
        norm=norm,
        seconds_per_point=SECONDS_OF_SLAB_POINT * len(sources.powers),
    )


def _norm_of_slab(shape: Slab, medium: Medium, sources: IdealSources, face: Face) -> float:
    """Root of the integral of the square of the exitance around the entry of the brightest source of a face."""
    depths = -sources.positions[:, 2] if face == "front" else shape.depth + sources.positions[:, 2]
    brightest = int((sources.powers / depths**2).argmax())
    room = 0.5 * shape.width - float(np.abs(sources.positions[brightest, :2]).max())
    depth = -float(sources.positions[brightest, 2])
    return float(sources.powers[brightest]) * _norm_around_entry(
        lambda t: slab.point_exitance(medium, thickness=shape.depth, depth=depth, rho=t, face=face),
        lambda t: 2.0 * np.pi * t,
        float(depths[brightest]),
        room,
    )


def _norm_around_entry(exitance: Field, circumference: Field, depth: float, room: float) -> float:
    """Root of the integral of the square of the exitance over a disc around the entry of a source of that depth."""
    nodes, weights = np.polynomial.legendre.leggauss(CIRCLES)
    half = 0.5 * min(LARGEST_CIRCLE * depth, room)
    t = half * (1.0 + nodes)
    return float(np.sqrt(half * weights @ (circumference(t) * exitance(t) ** 2)))


def _largest_on_rim(shape: Slab, medium: Medium, sources: IdealSources, fluence: Field) -> float:
    """The largest right-hand side ``|phi/(2A) + D dphi/dn|`` on the rim, W/unit²."""
    half, step = 0.5 * shape.width, RIM_STEP * medium.mean_free_path
    depths = np.unique(np.append(np.linspace(0.0, shape.depth, RIM_DEPTHS), -sources.positions[:, 2]))
    largest = 0.0
    for axis in (0, 1):
        along = np.unique(np.append(np.linspace(-half, half, RIM_POINTS), sources.positions[:, 1 - axis]))
        grid = np.stack(np.meshgrid(along, depths), axis=-1).reshape(-1, 2)
        for side in (-half, half):
            places = np.empty((len(grid), 3))
            places[:, axis], places[:, 1 - axis], places[:, 2] = side, grid[:, 0], -grid[:, 1]
            across = np.zeros(3)
            across[axis] = np.sign(side) * step
            inside, outside = fluence(places - across), fluence(places + across)
            right = 0.5 * (inside + outside) * 0.5 / medium.boundary_factor
            right += medium.diffusion * (outside - inside) / (2.0 * step)
            largest = max(largest, float(np.abs(right).max()))
    return RIM_SAFETY * largest
