"""A beam without width that decays along its path: a segment, and a remainder that is only known on a mesh."""

import math
from dataclasses import dataclass, replace

import numpy as np

from tetlux.fem.ballistic.follow import follow
from tetlux.fem.ballistic.interface import reflect_and_exit
from tetlux.fem.ballistic.rays import Rays
from tetlux.fem.body.body import Body
from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.sources.deposit import Deposit, merge_deposits
from tetlux.fem.sources.hints import MeshHints
from tetlux.fem.sources.ledger import Ledger
from tetlux.fem.sources.segments import Segments
from tetlux.fem.sources.terms import SourceTerms
from tetlux.meshing.describe import one_line
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# A beam with this share of its power left at the far side is absorbed there.
NEGLIGIBLE = 1e-12
# The mesh is fine near this many places along the beam, in equal steps of optical depth down to the second number,
# where a thousandth of the power is left.
PLACES, LARGEST_DEPTH = 28, 7.0
# Facets of a mesh are this share of the body's diagonal away from its surface, at most.
FACET_DISTANCE = 0.02


def line_of(rays: Rays, body: Body) -> Deposit:
    """Deposit a beam without width along its path.

    Parameters
    ----------
    rays : Rays
        One ray on the surface, refracted; or none, if all of it is reflected.
    body : Body

    Returns
    -------
    Deposit
        In a body of one medium a segment to the far side, of which the part that arrives there depends on the mesh.
        In a body of several media all of it depends on the mesh.
    """
    if len(rays) == 0:
        return Deposit()
    surface, medium = body.surface, body.only_medium
    beam = _ThinBeam(rays, FACET_DISTANCE * surface.diagonal)
    way_out = surface.exit(rays.starts[0], rays.directions[0])
    length = way_out[0] if way_out else 0.0
    hints = _hints_along(rays, length, body)
    if medium is None:
        return Deposit(hints=hints, on_mesh=FollowedBeam(beam))
    power, extinction = float(rays.powers[0]), medium.sigma_a + medium.delta_eddington[0]
    end = power * math.exp(-extinction * length)
    absorbed = (power - end) * medium.sigma_a / extinction
    segment = Segments(rays.starts, rays.directions, np.array([length]), rays.powers)
    deposit = Deposit(Ledger(absorbed=absorbed), SourceTerms(segments=segment), hints)
    if end <= NEGLIGIBLE * power:
        return replace(deposit, ledger=Ledger(absorbed=absorbed + end))
    return replace(deposit, on_mesh=TransmittedBeam(beam, end))


def _hints_along(rays: Rays, length: float, body: Body) -> MeshHints:
    """Places along a ray of a given length inside, and half its penetration depth to resolve there."""
    begins, _ = body.extents_along(rays.starts, rays.directions)
    paths = body.paths(rays.starts, rays.directions, np.array([length]), begins)
    resolution = 0.5 * float(paths.distances_at(np.ones(1), delta_eddington=True)[0])
    depths = np.linspace(0.0, LARGEST_DEPTH, PLACES)
    along = np.minimum([paths.distances_at(np.array([depth]), delta_eddington=True)[0] for depth in depths], length)
    return MeshHints(resolution, rays.starts[0] + np.unique(along)[:, None] * rays.directions[0])


@dataclass(frozen=True, eq=False)
class _ThinBeam:
    """One ray inside a body, and the largest distance of a mesh's facets from the body's surface, unit."""

    rays: Rays
    facet_distance: float

    def rays_on(self, mesh: TetMesh) -> Rays:
        """The ray from where it enters the mesh."""
        start, direction = self.rays.starts[0], self.rays.directions[0]
        before = (start - self.facet_distance * direction)[None]
        distance, facet = mesh.rays.first(before, self.rays.directions)
        met = facet[0] >= 0 and distance[0] < 2.0 * self.facet_distance
        place = before + distance[0] * direction if met else mesh.closest_boundary(start[None])[0]
        return replace(self.rays, starts=place)


@dataclass(frozen=True, eq=False)
class FollowedBeam:
    """A thin beam that is followed through the tetrahedra of a mesh."""

    beam: _ThinBeam

    def deposit_on(self, mesh: TetMesh, surface: Surface, coefficients: Coefficients) -> Deposit:
        """See `tetlux.fem.sources.deposit.MeshDependent`."""
        del surface
        return follow(mesh, coefficients, self.beam.rays_on(mesh))

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class TransmittedBeam:
    """The part of a thin beam that arrives at the far side of the body, W: it leaves, or is reflected and followed."""

    beam: _ThinBeam
    power: float

    def deposit_on(self, mesh: TetMesh, surface: Surface, coefficients: Coefficients) -> Deposit:
        """See `tetlux.fem.sources.deposit.MeshDependent`."""
        del surface
        rays = self.beam.rays_on(mesh)
        distances, facets = mesh.rays.first(rays.starts, rays.directions)
        if facets[0] < 0:
            return Deposit(Ledger(ballistic=self.power))
        places = rays.starts + distances[:, None] * rays.directions[0]
        arriving = Rays(places, rays.directions, np.array([self.power]))
        remaining, ballistic, specular = reflect_and_exit(mesh, coefficients, arriving, facets)
        outside = Deposit(Ledger(ballistic=ballistic, specular=specular))
        return merge_deposits([outside, follow(mesh, coefficients, remaining)])

    __repr__ = one_line
