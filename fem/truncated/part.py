"""`Part`: the part of a body that light reaches, cut out by a box."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.fem.body.body import Body
from tetlux.fem.exact import half_space
from tetlux.fem.media.medium import Medium
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import BoolArray, FloatArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.repair.box_cut import cut_to_box, refine_around
from tetlux.meshing.surface.solids import Box, Slab
from tetlux.meshing.surface.surface import Surface

# Beyond the cut the exitance is below this share of the brightest, so that no picture changes.
DARK = 1e-7
# A distance of more than this share of the body's diagonal cuts off too little.
LARGEST_SHARE = 0.3
# Mean free paths between which the distance of the cut from the light is sought.
NEAREST, FARTHEST, STEPS = 4.0, 2000.0, 60
# Regions are cut so much before the body, as a share of the distance of the cut.
REGION_MARGIN = 0.02
# Triangles around the light of a body whose triangles are larger are split to this share of the distance of the cut.
EDGE = 0.25
# Thin triangles along the cut may cross each other, on which meshing takes ten times as long: the cut is then moved by
# this share of its distance, at most so often.
SHIFT, MOST_SHIFTS = 0.01, 5


@dataclass(frozen=True, eq=False)
class Part:
    """The part of a body within a box around the light.

    Attributes
    ----------
    surface : Surface
        Of the part, closed by the faces of the box.
    inner : tuple of (int, Surface)
        The regions in it, by their number in the body from 0.
    low, high : (3,) ndarray
        Corners of the box, unit.
    distance : float
        From the light to the cut, unit.
    """

    surface: Surface
    inner: tuple[tuple[int, Surface], ...]
    low: FloatArray
    high: FloatArray
    distance: float

    def is_cut(self, points: FloatArray, margin: float = 1e-6) -> BoolArray:
        """Whether points (n, 3) of the part lie on the cut, or beyond it, (n,)."""
        slack = margin * self.distance
        return np.asarray(((points < self.low + slack) | (points > self.high - slack)).any(axis=1))

    __repr__ = one_line


def distance_of_cut(bodies: Sequence[Body], deposits: Sequence[Sequence[Deposit]], share: float = DARK) -> float:
    """Distance from the light at which the exitance of a half-space is below a share of its brightest.

    It is that of a point source as deep as light is deposited, straight below the entry, where there is more light than
    along the surface. Of several media the one with the longest reach counts.

    Parameters
    ----------
    bodies : sequence of Body
        With the media of each scene.
    deposits : sequence of sequence of Deposit
        Of each scene.
    share : float

    Returns
    -------
    float
        unit.

    Raises
    ------
    InputError
        If light enters or reaches everywhere.
    """
    box_around([deposit for some in deposits for deposit in some], 0.0)
    found = 0.0
    for body, some in zip(bodies, deposits, strict=True):
        depth = _largest_depth(body, some)
        for medium in body.by_label.values():
            if not isinstance(medium, Medium):
                raise InputError("the medium varies within the body, and how far light reaches is not known")
            found = max(found, _reach(medium, max(depth, medium.mean_free_path), share))
    if not found < LARGEST_SHARE * bodies[0].surface.diagonal:
        raise InputError("light reaches most of the body")
    return found


def _largest_depth(body: Body, deposits: Sequence[Deposit]) -> float:
    points = np.vstack([np.zeros((0, 3)), *(deposit.terms.points for deposit in deposits)])
    return float(body.surface.distances(points).max()) if len(points) else 0.0


def _reach(medium: Medium, depth: float, share: float) -> float:
    free_path = medium.mean_free_path
    below = depth + free_path * np.geomspace(NEAREST, FARTHEST, STEPS)
    places = np.column_stack([np.zeros((STEPS, 2)), below])
    robin = 0.5 / medium.boundary_factor
    brightest = float(half_space.point_exitance(medium, depth=depth, rho=np.zeros(1))[0])
    dark = robin * half_space.point_fluence(medium, depth=depth, points=places) < share * brightest
    return float(below[dark.argmax()]) if dark.any() else np.inf


def box_around(deposits: Sequence[Deposit], distance: float) -> tuple[FloatArray, FloatArray]:
    """The corners of the box whose faces are at a distance from all light.

    Raises
    ------
    InputError
        If light enters everywhere.
    """
    places = []
    for deposit in deposits:
        terms, entries = deposit.terms, deposit.footprint.entries
        is_everywhere = np.any(terms.irradiance) or np.any(terms.emission) or deposit.footprint.radius == np.inf
        if is_everywhere or len(entries) + len(terms.points) == 0:
            raise InputError("light enters everywhere")
        places += [entries, terms.points]
    lit = np.vstack(places)
    return lit.min(axis=0) - distance, lit.max(axis=0) + distance


def cut_part(body: Body, inner: Sequence[Surface], deposits: Sequence[Deposit], distance: float) -> Part:
    """Cut out the part of a body within a distance of the light.

    Raises
    ------
    InputError
        If light enters everywhere, or the cut bounds no body.
    """
    for attempt in range(MOST_SHIFTS):
        part = _cut(body, inner, deposits, distance * (1.0 + SHIFT * attempt))
        if part.surface.overlaps == body.surface.overlaps:
            break
    return part


def _cut(body: Body, inner: Sequence[Surface], deposits: Sequence[Deposit], distance: float) -> Part:
    low, high = box_around(deposits, distance)
    middle, reach = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    surface = body.surface
    count = int((np.linalg.norm(surface.points - middle, axis=1) < reach).sum())
    if count < 1.0 / EDGE**2 and not isinstance(surface.shape, Box | Slab):
        surface = refine_around(surface, middle, reach, EDGE * distance)
    whole = cut_to_box(surface, low, high)
    if whole is None:
        raise InputError("no part of the body is near the light")
    margin = REGION_MARGIN * distance
    regions = []
    for number, region in enumerate(inner):
        part = cut_to_box(region, low + margin, high - margin)
        if part is not None:
            regions.append((number, part))
    return Part(whole, tuple(regions), low, high, distance)
