"""A pencil beam: it meets the surface, refracts, and is scattered along its path."""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from tetlux.fem.coefficients import Coefficients
from tetlux.fem.fresnel import reflectance
from tetlux.fem.lights.collimated import LOOKS, CollimatedBeam
from tetlux.fem.lights.deposit import Deposit, together
from tetlux.fem.lights.point import as_vector, check_positive, unit_vector
from tetlux.fem.lights.spot import Disc
from tetlux.fem.medium import Medium
from tetlux.fem.paths import Rays, beyond, follow
from tetlux.meshing.arrays import FloatArray, IntArray, Vector
from tetlux.meshing.errors import InputError
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
            raise InputError(f"radius is {self.radius:g}; give 0 or a length greater than 0.")
        if self.deposit not in ("point", "line"):
            raise InputError(f'deposit is "{self.deposit}"; it is "point" or "line".')

    def rays(self, spacing: float = math.inf) -> tuple[FloatArray, FloatArray]:
        """Thin beams that make this one up.

        Parameters
        ----------
        spacing : float
            Wanted distance between them, unit.

        Returns
        -------
        origins : (r, 3) ndarray
        direction : (3,) ndarray
            Their common unit direction.
        """
        origin = as_vector(self.origin, "origin")
        direction = unit_vector(self.direction, "direction")
        if self.radius == 0:
            return origin[None], direction
        # Vogel's sunflower pattern: equal areas, no two rays on one radius.
        count = int(np.clip(np.pi * (self.radius / spacing) ** 2, *RAYS))
        index = np.arange(count)
        distance = self.radius * np.sqrt((index + 0.5) / count)
        angle = index * np.pi * (3.0 - np.sqrt(5.0))
        across = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
        across /= np.linalg.norm(across)
        up = np.cross(direction, across)
        spread = np.outer(distance * np.cos(angle), across) + np.outer(distance * np.sin(angle), up)
        return origin + spread, direction

    def entry(self, surface: Surface) -> FloatArray:
        """Where the middle of the beam meets the surface, (3,).

        Raises
        ------
        InputError
            If the beam misses the body or starts inside it.
        """
        origin, direction = as_vector(self.origin, "origin"), self.rays()[1]
        self._check_outside(surface, origin)
        distances, _ = _entering(surface, origin, direction)
        if len(distances) == 0:
            raise self._missed(surface)
        return np.asarray(origin + distances[0] * direction)

    def deposit_in(self, surface: Surface, medium: Medium, *, uniform: bool = True) -> Deposit:
        """Refracted and scattered: its points or segments, and what was reflected, absorbed or passed."""
        self._check_outside(surface, as_vector(self.origin, "origin"))
        if self.deposit == "line" and self.radius > 0:
            return self._as_spot(surface, medium)
        origins, direction = self.rays(spacing=0.5 * medium.mean_free_path)
        share = self.power / len(origins)
        parts = []
        for origin in origins:
            distances, faces = _entering(surface, origin, direction)
            if len(faces):
                entry, normal = _on_curve(surface, origin + distances[0] * direction, faces[0], direction)
                enter = _Entry.through(entry, direction, normal, medium.eta, share)
                parts.append(
                    _as_point(enter, surface, medium)
                    if self.deposit == "point"
                    else _as_line(enter, surface, medium, uniform=uniform)
                )
        if not parts:
            raise self._missed(surface)
        deposit = together(parts)
        warnings = list(deposit.warnings)
        if len(parts) < len(origins):
            warnings.append(_partly_missed(1 - len(parts) / len(origins)))
        apart = self.radius * math.sqrt(math.pi / len(origins)) / medium.mean_free_path
        if apart > 1.0:
            warnings.append(
                f"the beam is so wide that the {len(origins)} thin ones it is made of lie {apart:.2g} mean free paths "
                "apart: its exitance is spotted close to where it enters."
            )
        if self.deposit == "line":
            warnings.append(
                "a line deposit of a beam without width is singular where it enters; give the beam a radius, "
                "or read its exitance a mean free path away."
            )
        return replace(deposit, warnings=tuple(dict.fromkeys(warnings)))

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


def _entering(surface: Surface, origin: FloatArray, direction: FloatArray) -> tuple[FloatArray, IntArray]:
    """The crossings (distances, faces) at which a ray goes in."""
    distances, faces = surface.crossings(origin, direction)
    inward = surface.normals[faces] @ direction < 0
    return distances[inward], faces[inward]


