"""How fine a mesh has to be, and where: edges in proportion to the distance from the light."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from tetlux.fem.lights.deposit import Deposit
from tetlux.fem.medium import Medium
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.refine import refine
from tetlux.meshing.surface import Surface
from tetlux.meshing.tetmesh import TetMesh

# Fluence falls by 1/r near a source and by exp(-sigma_tr r) far from it: its own length is the shorter of
# r and this many decay lengths, and equal edges in that measure make equal relative errors.
DECAY_LENGTHS = 1.5
# Where a body is hundreds of decay lengths across, its far side is dark, and stays this coarse.
COARSEST_SHARE = 1 / 24
# The L2 error of the exitance is made where it is bright. From this many resolutions on, edges grow faster, as the
# exitance falls by exp(-sigma_tr r)/r³; taken to its end that leaves nothing to see in the dark, so it stops at the
# second number. Against edges in proportion to the distance alone this saves a third of the tetrahedra at the same
# error on a slab, and starting nearer to the light loses more than it saves.
BRIGHT, COARSER_IN_THE_DARK = 4.0, 3.0
# A line is as good as points this many resolutions apart.
SPACING = 0.5


@dataclass(frozen=True, eq=False)
class Grading:
    """Wanted edge lengths round a set of deposits.

    Parameters
    ----------
    sources : (s, 3) ndarray
        Where light is deposited, lines as rows of points.
    resolution : (s,) ndarray
        Length that has to be resolved at each, unit.
    longest : float
        Upper bound of the length that edges are measured in, unit.
    sigma_tr, extrapolation_length : float
        Of the medium, 1/unit and unit.
    skin : float
        Length to be resolved all over the surface, unit; infinite where no light falls on all of it.
    """

    sources: FloatArray
    resolution: FloatArray
    longest: float
    sigma_tr: float
    extrapolation_length: float
    skin: float = np.inf

    def lengths(self, mesh: TetMesh) -> FloatArray:
        """The length that light changes over in each tetrahedron, (m,), unit."""
        centroids = mesh.points[mesh.tetrahedra].mean(axis=1)
        depth, _ = cKDTree(mesh.boundary_points).query(centroids)
        lengths = np.minimum(np.maximum(depth, self.skin), self.longest)
        if len(self.sources):
            distance, nearest = cKDTree(self.sources).query(centroids)
            near = self.resolution[nearest]
            distance = np.maximum(distance, near)
            faded = np.exp(np.minimum(2 / 7 * self.sigma_tr * (distance - near), np.log(COARSER_IN_THE_DARK)))
            dim = np.clip(np.sqrt(distance / (BRIGHT * near)) * faded, 1.0, COARSER_IN_THE_DARK)
            scale = np.minimum(distance, self.longest) * dim
            # Towards the surface the fluence itself falls, by (zb + depth)/scale, and its curvature does not.
            lengths = np.minimum(lengths, np.sqrt(scale * np.minimum(scale, self.extrapolation_length + depth)))
        return lengths


def grading_for(deposits: list[Deposit], medium: Medium, surface: Surface) -> Grading:
    """The grading that the lights and the medium of a scene ask for."""
    sources, resolutions = [np.zeros((0, 3))], [np.zeros(0)]
    extinction = medium.sigma_a + medium.delta_eddington[0]
    for deposit in deposits:
        points = [deposit.points]
        for start, direction, length in zip(deposit.starts, deposit.directions, deposit.lengths, strict=True):
            # After seven extinction lengths a beam holds a thousandth.
            reach = min(float(length), 7.0 / extinction)
            count = max(2, int(reach / (SPACING * deposit.resolution)) + 1)
            points.append(start + np.linspace(0.0, reach, count)[:, None] * direction)
        found = np.vstack(points)
        sources.append(found)
        resolutions.append(np.full(len(found), deposit.resolution))
    decay = 1.0 / medium.sigma_tr if medium.sigma_tr > 0 else np.inf
    return Grading(
        np.vstack(sources),
        np.concatenate(resolutions),
        longest=max(min(DECAY_LENGTHS * decay, surface.diagonal), COARSEST_SHARE * surface.diagonal),
        sigma_tr=medium.sigma_tr,
        extrapolation_length=medium.extrapolation_length,
        skin=2.0 * decay if any(d.irradiance for d in deposits) else np.inf,
    )


def graded(mesh: TetMesh, surface: Surface, grading: Grading, fineness: float, most: int) -> tuple[TetMesh, bool]:
    """Refine until no edge is longer than `fineness` times the grading's length there.

    Parameters
    ----------
    mesh : TetMesh
    surface : Surface
        New boundary nodes are moved onto it.
    grading : Grading
    fineness : float
    most : int
        Tetrahedra at which refinement stops.

    Returns
    -------
    mesh : TetMesh
    reached : bool
        False if `most` stopped it.
    """
    while True:
        marked = mesh.longest_edges > fineness * grading.lengths(mesh)
        if not marked.any():
            return mesh, True
        if len(mesh.tetrahedra) + int(marked.sum()) > most:
            return mesh, False
        finer = refine(mesh, marked, surface)
        # Neighbours are split along with what was marked.
        if len(finer.tetrahedra) > most:
            return mesh, False
        mesh = finer
