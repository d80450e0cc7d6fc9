"""Beams followed through a mesh from facet to facet: attenuated, reflected inside, let out, and entering again."""

from dataclasses import dataclass, field, replace

import numpy as np

from tetlux.fem.ballistic.extinction import attenuate
from tetlux.fem.ballistic.interface import reflect_and_exit, refract_in
from tetlux.fem.ballistic.rays import NO_CELLS, Rays, join_rays
from tetlux.fem.media.coefficients import Coefficients, at_cells
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.ledger import Ledger
from tetlux.fem.sources.segments import Segments
from tetlux.fem.sources.terms import SourceTerms
from tetlux.meshing.arrays import BoolArray, FloatArray
from tetlux.meshing.search.rays import OFFSET
from tetlux.meshing.tets.mesh import TetMesh

# A ray ends where it has this share of the mean initial power left; the remainder is deposited along its last segment.
NEGLIGIBLE_POWER = 1e-10
# A reflected or re-entering ray with less than this share of the mean initial power, times the share of all power that
# was lost on the way, is deposited at its facet. Tolerances of the solver end at 1e-4.
NEGLIGIBLE_REFLECTION = 1e-6
# After this many facets the remainder is deposited at the last one.
MOST_FACETS = 64


def refract_and_follow(mesh: TetMesh, coefficients: Coefficients, arriving: Rays, normals: FloatArray) -> Deposit:
    """Refract rays that arrive at a mesh from outside, and follow them inside.

    Parameters
    ----------
    mesh : TetMesh
    coefficients : Coefficients
    arriving : Rays
        They start on the boundary of the mesh, each with the power that arrives there.
    normals : (r, 3) ndarray
        Outward unit normals of the facets that they start on.

    Returns
    -------
    Deposit
        Its ledger holds all of the incident power.
    """
    refracted, specular = refract_in(arriving, normals, coefficients.outer.eta)
    deposit = follow(mesh, coefficients, refracted)
    outside = Ledger(incident=float(arriving.powers.sum()), specular=specular)
    return replace(deposit, ledger=Ledger.merge([outside, deposit.ledger]))


def follow(mesh: TetMesh, coefficients: Coefficients, rays: Rays) -> Deposit:
    """Follow beams that start on the boundary of a mesh and point inwards.

    Parameters
    ----------
    mesh : TetMesh
    coefficients : Coefficients
    rays : Rays

    Returns
    -------
    Deposit
        Segments, points where faint rays end, and the power that is absorbed, that leaves the body, and that is
        reflected from outside where rays enter again. Its ledger has no incident power.
    """
    rays = _with_cells(mesh, rays)
    trace = _Trace(mesh, coefficients, float(rays.powers.sum()) / max(len(rays), 1))
    for _ in range(MOST_FACETS):
        if len(rays) == 0:
            break
        rays = trace.advance(rays)
    trace.ended.append(rays)
    return trace.deposit()


def _with_cells(mesh: TetMesh, rays: Rays) -> Rays:
    """The same rays with the tetrahedra in which they start.

    An unknown tetrahedron is guessed: the one behind the first facet that is met from a little before the start.
    `march` corrects wrong guesses.
    """
    unknown = np.flatnonzero(rays.cells < 0)
    before = rays.starts[unknown] - 2.0 * OFFSET * mesh.diagonal * rays.directions[unknown]
    _, facets = mesh.rays.first(before, rays.directions[unknown])
    cells = rays.cells.copy()
    cells[unknown] = np.where(facets >= 0, mesh.boundary_cells[facets], -1)
    return replace(rays, cells=cells)


@dataclass
class _Trace:
    """What rays leave on their way: segments, rays that end at a facet, and powers, W."""

    mesh: TetMesh
    coefficients: Coefficients
    mean_power: float
    segments: list[Segments] = field(default_factory=lambda: [Segments(cells=NO_CELLS)])
    ended: list[Rays] = field(default_factory=list)
    absorbed: float = 0.0
    ballistic: float = 0.0
    specular: float = 0.0

    def advance(self, rays: Rays) -> Rays:
        """Follow rays (at least one) to the next facet and beyond it: those that are reflected or enter again."""
        distances, facets = self.mesh.rays.first(rays.starts, rays.directions)
        # At the edge of a facet rounding may put a ray outside at once; a ray along a facet would meet it for ever.
        leaves = (facets < 0) | (distances < OFFSET * self.mesh.diagonal)
        self.ballistic += float(rays.powers[leaves].sum())
        rays, facets = rays[~leaves], facets[~leaves]
        if len(rays) == 0:
            return rays
        power = float(rays.powers.sum())
        ends, done = self._deposit_segments(rays, distances[~leaves])
        share_lost = 1.0 - float(ends.powers.sum()) / power
        rays, ballistic, specular = reflect_and_exit(self.mesh, self.coefficients, ends[~done], facets[~done])
        self.ballistic += ballistic
        self.specular += specular
        faint = rays.powers <= NEGLIGIBLE_REFLECTION * self.mean_power * share_lost
        self.ended.append(rays[faint])
        return rays[~faint]

    def _deposit_segments(self, rays: Rays, distances: FloatArray) -> tuple[Rays, BoolArray]:
        """The rays at the next facet, at given distances, and whether each ends before it."""
        longest = -np.log(NEGLIGIBLE_POWER) / float(np.min(self.coefficients.extinction))
        lengths = np.minimum(distances, longest)
        powers, absorbed = attenuate(self.mesh, self.coefficients, rays, lengths)
        lost = rays.powers - powers
        done = (lost > 0) & ((powers <= NEGLIGIBLE_POWER * self.mean_power) | (lengths < distances))
        # The remainder of a ray that ends is distributed along the segment like the power that it lost there.
        scale = np.where(done, rays.powers / np.where(done, lost, 1.0), 1.0)
        self.absorbed += float(absorbed @ scale)
        self.segments.append(Segments(rays.starts, rays.directions, lengths, scale * rays.powers, rays.cells))
        return Rays(rays.starts + lengths[:, None] * rays.directions, rays.directions, powers), done

    def deposit(self) -> Deposit:
        """All of it; rays that ended are partly absorbed points in the tetrahedra behind their facets."""
        ended, coefficients = join_rays(self.ended), self.coefficients
        scattered = (
            at_cells(coefficients.delta_eddington_scattering / coefficients.extinction, ended.cells) * ended.powers
        )
        absorbed = self.absorbed + float((ended.powers - scattered).sum())
        return Deposit(
            Ledger(specular=self.specular, absorbed=absorbed, ballistic=self.ballistic),
            SourceTerms(ended.starts, scattered, ended.cells, Segments.merge(self.segments)),
        )
