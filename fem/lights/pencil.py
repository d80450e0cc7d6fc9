"""A pencil beam: it meets the surface, refracts, and is scattered along its path."""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from tetlux.fem.fresnel import reflectance
from tetlux.fem.lights.deposit import Deposit
from tetlux.fem.lights.point import as_vector, check_power
from tetlux.fem.medium import Medium
from tetlux.meshing.arrays import FloatArray, IntArray, Vector
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface import Surface

# A beam with a radius is this many thin ones at least, and as many as it takes to lie half a mean free path
# apart, up to the second number: closer than that, what they deposit runs together.
RAYS = (127, 2000)
# A beam that meets a surface at less than this, by the sine of the angle, meets its triangles and not their curve.
GRAZING = 0.1
# What a beam still carries after this many reflections at the inside, or below this share, stays put.
REFLECTIONS = 64
NEGLIGIBLE = 1e-12


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
        if not np.linalg.norm(as_vector(self.direction, "direction")) > 0:
            raise InputError("direction is zero; give the direction in which the beam travels.")
        check_power(self.power)
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
        direction = as_vector(self.direction, "direction")
        direction = direction / np.abs(direction).max()  # its square may be out of range
        direction /= np.linalg.norm(direction)
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

    def deposit_in(self, surface: Surface, medium: Medium) -> Deposit:
        """Refracted and scattered: its points or segments, and what was reflected, absorbed or passed."""
        origins, direction = self.rays(spacing=0.5 * medium.mean_free_path)
        self._check_outside(surface, as_vector(self.origin, "origin"))
        share = self.power / len(origins)
        parts = []
        for origin in origins:
            distances, faces = _entering(surface, origin, direction)
            if len(faces):
                entry, normal = _on_curve(surface, origin + distances[0] * direction, faces[0], direction)
                enter = _Entry.through(entry, direction, normal, medium.eta, share)
                parts.append(
                    _as_point(enter, surface, medium) if self.deposit == "point" else _as_line(enter, surface, medium)
                )
        if not parts:
            raise self._missed(surface)
        deposit = _joined(parts)
        warnings = list(deposit.warnings)
        if len(parts) < len(origins):
            warnings.append(
                f"{1 - len(parts) / len(origins):.0%} of the beam's cross-section misses the body; "
                "incident power counts the rest."
            )
        apart = self.radius * math.sqrt(math.pi / len(origins)) / medium.mean_free_path
        if apart > 1.0:
            warnings.append(
                f"the beam is so wide that the {len(origins)} thin ones it is made of lie {apart:.2g} mean free paths "
                "apart: its exitance is spotted close to where it enters."
            )
        if self.deposit == "line" and self.radius == 0:
            warnings.append(
                "a line deposit of a beam without width is singular where it enters; give the beam a radius, "
                "or read its exitance a mean free path away."
            )
        return replace(deposit, warnings=tuple(dict.fromkeys(warnings)))

    def _check_outside(self, surface: Surface, origin: FloatArray) -> None:
        if surface.contains(origin[None])[0]:
            raise InputError(
                f"the beam starts inside the body, at {tuple(self.origin)}; move its origin outside, "
                "or use a point source."
            )

    def _missed(self, surface: Surface) -> InputError:
        low, high = surface.points.min(axis=0), surface.points.max(axis=0)
        spans = ", ".join(f"{axis} {a:.4g}..{b:.4g}" for axis, a, b in zip("xyz", low, high, strict=True))
        return InputError(
            f"the beam from {tuple(self.origin)} along {tuple(self.direction)} misses the body, which spans "
            f"{spans} {surface.unit}; change its origin or direction."
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


def _as_line(entry: _Entry, surface: Surface, medium: Medium) -> Deposit:
    """Follow the beam to the far side, and back and forth for what that reflects."""
    scattering, _ = medium.delta_eddington
    extinction = medium.sigma_a + scattering
    starts, directions, lengths, fluxes = [], [], [], []
    point, direction, flux, ballistic = entry.point, entry.direction, entry.transmitted, 0.0
    for _ in range(REFLECTIONS):
        way_out = surface.exit(point, direction)
        if way_out is None or flux <= NEGLIGIBLE * entry.incident:
            break
        length, face = way_out
        starts.append(point)
        directions.append(direction)
        lengths.append(length)
        fluxes.append(flux)
        flux *= math.exp(-extinction * length)
        normal = surface.normals[face]
        point = point + length * direction
        cosine = float(direction @ normal)
        reflected = float(reflectance(cosine, medium.eta))
        ballistic += (1.0 - reflected) * flux
        flux *= reflected
        direction = direction - 2.0 * cosine * normal
    deposited = entry.transmitted - ballistic - flux
    return Deposit(
        incident=entry.incident,
        specular=entry.specular,
        # What is left after the last reflection stays where it is.
        absorbed=deposited * medium.sigma_a / extinction + flux,
        ballistic=ballistic,
        starts=np.array(starts).reshape(-1, 3),
        directions=np.array(directions).reshape(-1, 3),
        lengths=np.array(lengths),
        fluxes=np.array(fluxes),
        resolution=0.5 / extinction,
    )


def _joined(parts: list[Deposit]) -> Deposit:
    return Deposit(
        incident=sum(p.incident for p in parts),
        specular=sum(p.specular for p in parts),
        absorbed=sum(p.absorbed for p in parts),
        ballistic=sum(p.ballistic for p in parts),
        points=np.vstack([p.points for p in parts]),
        powers=np.concatenate([p.powers for p in parts]),
        starts=np.vstack([p.starts for p in parts]),
        directions=np.vstack([p.directions for p in parts]),
        lengths=np.concatenate([p.lengths for p in parts]),
        fluxes=np.concatenate([p.fluxes for p in parts]),
        resolution=min(p.resolution for p in parts),
        warnings=tuple(w for p in parts for w in p.warnings),
    )
