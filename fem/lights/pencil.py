"""A pencil beam: it meets the surface, is refracted, and scattered along its path."""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from tetlux.fem.ballistic.interface import refract_in
from tetlux.fem.ballistic.rays import Rays
from tetlux.fem.body.body import Body
from tetlux.fem.inputs import as_vector, check_positive, unit_vector
from tetlux.fem.lights.arrows import Arrows
from tetlux.fem.lights.collimated import CollimatedBeam
from tetlux.fem.lights.entries import contains_point, find_entries, find_entry
from tetlux.fem.lights.illumination import ENTRY_RAYS
from tetlux.fem.lights.spots import Disc
from tetlux.fem.lights.spots.plane import sunflower
from tetlux.fem.lights.thin_line import line_of
from tetlux.fem.lights.thin_points import points_of, shallowest_depth
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.footprint import Footprint
from tetlux.fem.sources.ledger import Ledger
from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.describe import as_text
from tetlux.meshing.errors import InputError
from tetlux.meshing.notes import Note
from tetlux.meshing.surface.surface import Surface

# Thin beams that represent a beam with a radius: at least the first number, at most the second, and in between as many
# as lie half a mean free path apart. What they deposit is blurred over more than that.
BEAMS = (127, 2000)


@dataclass(frozen=True)
class PencilBeam:
    """A thin beam of light from outside, or a round one of uniform irradiance if it has a radius.

    Parameters
    ----------
    origin : (3,) floats
        A point outside the body from which the beam starts, unit.
    direction : (3,) floats
        Direction of travel, of any length.
    power : float
        Power of the beam, W.
    radius : float
        Radius of the beam, unit; 0 is a beam without width.
    deposit : {"point", "line"}
        "point" puts the power times the reduced albedo at one mean free path ``1/sigma_t'`` along the refracted beam,
        the dipole's own source (Farrell 1992; Jensen 2001, sec. 2.1), and is the better choice for a thin beam at high
        albedo. Across several media that is where the integral of sigma_t' along the beam is 1, and the albedo is
        `OpticalPaths.albedo`. A beam exactly along the interface of two media is taken to lie in one of them, the same
        one whichever of the two is the region. "line" lets the beam decay along its refracted path by delta-Eddington:
        ``Q0 = sigma_s* E``, ``Q1 = g* sigma_s* E s`` with ``E = E0 exp(-sigma_t* l)``; symbols as for `CollimatedBeam`.

    Raises
    ------
    InputError
        If a value is not finite, the direction zero, the power not positive or the radius negative; and, when solved,
        if the beam misses the body or starts inside it.

    Examples
    --------
    >>> from tetlux.fem import Medium, solve
    >>> from tetlux.meshing import sphere
    >>> beam = PencilBeam(origin=(0.0, 0.0, 20.0), direction=(0.0, 0.0, -1.0), power=1.0)
    >>> medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> solution = solve(sphere(10.0), medium, [beam], tolerance=0.05)
    >>> round(solution.power.specular, 4)  # ((1.4 - 1)/(1.4 + 1))²
    0.0278
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
        """Find where the axis of the beam meets the triangles of a surface.

        Parameters
        ----------
        surface : Surface

        Returns
        -------
        (3,) ndarray
            unit.

        Raises
        ------
        InputError
            If the beam misses the body or starts inside it.
        """
        origin = as_vector(self.origin, "origin")
        self._check_outside(surface, origin)
        points, _ = find_entries(surface, origin[None], unit_vector(self.direction, "direction"), curved=False)
        if len(points) == 0:
            raise self._miss(surface)
        return np.asarray(points[0])

    def arrows(self, surface: Surface) -> Arrows:
        """Draw one along its axis; see `HasArrows`."""
        return Arrows(self.entry(surface)[None], unit_vector(self.direction, "direction"))

    def deposit_in(self, body: Body) -> Deposit:
        """Refract it and scatter it, at points or along its path.

        See `tetlux.fem.Light` for parameters and result.
        """
        self._check_outside(body.surface, as_vector(self.origin, "origin"))
        if self.deposit == "line" and self.radius > 0:
            return self._deposit_as_spot(body)
        if self.deposit == "line":
            beams = self._thin_beams(body, 1)
            deposit = line_of(beams.inside, body)
        else:
            beams = self._beams_close_enough(body)
            deposit = points_of(beams.inside, body)
        outside = Ledger(incident=self.power * len(beams.entries) / beams.count, specular=beams.specular)
        return replace(
            deposit,
            ledger=Ledger.merge([outside, deposit.ledger]),
            footprint=Footprint(beams.entries, beams_as_points=self.deposit == "point"),
            warnings=(*deposit.warnings, *self._warnings(beams, body)),
        )

    def _beams_close_enough(self, body: Body) -> "_ThinBeams":
        """Thin beams half a mean free path apart, or nearer, as far as their number is limited."""
        beams = self._thin_beams(body, 1 if self.radius == 0 else BEAMS[0])
        if self.radius == 0:
            return beams
        spacing = 0.5 * shallowest_depth(beams.inside, body)
        wanted = int(np.clip(np.pi * (self.radius / spacing) ** 2, *BEAMS))
        return self._thin_beams(body, wanted) if wanted > beams.count else beams

    def _thin_beams(self, body: Body, count: int) -> "_ThinBeams":
        """Thin beams that represent this one, and where they enter the body."""
        origin, direction = as_vector(self.origin, "origin"), unit_vector(self.direction, "direction")
        if count == 1:
            points, normals = find_entry(body.surface, origin, direction)
        else:
            origins = origin + sunflower(count, self.radius, direction)
            points, normals = find_entries(body.surface, origins, direction)
        if len(points) == 0:
            raise self._miss(body.surface)
        arriving = Rays(points, np.broadcast_to(direction, points.shape), np.full(len(points), self.power / count))
        inside, specular = refract_in(arriving, normals, body.outer.eta)
        return _ThinBeams(count, points, inside, specular)

    def _warnings(self, beams: "_ThinBeams", body: Body) -> list[str]:
        warnings: list[str] = []
        if len(beams.entries) < beams.count:
            warnings.append(_missed_note(1 - len(beams.entries) / beams.count))
        spacing = self.radius * math.sqrt(math.pi / beams.count)
        if spacing > 0:
            spacing /= shallowest_depth(beams.inside, body)
        if spacing > 1.0:
            warnings.append(
                Note(
                    "beam-spotted",
                    f"the beam is so wide that the {beams.count} thin ones it is made of lie {spacing:.2g} mean free "
                    "paths apart: its exitance is spotted close to where it enters.",
                    value=spacing,
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

    def _deposit_as_spot(self, body: Body) -> Deposit:
        spot = Disc(self.origin, self.radius)
        beam = CollimatedBeam(self.direction, self.power / spot.area, spot, from_center=True)
        entries = beam.entries(body.surface)
        if len(entries) == 0:
            raise self._miss(body.surface)
        missed = 1.0 - len(entries) / (ENTRY_RAYS + 1)
        return replace(beam.deposit_in(body), warnings=(_missed_note(missed),) if missed > 0 else ())

    def _check_outside(self, surface: Surface, origin: FloatArray) -> None:
        if contains_point(surface, origin):
            raise InputError(
                f"the beam starts inside the body, at {as_text(self.origin)}; move its origin outside, "
                "or use a point source."
            )

    def _miss(self, surface: Surface) -> InputError:
        return InputError(
            f"the beam from {as_text(self.origin)} along {as_text(self.direction)} misses the body, which spans "
            f"{surface.extent}; change its origin or direction."
        )


@dataclass(frozen=True, eq=False)
class _ThinBeams:
    """Thin beams that represent one.

    Attributes
    ----------
    count : int
        All of them, with those that miss the body.
    entries : (e, 3) ndarray
        Where the others meet the surface, unit.
    inside : Rays
        Those that pass the surface, refracted.
    specular : float
        Power reflected there, W.
    """

    count: int
    entries: FloatArray
    inside: Rays
    specular: float


def _missed_note(share: float) -> Note:
    text = f"{share:.0%} of the beam's cross-section misses the body; incident power counts the rest."
    return Note("beam-partly-missed", text, value=share)
