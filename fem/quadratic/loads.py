"""The right-hand side of lights for quadratic elements: see `tetlux.fem.operators.loads`."""

from dataclasses import dataclass

import numpy as np

from tetlux.fem.ballistic.extinction import cells_of, optical_depths
from tetlux.fem.media.coefficients import Coefficients, at_cells
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.quadratic.assembly import surface_load, volume_load
from tetlux.fem.quadratic.elements import TRIANGLE_EDGES, shape_derivatives, shape_functions
from tetlux.fem.quadratic.space import QuadraticSpace
from tetlux.fem.sources.segments import Segments
from tetlux.fem.sources.terms import SourceTerms
from tetlux.meshing.arrays import FloatArray, NumberArray, sum_by_index
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.march import march

# Gauss rule along a beam in each tetrahedron.
BEAM_RULE = np.polynomial.legendre.leggauss(4)


@dataclass(frozen=True, eq=False)
class LineLoad:
    """Load of attenuated beams.

    Attributes
    ----------
    load : (size,) ndarray
        W.
    points, powers : (p, 3), (p,) ndarray
        What stands for their parts outside the mesh, unit and W.
    """

    load: FloatArray
    points: FloatArray
    powers: FloatArray

    __repr__ = one_line


def quadratic_load(
    space: QuadraticSpace, coefficients: Coefficients, terms: SourceTerms, lines: LineLoad
) -> NumberArray:
    """Load of source terms, as they are on the mesh of a space, and of their beams, (size,)."""
    mesh, load = space.mesh, lines.load.copy()
    points, powers = np.vstack([terms.points, lines.points]), np.concatenate([terms.powers, lines.powers])
    if len(points):
        load += point_load(space, points, powers)
    if np.any(terms.transmitted_irradiance):
        entering = np.zeros(len(mesh.points))
        entering[mesh.boundary_nodes] = boundary_condition_of(coefficients.outer).inflow(terms.transmitted_irradiance)
        load += surface_load(space, entering)
    if np.any(terms.emission):
        emitted = volume_load(space, np.broadcast_to(terms.emission, len(mesh.tetrahedra)))
        # The power of emission is that of the mesh with flat facets.
        load += emitted * float((mesh.volumes * terms.emission).sum()) / emitted[: len(mesh.points)].sum()
    return np.asarray(load + sum(source.at_dofs for source in terms.volume_sources))


def point_load(space: QuadraticSpace, points: FloatArray, powers: FloatArray) -> FloatArray:
    """Load of points: in the tetrahedron that holds a point, or else on the nearest boundary triangle, (size,)."""
    mesh, load = space.mesh, np.zeros(space.size)
    cells, weights = mesh.locate(points)
    inside, outside = cells >= 0, np.flatnonzero(cells < 0)
    values = powers[inside, None] * shape_functions(weights[inside])
    load += sum_by_index(space.cells[cells[inside]], values, space.size)
    if len(outside):
        face, weights = space.on_boundary(points[outside])
        values = powers[outside, None] * shape_functions(weights, TRIANGLE_EDGES)
        load += sum_by_index(space.faces(mesh.boundary_faces[face]), values, space.size)
    return load


def line_load(space: QuadraticSpace, coefficients: Coefficients, segments: Segments) -> LineLoad:
    """Integrate attenuated beams by Gauss points in every tetrahedron."""
    mesh, load = space.mesh, np.zeros(space.size)
    points, powers = [np.zeros((0, 3))], [np.zeros(0)]
    for part in march(mesh, segments.starts, segments.directions, segments.lengths, segments.cells):
        cells = cells_of(mesh, coefficients, part, segments.starts, segments.directions)
        extinction = at_cells(coefficients.extinction, cells)
        scattering = at_cells(coefficients.delta_eddington_scattering, cells)
        forward = at_cells(coefficients.delta_eddington_cosine / coefficients.sigma_t_prime, cells)
        arriving = segments.fluxes[part.paths] * np.exp(-optical_depths(part, coefficients.extinction, cells))
        step, outside = part.leave - part.enter, part.cells < 0
        lost = np.zeros(len(step))
        for node, weight in zip(0.5 * (1.0 + BEAM_RULE[0]), 0.5 * BEAM_RULE[1], strict=True):
            at = node * step
            scattered = arriving * scattering * weight * step * np.exp(-extinction * at)
            lost += scattered
            barycentric = (part.weights + at[:, None] * part.slopes)[~outside]
            shape_values = shape_functions(barycentric)
            along = np.einsum("qap,qp->qa", shape_derivatives(barycentric), part.slopes[~outside])
            values = scattered[~outside, None] * (shape_values + forward[~outside, None] * along)
            load += sum_by_index(space.cells[part.cells[~outside]], values, space.size)
        paths, middle = part.paths[outside], 0.5 * (part.enter + part.leave)[outside]
        points.append(segments.starts[paths] + middle[:, None] * segments.directions[paths])
        powers.append(lost[outside])
    return LineLoad(load, np.concatenate(points), np.concatenate(powers))
