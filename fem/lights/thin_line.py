"""A beam without width that fades along its path: as a segment, and what of it is known on a mesh only."""

import math
from dataclasses import dataclass, replace

import numpy as np

from tetlux.fem.ballistic.follow import Rays, beyond, follow
from tetlux.fem.body.body import Body
from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.sources.deposit import Deposit, together
from tetlux.meshing.describe import one_line
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# A beam with this share of its power left at the far side stays there.
NEGLIGIBLE = 1e-12
# A thin beam is as good as this many points on it, as far as where a thousandth of it is left.
LIT, FADED = 28, 7.0
# A mesh's facets lie within this share of the body's diagonal from its surface.
ASTRAY = 0.02


def line_of(rays: Rays, body: Body) -> Deposit:
    """A beam without width: through one medium to the far side at once; the rest, and several media, on the mesh."""
    if len(rays.powers) == 0:
        return Deposit()
    surface, medium = body.surface, body.only_medium
    start, direction, power = rays.starts[0], rays.directions[0], float(rays.powers[0])
    beam = _ThinBeam(rays, ASTRAY * surface.diagonal)
    way_out = surface.exit(start, direction)
    length = way_out[0] if way_out else 0.0
    paths = body.paths(rays.starts, rays.directions, np.array([length]), body.ways_out(rays.starts, rays.directions)[0])
    resolution = 0.5 * float(paths.place(np.ones(1), peaked=True)[0])
    rows = np.linspace(0.0, FADED, LIT)
    along = np.minimum([paths.place(np.array([depth]), peaked=True)[0] for depth in rows], length)
    lit = start + np.unique(along)[:, None] * direction
    if medium is None:
        return Deposit(lit=lit, resolution=resolution, on_mesh=FollowedBeam(beam))
    extinction = medium.sigma_a + medium.delta_eddington[0]
    end = power * math.exp(-extinction * length)
    segment = Deposit(
        absorbed=(power - end) * medium.sigma_a / extinction,
        starts=rays.starts,
        directions=rays.directions,
        lengths=np.array([length]),
        fluxes=rays.powers,
        lit=lit,
        resolution=resolution,
    )
    if end <= NEGLIGIBLE * power:
        return replace(segment, absorbed=segment.absorbed + end)
    return replace(segment, on_mesh=RestOfBeam(beam, end))


@dataclass(frozen=True, eq=False)
class _ThinBeam:
    """A thin beam inside the body, and how far the facets of a mesh may lie from the body's surface, unit."""

    rays: Rays
    astray: float

    def on(self, mesh: TetMesh) -> Rays:
        """The beam from where it meets a facet of the mesh."""
        start, direction = self.rays.starts[0], self.rays.directions[0]
        back = (start - self.astray * direction)[None]
        distance, face = mesh.rays.first(back, self.rays.directions)
        met = face[0] >= 0 and distance[0] < 2.0 * self.astray
        place = back + distance[0] * direction if met else mesh.closest_boundary(start[None])[0]
        return replace(self.rays, starts=place)


@dataclass(frozen=True, eq=False)
class FollowedBeam:
    """A thin beam that is followed through the tetrahedra of a mesh."""

    beam: _ThinBeam

    def on(self, mesh: TetMesh, surface: Surface, coefficients: Coefficients) -> Deposit:
        """See `tetlux.fem.sources.deposit.OnMesh`."""
        del surface
        return follow(mesh, coefficients, self.beam.on(mesh))

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class RestOfBeam:
    """What of a thin beam reaches the far side of the body, W: reflected there and followed, or let out."""

    beam: _ThinBeam
    power: float

    def on(self, mesh: TetMesh, surface: Surface, coefficients: Coefficients) -> Deposit:
        """See `tetlux.fem.sources.deposit.OnMesh`."""
        del surface
        ray = self.beam.on(mesh)
        distance, face = mesh.rays.first(ray.starts, ray.directions)
        if face[0] < 0:
            return Deposit(ballistic=self.power)
        places = ray.starts + distance[:, None] * ray.directions[0]
        arrived = Rays(places, ray.directions, np.array([self.power]))
        on, ballistic, specular = beyond(mesh, coefficients, arrived, face)
        return together([Deposit(ballistic=ballistic, specular=specular), follow(mesh, coefficients, on)])

    __repr__ = one_line
