"""A pencil beam: it meets the surface, refracts, and is scattered along its path."""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from tetlux.fem.coefficients import Coefficients
from tetlux.fem.lights.collimated import LOOKS, CollimatedBeam
from tetlux.fem.lights.deposit import Deposit, together
from tetlux.fem.lights.point import as_vector, check_positive, unit_vector
from tetlux.fem.lights.spot import Disc, sunflower
from tetlux.fem.medium import Medium
from tetlux.fem.paths import Rays, beyond, entered, follow
from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.errors import InputError
from tetlux.meshing.notes import Note
from tetlux.meshing.surface import Surface
from tetlux.meshing.tetmesh import TetMesh

# A beam with a radius is this many thin ones at least, and as many as it takes to lie half a mean free path
# apart, up to the second number: closer than that, what they deposit runs together.
RAYS = (127, 2000)
# A beam that meets a surface at less than this, by the sine of the angle, meets its triangles and not their curve.
GRAZING = 0.1
# A beam with this share of its power left at the far side stays there.
NEGLIGIBLE = 1e-12
# A mesh's facets lie within this share of the body's diagonal from its surface.
ASTRAY = 0.02


@dataclass(frozen=True)
class PencilBeam:
    """A thin beam of light from outside, or a round one of even irradiance if it has a radius.

    Parameters
    ----------
    origin : (3,) floats
        A point outside the body that the beam passes on its way, unit.
    direction : (3,) floats
        Any length.
    power : float
        W.
    radius : float
        Radius of the beam, unit; 0 is a beam without width.
    deposit : {"point", "line"}
        "point" puts the power times the reduced albedo at one mean free path ``1/sigma_t'`` along the
        refracted beam, the dipole's own source (Farrell 1992; Jensen 2001, sec. 2.1) and the better choice
        for a thin beam at high albedo. "line" lets it fade along its refracted path by delta-Eddington:
        ``Q0 = sigma_s* E``, ``Q1 = g* sigma_s* E s`` with ``E = E0 exp(-sigma_t* l)``.

    Raises
    ------
    InputError
        If a value is not finite, the direction zero, the power not positive or the radius negative; and,
        when solved, if the beam misses the body or starts inside it.
    """

    origin: Vector
    direction: Vector
    power: float = 1.0
    radius: float = 0.0
    deposit: Literal["point", "line"] = "point"

    def __post_init__(self) -> None:
        as_vector(self.origin, "origin")
        unit_vector(self.direction, "direction")
        check_positive(self.power, "power", "watts")
        if not math.isfinite(self.radius) or self.radius < 0:
            raise InputError(f"radius is {self.radius:g}; give 0 or a length greater than 0.", field="radius")
        if self.deposit not in ("point", "line"):
            raise InputError(f'deposit is "{self.deposit}"; it is "point" or "line".', field="deposit")

    def entry(self, surface: Surface) -> FloatArray:
        """Where the middle of the beam meets the surface, (3,).

        Raises
        ------
        InputError
            If the beam misses the body or starts inside it.
        """
        origin = as_vector(self.origin, "origin")
        self._check_outside(surface, origin)
        points, _ = _entries(surface, origin[None], unit_vector(self.direction, "direction"), curved=False)
        if len(points) == 0:
            raise self._missed(surface)
        return np.asarray(points[0])

    def deposit_in(self, surface: Surface, medium: Medium, *, uniform: bool = True) -> Deposit:
        """Refracted and scattered: its points or segments, and what was reflected, absorbed or passed."""
        origin, direction = as_vector(self.origin, "origin"), unit_vector(self.direction, "direction")
        self._check_outside(surface, origin)
        if self.deposit == "line" and self.radius > 0:
            return self._as_spot(surface, medium)
        # Thin beams that make this one up.
        spacing = 0.5 * medium.mean_free_path
        count = 1 if self.radius == 0 else int(np.clip(np.pi * (self.radius / spacing) ** 2, *RAYS))
        origins = origin + (sunflower(count, self.radius, direction) if count > 1 else np.zeros((1, 3)))
        points, normals = _entries(surface, origins, direction)
        if len(points) == 0:
            raise self._missed(surface)
        met = Rays(points, np.broadcast_to(direction, points.shape), np.full(len(points), self.power / count))
        inside, specular = entered(met, normals, medium.eta)
        deposit = replace(
            _as_points(inside, surface, medium)
            if self.deposit == "point"
            else _as_line(inside, surface, medium, uniform=uniform),
            incident=float(met.powers.sum()),
            specular=specular,
            entries=points,
        )
        warnings = list(deposit.warnings)
        if len(points) < count:
            warnings.append(_partly_missed(1 - len(points) / count))
        apart = self.radius * math.sqrt(math.pi / count) / medium.mean_free_path
        if apart > 1.0:
            warnings.append(
                Note(
                    "beam-spotted",
                    f"the beam is so wide that the {count} thin ones it is made of lie {apart:.2g} mean free paths "
                    "apart: its exitance is spotted close to where it enters.",
                    value=apart,
                )
            )
        if self.deposit == "line":
            warnings.append(
                Note(
                    "beam-singular",
                    "a line deposit of a beam without width is singular where it enters; give the beam a radius, "
                    "or read its exitance a mean free path away.",
                )
            )
        return replace(deposit, warnings=tuple(warnings))

    def _as_spot(self, surface: Surface, medium: Medium) -> Deposit:
        spot = Disc(self.origin, self.radius)
        beam = CollimatedBeam(self.direction, self.power / spot.area, spot, from_center=True)
        entries = beam.entries(surface)
        if len(entries) == 0:
            raise self._missed(surface)
        missed = 1.0 - len(entries) / (LOOKS + 1)
        return replace(beam.deposit_in(surface, medium), warnings=(_partly_missed(missed),) if missed > 0 else ())

    def _check_outside(self, surface: Surface, origin: FloatArray) -> None:
        if surface.contains(origin[None])[0]:
            raise InputError(
                f"the beam starts inside the body, at {tuple(self.origin)}; move its origin outside, "
                "or use a point source."
            )

    def _missed(self, surface: Surface) -> InputError:
        return InputError(
            f"the beam from {tuple(self.origin)} along {tuple(self.direction)} misses the body, which spans "
            f"{surface.extent}; change its origin or direction."
        )


