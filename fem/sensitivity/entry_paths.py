"""The tetrahedra between the surface and the points of a light: what moves its points and changes their power."""

import numpy as np
from scipy.sparse import csr_array

from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.march import march
from tetlux.meshing.tets.mesh import TetMesh


def entry_shares(deposit: Deposit, mesh: TetMesh, surface: Surface, labels: IntArray, count: int) -> csr_array:
    """Shares of each tetrahedron in what moves the points of a light.

    Parameters
    ----------
    deposit : Deposit
    mesh : TetMesh
    surface : Surface
        What the mesh stands for.
    labels : (m,) ndarray
        The number of the medium of each tetrahedron, of `count`.
    count : int

    Returns
    -------
    (m, count) csr_array
        By the length of the ways from the surface in each tetrahedron, times the power of their points. Of each medium
        they sum to 1; one that light does not cross on its way has the shares of volume.
    """
    held = _power_lengths(deposit, mesh, surface)
    volumes = np.bincount(labels, mesh.volumes, minlength=count)
    crossed = np.bincount(labels, held, minlength=count)
    shares = np.where(
        crossed[labels] > 0, held / np.where(crossed > 0, crossed, 1.0)[labels], mesh.volumes / volumes[labels]
    )
    cells = np.flatnonzero(shares)
    return csr_array((shares[cells], (cells, labels[cells])), shape=(len(labels), count))


def _power_lengths(deposit: Deposit, mesh: TetMesh, surface: Surface) -> FloatArray:
    """Length of the ways of a light in each tetrahedron times their power, (m,)."""
    terms, entries = deposit.terms, deposit.footprint.entries
    starts = entries if len(entries) == len(terms.points) else surface.project(terms.points)[0]
    ways = terms.points - starts
    lengths = np.linalg.norm(ways, axis=1)
    directions = ways / np.where(lengths > 0, lengths, 1.0)[:, None]
    held = np.zeros(len(mesh.tetrahedra))
    for begins, along, reach, powers in (
        (starts, directions, lengths, terms.powers),
        (terms.segments.starts, terms.segments.directions, terms.segments.lengths, terms.segments.fluxes),
    ):
        for part in march(mesh, begins, along, reach, keep=False):
            inside = part.cells >= 0
            amount = np.abs(powers[part.paths]) * (part.leave - part.enter)
            held += np.bincount(part.cells[inside], amount[inside], minlength=len(held))
    return held
