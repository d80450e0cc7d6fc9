"""A pencil beam: it meets the surface, refracts, and is scattered along its path."""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from tetlux.fem.ballistic.follow import Rays, entered
from tetlux.fem.body.body import Body
from tetlux.fem.body.optical_paths import OpticalPaths
from tetlux.fem.inputs import as_vector, check_positive, unit_vector
from tetlux.fem.lights.arrows import Arrows
from tetlux.fem.lights.collimated import LOOKS, CollimatedBeam
from tetlux.fem.lights.spots import Disc
from tetlux.fem.lights.spots.plane import sunflower
from tetlux.fem.lights.thin_line import line_of
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.describe import as_text
from tetlux.meshing.errors import InputError
from tetlux.meshing.notes import Note
from tetlux.meshing.surface.surface import Surface

# A beam with a radius is this many thin ones at least, and as many as it takes to lie half a mean free path
# apart, up to the second number: closer than that, what they deposit runs together.
RAYS = (127, 2000)
# A beam that meets a surface at less than this, by the sine of the angle, meets its triangles and not their curve.
GRAZING = 0.1


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
        for a thin beam at high albedo. Where the beam passes several media, that is where the integral of sigma_t'
        along it is 1, and the albedo is the mean over where its light is lost: `OpticalPaths.albedo`. A beam that
        runs exactly along the border of two media is taken to lie in one of them, the same one whichever of the two
        is the region. "line" lets it fade along its refracted path by delta-Eddington: ``Q0 = sigma_s* E``,
        ``Q1 = g* sigma_s* E s`` with
        ``E = E0 exp(-sigma_t* l)``.

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

    def arrows(self, surface: Surface) -> Arrows:
        """One, along its axis."""
        return Arrows(self.entry(surface)[None], unit_vector(self.direction, "direction"))

    def deposit_in(self, body: Body) -> Deposit:
        """Refracted and scattered: its points or segments, and what was reflected, absorbed or passed."""
        surface = body.surface
        self._check_outside(surface, as_vector(self.origin, "origin"))
        if self.deposit == "line" and self.radius > 0:
            return self._as_spot(body)
        if self.deposit == "line":
            beams = self._beams(body, 1)
            found = line_of(beams.inside, body)
        else:
            beams = self._beams(body, 1 if self.radius == 0 else RAYS[0])
            # As far apart as is little for the light that is deposited.
            spacing = 0.5 * _unit_of_depth(beams.inside, body)
            wanted = int(np.clip(np.pi * (self.radius / spacing) ** 2, *RAYS))
            if self.radius > 0 and wanted > beams.count:
                beams = self._beams(body, wanted)
            found = _as_points(beams.inside, body)
        return replace(
            found,
            incident=self.power * len(beams.entries) / beams.count,
            specular=beams.specular,
            entries=beams.entries,
            beams_as_points=self.deposit == "point",
            warnings=(*found.warnings, *self._warnings(beams, body)),
        )

    def _beams(self, body: Body, count: int) -> "_Beams":
        """The thin beams that make this one up, where and how they enter the body."""
        origin, direction = as_vector(self.origin, "origin"), unit_vector(self.direction, "direction")
        origins = origin + (sunflower(count, self.radius, direction) if count > 1 else np.zeros((1, 3)))
        points, normals = _entries(body.surface, origins, direction)
        if len(points) == 0:
            raise self._missed(body.surface)
        met = Rays(points, np.broadcast_to(direction, points.shape), np.full(len(points), self.power / count))
        inside, specular = entered(met, normals, body.outer.eta)
        return _Beams(count, points, inside, specular)

    def _warnings(self, beams: "_Beams", body: Body) -> list[str]:
        warnings: list[str] = []
        if len(beams.entries) < beams.count:
            warnings.append(_partly_missed(1 - len(beams.entries) / beams.count))
        apart = self.radius * math.sqrt(math.pi / beams.count)
        if apart > 0:
            apart /= _unit_of_depth(beams.inside, body)
        if apart > 1.0:
            warnings.append(
                Note(
                    "beam-spotted",
                    f"the beam is so wide that the {beams.count} thin ones it is made of lie {apart:.2g} mean free "
                    "paths apart: its exitance is spotted close to where it enters.",
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
        return warnings

    def _as_spot(self, body: Body) -> Deposit:
        spot = Disc(self.origin, self.radius)
        beam = CollimatedBeam(self.direction, self.power / spot.area, spot, from_center=True)
        entries = beam.entries(body.surface)
        if len(entries) == 0:
            raise self._missed(body.surface)
        missed = 1.0 - len(entries) / (LOOKS + 1)
        return replace(beam.deposit_in(body), warnings=(_partly_missed(missed),) if missed > 0 else ())

    def _check_outside(self, surface: Surface, origin: FloatArray) -> None:
        if surface.contains(origin[None])[0]:
            raise InputError(
                f"the beam starts inside the body, at {as_text(self.origin)}; move its origin outside, "
                "or use a point source."
            )

    def _missed(self, surface: Surface) -> InputError:
        return InputError(
            f"the beam from {as_text(self.origin)} along {as_text(self.direction)} misses the body, which spans "
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


@dataclass(frozen=True, eq=False)
class _Beams:
    """Thin beams that make up one.

    Attributes
    ----------
    count : int
        How many there are, with those that miss the body.
    entries : (e, 3) ndarray
        Where they meet the surface.
    inside : Rays
        Those that pass it, refracted.
    specular : float
        Power that is reflected there, W.
    """

    count: int
    entries: FloatArray
    inside: Rays
    specular: float


def _paths(rays: Rays, body: Body) -> OpticalPaths:
    """What thin beams meet from the surface to their way out."""
    begins, lengths = body.ways_out(rays.starts, rays.directions)
    paths = body.paths(rays.starts, rays.directions, lengths, begins)
    short = np.flatnonzero(body.surface.overlaps & (paths.totals < 2.0)).tolist()
    if not short:
        return paths
    # A triangle inside the body is no way out.
    for ray in short:
        way_out = body.surface.exit(rays.starts[ray], rays.directions[ray])
        lengths[ray] = way_out[0] if way_out else 0.0
    return body.paths(rays.starts, rays.directions, lengths, begins)


def _depths(paths: OpticalPaths) -> FloatArray:
    """Optical depths (r,) at which beams are deposited: 1, or half of what there is."""
    return np.minimum(1.0, 0.5 * paths.totals)


def _unit_of_depth(rays: Rays, body: Body) -> float:
    """The mean free path between the surface and where thin beams are deposited, of the shallowest one, unit."""
    if len(rays.powers) == 0:
        return body.shortest_mean_free_path
    return float(_paths(rays, body).place(np.ones(len(rays.powers))).min())


def _as_points(rays: Rays, body: Body) -> Deposit:
    """One point on each beam, where its optical depth is 1."""
    if len(rays.powers) == 0:
        return Deposit()
    paths = _paths(rays, body)
    depths, albedo = paths.place(_depths(paths)), paths.albedo
    points = rays.starts + depths[:, None] * rays.directions
    warnings: tuple[str, ...] = ()
    if (paths.totals < 2.0).any():
        warnings = (
            Note(
                "too-thin-for-point",
                "the beam crosses less than two mean free paths of the body, too little for one point of deposit; "
                'use deposit: "line".',
            ),
        )
    return Deposit(
        absorbed=float((1.0 - albedo) @ rays.powers),
        points=points,
        powers=albedo * rays.powers,
        resolution=float(depths.min()),
        warnings=warnings,
    )


def _partly_missed(share: float) -> Note:
    text = f"{share:.0%} of the beam's cross-section misses the body; incident power counts the rest."
    return Note("beam-partly-missed", text, value=share)