def _entries(
    surface: Surface, origins: FloatArray, direction: FloatArray, *, curved: bool = True
) -> tuple[FloatArray, FloatArray]:
    """Where parallel rays from outside first meet a surface, and its normals there, (e, 3) each."""
    directions = np.broadcast_to(direction, origins.shape)
    distances, faces = surface.rays.first(origins, directions)
    met = (faces >= 0) & (surface.normals[faces] @ direction < 0)
    # From outside a surface is met from its front, but for rays along a face or through an edge: those are looked at
    # in full precision.
    unclear = ~met & ((faces >= 0) | (len(origins) == 1))
    for ray in np.flatnonzero(unclear).tolist():
        along, crossed = surface.crossings(origins[ray], direction)
        inward = np.flatnonzero(surface.normals[crossed] @ direction < 0)
        if len(inward):
            distances[ray], faces[ray], met[ray] = along[inward[0]], crossed[inward[0]], True
    points, faces = origins[met] + distances[met, None] * direction, faces[met]
    flat = surface.normals[faces]
    if not curved or len(points) == 0:
        return points, flat
    # Along the ray, to the height of the smooth surface; where they run side by side the triangle has to do.
    above, normals = surface.on_curve(faces, points)
    slope = flat @ direction
    grazing = (slope > -GRAZING) | (normals @ direction > -GRAZING)
    way = np.where(grazing, 0.0, np.einsum("ij,ij->i", above - points, flat) / np.where(grazing, 1.0, slope))
    return points + way[:, None] * direction, np.where(grazing[:, None], flat, normals)