def _on_curve(surface: Surface, point: FloatArray, face: int, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where a ray that meets a triangle meets the smooth surface that this stands for, and the normal there."""
    (curved,), (normal,) = surface.on_curve(np.array([face]), point[None])
    flat = surface.normals[face]
    # Along the ray, to the height of the smooth surface; where they run side by side the triangle has to do.
    slope = float(direction @ flat)
    if abs(slope) < GRAZING or direction @ normal > -GRAZING:
        return point, flat
    return point + float((curved - point) @ flat) / slope * direction, normal


@dataclass(frozen=True, eq=False)
class _Entry:
    """A thin beam just inside the surface."""

    point: FloatArray
    direction: FloatArray
    incident: float
    specular: float

    @property
    def transmitted(self) -> float:
        return self.incident - self.specular

    @staticmethod
    def through(point: FloatArray, direction: FloatArray, normal: FloatArray, eta: float, power: float) -> "_Entry":
        """Snell's law and Fresnel's, from outside (index 1) into the medium (index eta)."""
        cosine = max(-float(direction @ normal), 0.0)
        lost = float(reflectance(cosine, 1.0 / eta))
        inside = max(1.0 - (1.0 - cosine**2) / eta**2, 0.0)
        refracted = direction / eta + (cosine / eta - math.sqrt(inside)) * normal
        return _Entry(point, refracted / np.linalg.norm(refracted), power, power * lost)


def _as_point(entry: _Entry, surface: Surface, medium: Medium) -> Deposit:
    mean_free_path = medium.mean_free_path
    way_out = surface.exit(entry.point, entry.direction)
    path = way_out[0] if way_out else 0.0
    depth = mean_free_path
    warnings: tuple[str, ...] = ()
    if path < 2.0 * mean_free_path:
        depth = min(depth, 0.5 * path)
        warnings = (
            "the beam crosses less than two mean free paths of the body, too little for one point of deposit; "
            'use deposit: "line".',
        )
    return Deposit(
        incident=entry.incident,
        specular=entry.specular,
        absorbed=(1.0 - medium.albedo) * entry.transmitted,
        points=(entry.point + depth * entry.direction)[None],
        powers=np.array([medium.albedo * entry.transmitted]),
        resolution=depth,
        warnings=warnings,
    )


def _as_line(entry: _Entry, surface: Surface, medium: Medium, *, uniform: bool) -> Deposit:
    """Through one medium to the far side at once; the rest, and several media, on the mesh."""
    scattering, _ = medium.delta_eddington
    extinction = medium.sigma_a + scattering
    start, direction, power = entry.point, entry.direction, entry.transmitted
    known = Deposit(incident=entry.incident, specular=entry.specular, resolution=0.5 / extinction)
    if power <= 0.0:
        return known  # from a denser medium into a thinner one nothing passes beyond the critical angle

    def ray_on(mesh: TetMesh) -> Rays:
        """The beam from where it meets a facet of the mesh."""
        back = (start - ASTRAY * surface.diagonal * direction)[None]
        distance, face = mesh.rays.first(back, direction[None])
        met = face[0] >= 0 and distance[0] < 2.0 * ASTRAY * surface.diagonal
        place = back + distance[0] * direction if met else mesh.closest_boundary(start[None])[0]
        return Rays(place, direction[None], np.array([power]))

    if not uniform:
        on_the_way = start + np.linspace(0.0, 4.0 / extinction, 9)[:, None] * direction
        lit = on_the_way[surface.contains(on_the_way)]
        return replace(known, lit=lit, on_mesh=lambda mesh, _, coefficients: follow(mesh, coefficients, ray_on(mesh)))
    way_out = surface.exit(start, direction)
    length = way_out[0] if way_out else 0.0
    end = power * math.exp(-extinction * length)
    segment = replace(
        known,
        absorbed=(power - end) * medium.sigma_a / extinction,
        starts=start[None],
        directions=direction[None],
        lengths=np.array([length]),
        fluxes=np.array([power]),
    )
    if end <= NEGLIGIBLE * power:
        return replace(segment, absorbed=segment.absorbed + end)

    def rest_on(mesh: TetMesh, _: Surface, coefficients: Coefficients) -> Deposit:
        ray = ray_on(mesh)
        distance, face = mesh.rays.first(ray.starts, ray.directions)
        if face[0] < 0:
            return Deposit(ballistic=end)
        arrived = Rays(ray.starts + distance[:, None] * direction, ray.directions, np.array([end]))
        rays, ballistic, specular = beyond(mesh, coefficients, arrived, face)
        return together([Deposit(ballistic=ballistic, specular=specular), follow(mesh, coefficients, rays)])

    return replace(segment, on_mesh=rest_on)


def _partly_missed(share: float) -> str:
    return f"{share:.0%} of the beam's cross-section misses the body; incident power counts the rest."
