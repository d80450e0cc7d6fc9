"""`Part`: the part of a body that light reaches, cut out by a box."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from tetlux.fem.body.body import Body
from tetlux.fem.exact import half_space
from tetlux.fem.media.medium import Medium
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import BoolArray, FloatArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.repair.box_cut import cut_to_box, refine_around
from tetlux.meshing.surface.solids import Box as Cuboid
from tetlux.meshing.surface.solids import Slab
from tetlux.meshing.surface.surface import Surface

# Beyond the cut the exitance is below this share of the brightest, so that no picture changes.
DARK = 1e-7
# Where the cut is inside the body, light is below this share of the brightest for a tolerance of .02, and darker for
# smaller ones: what the cut reflects of it fades again on its way to the surface.
DARK_INSIDE, OF_TOLERANCE = 1e-5, 0.02
# Vertices of the surface at which the exitance is estimated, at most; a surface with fewer around the light than
# FEWEST_VERTICES is taken to be as bright everywhere as a half-space is straight below the light.
MOST_VERTICES, FEWEST_VERTICES = 300, 100
# What is bright is kept, and a border of this share of the distance of the cut around it.
BORDER = 0.05
# A distance of more than this share of the body's diagonal cuts off too little.
LARGEST_SHARE = 0.3
# Mean free paths between which the distance of the cut from the light is sought.
NEAREST, FARTHEST, STEPS = 4.0, 2000.0, 60
# Regions are cut so much before the body, as a share of the distance of the cut.
REGION_MARGIN = 0.02
# Triangles around the light of a body whose triangles are larger are split to this share of the distance of the cut.
EDGE = 0.25
# The cut may be open or cross itself, where it meets vertices and edges (half of the cuts of nefertiti): it is moved by
# this share of its distance then, at most so often.
SHIFT, MOST_SHIFTS = 0.01, 8


@dataclass(frozen=True, eq=False)
class Box:
    """A box around the light of a body, beyond which the body is dark.

    Attributes
    ----------
    low, high : (3,) ndarray
        Corners, unit.
    distance : float
        Least distance from the light to a face, unit.
    """

    low: FloatArray
    high: FloatArray
    distance: float

    def enlarge(self, factor: float) -> "Box":
        """The box, larger about its middle."""
        middle = 0.5 * (self.low + self.high)
        grown = factor * (self.high - middle)
        return Box(middle - grown, middle + grown, self.distance + (factor - 1.0) * float((self.high - middle).min()))

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class Part:
    """The part of a body within a box around the light.

    Attributes
    ----------
    surface : Surface
        Of the part, closed by the faces of the box.
    inner : tuple of (int, Surface)
        The regions in it, by their number in the body from 0.
    box : Box
    """

    surface: Surface
    inner: tuple[tuple[int, Surface], ...]
    box: Box

    @property
    def distance(self) -> float:
        """Least distance from the light to the cut, unit."""
        return self.box.distance

    def is_cut(self, points: FloatArray, margin: float = 1e-6) -> BoolArray:
        """Whether points (n, 3) of the part lie on the cut, or beyond it, (n,)."""
        slack = margin * self.distance
        return np.asarray(((points < self.box.low + slack) | (points > self.box.high - slack)).any(axis=1))

    __repr__ = one_line


def dark_box(bodies: Sequence[Body], deposits: Sequence[Sequence[Deposit]], tolerance: float) -> Box:
    """The box beyond which a body is dark: see `DARK` and `DARK_INSIDE`.

    Light is that of a point source in a half-space below each place where light enters, as deep as it is deposited. Of
    several media the one with the longest reach counts.

    Parameters
    ----------
    bodies : sequence of Body
        With the media of each scene.
    deposits : sequence of sequence of Deposit
        Of each scene.
    tolerance : float
        Wanted relative L2 error of the exitance.

    Raises
    ------
    InputError
        If light enters or reaches everywhere.
    """
    surface, together = bodies[0].surface, [deposit for some in deposits for deposit in some]
    lit = _lit_places(together)
    depth, media = _largest_depth(bodies[0], together), _media(bodies)
    depths = [max(depth, medium.mean_free_path) for medium in media]
    # A wide spot is dimmer than a point of the same power by the ratio of their areas.
    spread = float(np.linalg.norm(lit - lit.mean(axis=0), axis=1).max())
    share = DARK / max(1.0, (spread / max(depths)) ** 2)
    share_inside = share * DARK_INSIDE / DARK * min(1.0, tolerance / OF_TOLERANCE)
    reaches = np.array([_reaches(medium, z, (share, share_inside)) for medium, z in zip(media, depths, strict=True)])
    far, near = reaches.max(axis=0).tolist()
    # What follows can only enlarge the box.
    _check_dark(near, surface)
    low, high = lit.min(axis=0), lit.max(axis=0)
    around = surface.points[((surface.points > low - far) & (surface.points < high + far)).all(axis=1)]
    if len(around) < FEWEST_VERTICES:
        box = Box(low - far, high + far, far)
    else:
        some = around[:: -(-len(around) // MOST_VERTICES)]
        brightness = np.max(
            [_brightness(medium, z, surface, lit, some) for medium, z in zip(media, depths, strict=True)], axis=0
        )
        bright = np.vstack([some[brightness > share], lit])
        border = BORDER * far
        box = Box(
            np.minimum(bright.min(axis=0) - border, low - near),
            np.maximum(bright.max(axis=0) + border, high + near),
            near,
        )
    _check_dark(box.distance, surface)
    return box


def _check_dark(distance: float, surface: Surface) -> None:
    """Refuse a box whose faces are so far from the light that little of the body is beyond them."""
    if not distance < LARGEST_SHARE * surface.diagonal:
        raise InputError("light reaches most of the body")


def _lit_places(deposits: Sequence[Deposit]) -> FloatArray:
    """Places where light enters, and points where it is deposited, (n, 3)."""
    places = []
    for deposit in deposits:
        terms, entries = deposit.terms, deposit.footprint.entries
        is_everywhere = np.any(terms.irradiance) or np.any(terms.emission) or deposit.footprint.radius == np.inf
        if is_everywhere or len(entries) + len(terms.points) == 0:
            raise InputError("light enters everywhere")
        places += [entries, terms.points]
    return np.vstack(places)


def _media(bodies: Sequence[Body]) -> list[Medium]:
    """All media of all scenes."""
    found = []
    for body in bodies:
        for medium in body.by_label.values():
            if not isinstance(medium, Medium):
                raise InputError("the medium varies within the body, and how far light reaches is not known")
            found.append(medium)
    return list(dict.fromkeys(found))


def _largest_depth(body: Body, deposits: Sequence[Deposit]) -> float:
    points = np.vstack([np.zeros((0, 3)), *(deposit.terms.points for deposit in deposits)])
    return float(body.surface.distances(points).max()) if len(points) else 0.0


def _reaches(medium: Medium, depth: float, shares: Sequence[float]) -> list[float]:
    """Distances straight below a source at which light is below shares of the brightest exitance, unit; or inf."""
    below = depth + medium.mean_free_path * np.geomspace(NEAREST, FARTHEST, STEPS)
    light = _relative(medium, depth, np.zeros(STEPS), below)
    dark = [light < share for share in shares]
    return [float(below[each.argmax()]) if each.any() else np.inf for each in dark]


def _brightness(medium: Medium, depth: float, surface: Surface, lit: FloatArray, points: FloatArray) -> FloatArray:
    """Light at points (n, 3) as a share of the brightest exitance, from the nearest of the lit places."""
    _, nearest = cKDTree(lit).query(points)
    feet, faces = surface.closest(lit)
    away = points - feet[nearest]
    below = np.maximum(-np.einsum("ij,ij->i", away, surface.normals[faces[nearest]]), 0.0)
    aside = np.sqrt(np.maximum((away**2).sum(axis=1) - below**2, 0.0))
    return _relative(medium, depth, aside, below)


def _relative(medium: Medium, depth: float, aside: FloatArray, below: FloatArray) -> FloatArray:
    """``phi/(2A)`` in a half-space with a point source, as a share of the exitance above the source."""
    places = np.column_stack([aside, np.zeros_like(aside), below])
    brightest = float(half_space.point_exitance(medium, depth=depth, rho=np.zeros(1))[0])
    with np.errstate(divide="ignore"):
        fluence = half_space.point_fluence(medium, depth=depth, points=places)
    return np.asarray(0.5 * fluence / medium.boundary_factor / brightest)


def cut_part(body: Body, inner: Sequence[Surface], box: Box) -> Part:
    """Cut out the part of a body within a box.

    Raises
    ------
    InputError
        If no part of the body is in the box, or no cut is sound.
    """
    for attempt in range(MOST_SHIFTS):
        try:
            part = _cut(body, inner, box.enlarge(1.0 + SHIFT * attempt))
        except InputError:
            continue
        if part.surface.overlaps == body.surface.overlaps:
            return part
    raise InputError("no sound surface of the part that light reaches was found", remedy='give model="full"')


def _cut(body: Body, inner: Sequence[Surface], box: Box) -> Part:
    middle, reach = 0.5 * (box.low + box.high), 0.5 * float(np.linalg.norm(box.high - box.low))
    surface = body.surface
    count = int((np.linalg.norm(surface.points - middle, axis=1) < reach).sum())
    if count < 1.0 / EDGE**2 and not isinstance(surface.shape, Cuboid | Slab):
        surface = refine_around(surface, middle, reach, EDGE * box.distance)
    whole = cut_to_box(surface, box.low, box.high)
    if whole is None:
        raise InputError("no part of the body is near the light")
    margin = REGION_MARGIN * box.distance
    parts = [cut_to_box(region, box.low + margin, box.high - margin) for region in inner]
    return Part(whole, tuple((number, part) for number, part in enumerate(parts) if part is not None), box)