def _as_points(rays: Rays, surface: Surface, medium: Medium) -> Deposit:
    mean_free_path = medium.mean_free_path
    distances, faces = surface.rays.first(rays.starts, rays.directions)
    # On a curved surface a beam starts above the triangle that it met, and meets it again.
    again = np.flatnonzero(np.einsum("ij,ij->i", rays.directions, surface.normals[faces]) < 0)
    places = rays.starts[again] + distances[again, None] * rays.directions[again]
    distances[again] += surface.rays.first(places, rays.directions[again])[0]
    paths = np.where(np.isfinite(distances), distances, 0.0)
    if surface.overlaps:
        # A triangle inside the body is no way out.
        for ray in np.flatnonzero(paths < 2.0 * mean_free_path).tolist():
            way_out = surface.exit(rays.starts[ray], rays.directions[ray])
            paths[ray] = way_out[0] if way_out else 0.0
    depths = np.minimum(mean_free_path, 0.5 * paths)
    warnings: tuple[str, ...] = ()
    if (depths < mean_free_path).any():
        warnings = (
            Note(
                "too-thin-for-point",
                "the beam crosses less than two mean free paths of the body, too little for one point of deposit; "
                'use deposit: "line".',
            ),
        )
    return Deposit(
        absorbed=(1.0 - medium.albedo) * float(rays.powers.sum()),
        points=rays.starts + depths[:, None] * rays.directions,
        powers=medium.albedo * rays.powers,
        resolution=float(depths.min(initial=mean_free_path)),
        warnings=warnings,
    )


def _as_line(rays: Rays, surface: Surface, medium: Medium, *, uniform: bool) -> Deposit:
    """A beam without width: through one medium to the far side at once; the rest, and several media, on the mesh."""
    if len(rays.powers) == 0:
        return Deposit()
    scattering, _ = medium.delta_eddington
    extinction = medium.sigma_a + scattering
    start, direction, power = rays.starts[0], rays.directions[0], float(rays.powers[0])
    resolution = 0.5 / extinction

    def ray_on(mesh: TetMesh) -> Rays:
        """The beam from where it meets a facet of the mesh."""
        back = (start - ASTRAY * surface.diagonal * direction)[None]
        distance, face = mesh.rays.first(back, rays.directions)
        met = face[0] >= 0 and distance[0] < 2.0 * ASTRAY * surface.diagonal
        place = back + distance[0] * direction if met else mesh.closest_boundary(start[None])[0]
        return replace(rays, starts=place)

    if not uniform:
        on_the_way = start + np.linspace(0.0, 4.0 / extinction, 9)[:, None] * direction
        return Deposit(
            lit=on_the_way[surface.contains(on_the_way)],
            resolution=resolution,
            on_mesh=lambda mesh, _, coefficients: follow(mesh, coefficients, ray_on(mesh)),
        )
    way_out = surface.exit(start, direction)
    length = way_out[0] if way_out else 0.0
    end = power * math.exp(-extinction * length)
    segment = Deposit(
        absorbed=(power - end) * medium.sigma_a / extinction,
        starts=rays.starts,
        directions=rays.directions,
        lengths=np.array([length]),
        fluxes=rays.powers,
        resolution=resolution,
    )
    if end <= NEGLIGIBLE * power:
        return replace(segment, absorbed=segment.absorbed + end)

    def rest_on(mesh: TetMesh, _: Surface, coefficients: Coefficients) -> Deposit:
        ray = ray_on(mesh)
        distance, face = mesh.rays.first(ray.starts, ray.directions)
        if face[0] < 0:
            return Deposit(ballistic=end)
        arrived = Rays(ray.starts + distance[:, None] * direction, ray.directions, np.array([end]))
        on, ballistic, specular = beyond(mesh, coefficients, arrived, face)
        return together([Deposit(ballistic=ballistic, specular=specular), follow(mesh, coefficients, on)])

    return replace(segment, on_mesh=rest_on)


def _partly_missed(share: float) -> Note:
    text = f"{share:.0%} of the beam's cross-section misses the body; incident power counts the rest."
    return Note("beam-partly-missed", text, value=share)
