"""The error of the exitance at almost every point of the surface, and of the fluence at almost every point inside.

Nodes are sorted into bands, each of one region and one range of brightness. In a band let w_i be the share of its area
or volume that node i stands for, and e_i the error of phi_i there. One dual solution suffices for the mean square of
all relative errors. With random signs s_i its load is::

    J(phi) = sum_i s_i sqrt(w_i) phi_i / |phi_i|

The square of the error of J, ``sum_i s_i sqrt(w_i) e_i/|phi_i|``, is ``sum_i w_i (e_i/phi_i)²`` on average over signs
(Hutchinson 1990). So `PROBES` of these estimate it, by the contributions of tetrahedra of `tetlux.fem.quadratic.error`.

A node darker than a millionth of the brightest counts as if it were that bright.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tetlux.fem.quadratic.error import weigh_residual
from tetlux.fem.quadratic.gaps import gaps_of
from tetlux.fem.quadratic.reading_error import ReadingError
from tetlux.fem.quadratic.solution import QuadraticSolution, Where
from tetlux.meshing.arrays import FloatArray, IntArray, sum_by_index
from tetlux.meshing.describe import one_line
from tetlux.meshing.host.blocks import map_in_threads
from tetlux.meshing.tets.mesh import TetMesh

# Errors are relative to the fluence, and to this share of the largest where there is less.
DARKEST = 1e-6
# Decades of brightness in a band of the surface, and in one of the volume, which has bands in each region.
DECADES_ON_SURFACE, DECADES_INSIDE = 1.0, 2.0
# Dual solutions for each band: two give its error to within a factor of 1.5.
PROBES = 2
# Relative residual of these: errors of bands differ by 1 % of themselves from those at 1e-7.
STOP_RESIDUAL_OF_PROBES = 1e-3
# Root mean squares within which some 95 % of points lie.
ALMOST_ALL = 2.0


@dataclass(frozen=True, eq=False)
class Band:
    """Nodes of about the same brightness.

    Attributes
    ----------
    nodes : (k,) ndarray
        Their numbers.
    shares : (k,) ndarray
        The share of the band's area or volume that each stands for.
    """

    nodes: IntArray
    shares: FloatArray

    __repr__ = one_line


def field_errors(solution: QuadraticSolution, where: Where) -> list[ReadingError]:
    """Relative errors that some 95 % of the points of each band are within, computed once for a solution.

    Where distributed light decays within a tetrahedron, these are the errors of linear elements, which are used there:
    their difference from quadratic ones.

    Parameters
    ----------
    solution : QuadraticSolution
    where : {"surface", "inside"}
        Of the exitance at the surface, or of the fluence in all regions.

    Returns
    -------
    list of ReadingError
        Their value is 1; empty if there is no light at all.
    """
    if where not in solution.bands:
        solution.bands[where] = _errors_on_surface(solution) if where == "surface" else _errors_inside(solution)
    return solution.bands[where]


def _errors_on_surface(solution: QuadraticSolution) -> list[ReadingError]:
    mesh = solution.operator.mesh
    nodes, exitance = mesh.boundary_nodes, np.abs(solution.exitance_at_nodes)
    bands = _bands(nodes, mesh.boundary_node_areas, exitance, DECADES_ON_SURFACE)
    scales = np.ones(len(mesh.points))
    scales[nodes] = np.maximum(exitance, DARKEST * exitance.max()) / solution.operator.robin
    return _errors(solution, list(bands), scales)


def _errors_inside(solution: QuadraticSolution) -> list[ReadingError]:
    mesh = solution.operator.mesh
    fluence = np.abs(solution.fluence[: len(mesh.points)])
    fluence = np.maximum(fluence, DARKEST * fluence.max())
    bands: list[Band] = []
    for region in np.unique(mesh.regions):
        own = mesh.regions == region
        corners = np.repeat(0.25 * mesh.volumes[own, None], 4, axis=1)
        volumes = sum_by_index(mesh.tetrahedra[own], corners, len(mesh.points))
        nodes = np.flatnonzero(volumes)
        bands += _bands(nodes, volumes[nodes], fluence[nodes], DECADES_INSIDE)
    return _errors(solution, bands, fluence)


def _bands(nodes: IntArray, sizes: FloatArray, brightness: FloatArray, decades: float) -> Iterator[Band]:
    """Sort nodes (k,), which stand for areas or volumes (k,), into bands by their brightness (k,)."""
    largest = brightness.max()
    if largest == 0.0:
        return
    band = np.floor(-np.log10(np.maximum(brightness / largest, DARKEST)) / decades).astype(np.int64)
    for number in np.unique(band):
        own = band == number
        yield Band(nodes[own], sizes[own] / sizes[own].sum())


def _errors(solution: QuadraticSolution, bands: list[Band], scales: FloatArray) -> list[ReadingError]:
    """Errors of bands, relative to the fluence `scales` (n,) at nodes."""
    if not bands:
        return []
    if solution.thin_layers.any():
        off = np.abs(solution.linear_fluence - solution.fluence[: len(scales)]) / scales
        return [_difference(solution.operator.mesh, band, off) for band in bands]
    # The same signs each time, so that a solution has one error.
    rng = np.random.default_rng(0)
    loads = np.zeros((solution.operator.space.size, PROBES * len(bands)))
    for column in range(loads.shape[1]):
        band = bands[column // PROBES]
        signs = rng.choice([-1.0, 1.0], len(band.nodes))
        # The basis function of a node is 1 there, and those of edges are 0 at nodes.
        loads[band.nodes, column] = ALMOST_ALL * signs * np.sqrt(band.shares) / scales[band.nodes]
    duals = solution.operator.solve(loads, STOP_RESIDUAL_OF_PROBES)
    # What threads share is computed before.
    _ = solution.gradient_difference, solution.broad_beams, solution.inflow, gaps_of(solution.operator)
    found = map_in_threads(lambda dual: weigh_residual(solution, dual, 1.0), list(duals.T))
    return [_mean_square(found[start : start + PROBES]) for start in range(0, len(found), PROBES)]


def _mean_square(probes: list[ReadingError]) -> ReadingError:
    """The root mean square of errors with different signs."""
    return ReadingError(
        1.0,
        np.mean([probe.squares for probe in probes], axis=0),
        float(np.sqrt(np.mean([abs(probe.sum) ** 2 for probe in probes]))),
        float(np.sqrt(np.mean([probe.rays**2 for probe in probes]))),
        float(np.sqrt(np.mean([abs(probe.gaps) ** 2 for probe in probes]))),
    )


def _difference(mesh: TetMesh, band: Band, off: FloatArray) -> ReadingError:
    """The error of a band by relative errors at nodes (n,), shared out to the tetrahedra around them."""
    squares = np.zeros(len(mesh.points))
    squares[band.nodes] = (ALMOST_ALL * off[band.nodes]) ** 2 * band.shares / (4.0 * mesh.node_volumes[band.nodes])
    return ReadingError(1.0, squares[mesh.tetrahedra].sum(axis=1) * mesh.volumes, 0.0, 0.0)
