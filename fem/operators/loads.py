"""The right-hand side: loads of source terms on the nodes, ``∫ Q0 v + (1/sigma_t') ∫ Q1 . grad v``.

Diffuse light adds ``∮ 2 E_t v / (1 + 3 C2)``, with E_t the irradiance that passes to the inside; emission adds
``∫ Q0 v`` by the corners.
"""

from dataclasses import dataclass, replace

import numpy as np

from tetlux.fem.ballistic.extinction import cells_of, optical_depths
from tetlux.fem.media.coefficients import Coefficients, at_cells
from tetlux.fem.models.boundary import BoundaryCondition, boundary_condition_of
from tetlux.fem.operators.operator import Operator
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.ledger import Ledger
from tetlux.fem.sources.segments import Segments
from tetlux.fem.sources.terms import SourceTerms
from tetlux.meshing.arrays import FloatArray, IntArray, NumberArray, sum_by_index
from tetlux.meshing.describe import one_line
from tetlux.meshing.search.cell_tree import PathSegments
from tetlux.meshing.tets.layers import are_layered
from tetlux.meshing.tets.march import march
from tetlux.meshing.tets.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class Load:
    """What one light puts on the nodes of a mesh.

    Attributes
    ----------
    deposit : Deposit
        What the light leaves on this mesh.
    operator : Operator
        The operator that is solved with.
    at_nodes : (n,) ndarray
        The right-hand side, W; complex where modulated light excites dyes.
    """

    deposit: Deposit
    operator: Operator
    at_nodes: NumberArray

    @property
    def has_first_moment(self) -> bool:
        """Whether it has a Q1, beside which the diffusion equation itself may have a fluence below zero."""
        cosine = self.operator.coefficients.delta_eddington_cosine
        return len(self.deposit.terms.segments) > 0 and bool(np.any(cosine != 0))

    __repr__ = one_line


def load_of(deposit: Deposit, operator: Operator) -> Load:
    """The load of a deposit, as it is on the mesh of an operator.

    A fitted operator absorbs only in the layer: the rest of what is emitted is absorbed where it is emitted.
    """
    mesh = operator.mesh
    at_nodes = load_vector(mesh, operator.coefficients, deposit.terms, operator.model.boundary_condition)
    if operator.fitting is not None and np.any(deposit.terms.emission):
        emitted = mesh.to_nodes(deposit.terms.emission * mesh.volumes)
        withheld = (1.0 - operator.fitting.absorption_scale) * emitted
        at_nodes -= withheld
        ledger = Ledger.merge([deposit.ledger, Ledger(absorbed=float(withheld.sum()))])
        deposit = replace(deposit, ledger=ledger)
    return Load(deposit, operator, at_nodes)


def load_vector(
    mesh: TetMesh, coefficients: Coefficients, terms: SourceTerms, boundary: BoundaryCondition | None = None
) -> NumberArray:
    """Load of source terms on the nodes of a mesh.

    Parameters
    ----------
    mesh : TetMesh
    coefficients : Coefficients
    terms : SourceTerms
        On this mesh, see `Deposit.evaluate_on`.
    boundary : BoundaryCondition, optional
        Of the model; if not given, that of diffusion.

    Returns
    -------
    (n,) ndarray
        Sums to the scattered power that its points and segments hold and its volume emits, W, to rounding.
    """
    load = np.zeros(len(mesh.points))
    if len(terms.points) or len(terms.segments):
        line, points, powers = _line_load(mesh, coefficients, terms.segments)
        load += line
        # Points go with what is left of the lines.
        points, powers = np.vstack([terms.points, points]), np.concatenate([terms.powers, powers])
        cells = np.full(len(points), -1)
        if terms.point_cells is not None:
            cells[: len(terms.point_cells)] = terms.point_cells
        load += _point_load(mesh, points, powers, cells)
    if np.any(terms.transmitted_irradiance):
        inflow = (boundary or boundary_condition_of(coefficients.outer)).inflow(terms.transmitted_irradiance)
        load[mesh.boundary_nodes] += mesh.boundary_node_areas * inflow
    if np.any(terms.emission):
        load += mesh.to_nodes(terms.emission * mesh.volumes)
    return np.asarray(load + sum(source.at_nodes for source in terms.volume_sources))


def _point_load(mesh: TetMesh, points: FloatArray, powers: FloatArray, point_cells: IntArray) -> FloatArray:
    """Points by their barycentric coordinates, in tetrahedra that are known or have to be found."""
    if len(points) == 0:
        return np.zeros(len(mesh.points))
    known, lost = np.flatnonzero(point_cells >= 0), np.flatnonzero(point_cells < 0)
    cells, weights = point_cells.copy(), np.empty((len(points), 4))
    weights[known] = mesh.barycentric(points[known], point_cells[known])
    if len(lost):
        cells[lost], weights[lost] = mesh.locate(points[lost])
    inside = cells >= 0
    load = sum_by_index(mesh.tetrahedra[cells[inside]], powers[inside, None] * weights[inside], len(mesh.points))
    if not inside.all():
        # Between the surface and the mesh's facets, a hair outside the mesh.
        _, faces, corner = mesh.closest_boundary(points[~inside])
        load += sum_by_index(mesh.boundary_faces[faces], powers[~inside, None] * corner, len(mesh.points))
    return load


def _line_load(
    mesh: TetMesh, coefficients: Coefficients, segments: Segments
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fading beams, integrated in closed form over every tetrahedron that they pass.

    Between the surface and the mesh's facets they may lie outside the mesh: of each such stretch the middle and its
    power are returned besides the load, as points.
    """
    load = np.zeros(len(mesh.points))
    points, powers = [np.zeros((0, 3))], [np.zeros(0)]
    for part in march(mesh, segments.starts, segments.directions, segments.lengths, segments.cells):
        cells = cells_of(mesh, coefficients, part, segments.starts, segments.directions)
        extinction = at_cells(coefficients.extinction, cells)
        step = part.leave - part.enter
        phi1, phi2, phi3 = _phi(extinction * step)
        carried = segments.fluxes[part.paths] * at_cells(coefficients.delta_eddington_scattering, cells) * step
        carried *= np.exp(-optical_depths(part, coefficients.extinction, cells))
        mean = carried * phi1
        forward = coefficients.delta_eddington_cosine / coefficients.sigma_t_prime
        # The factor of the derivatives along the path: the remainder of Q0, and Q1.
        along = carried * step * phi2 + mean * at_cells(forward, cells)
        # Both are 0 outside, whatever the nodes there.
        for corner, weights, slopes in zip(mesh.tetrahedra[part.cells].T, part.weights.T, part.slopes.T, strict=True):
            load += np.bincount(corner, mean * weights + along * slopes, len(load))
        if mesh.columns is not None:
            twice = carried * step * (step * phi3 + 2.0 * at_cells(forward, cells) * phi2)
            load += _rest_of_prisms(mesh, part, mean, along, twice)
        outside = np.flatnonzero(part.cells < 0)
        paths, middle = part.paths[outside], 0.5 * (part.enter + part.leave)[outside]
        points.append(segments.starts[paths] + middle[:, None] * segments.directions[paths])
        powers.append(mean[outside])
    return load, np.concatenate(points), np.concatenate(powers)


def _rest_of_prisms(
    mesh: TetMesh, part: PathSegments, mean: FloatArray, along: FloatArray, twice: FloatArray
) -> FloatArray:
    """What nodes of prisms get less what they get as corners of tetrahedra, (n,).

    In a prism a hat function is the product of one along its triangle and one along its height. A prism is divided into
    tetrahedra in one of several ways, by which nodes next to each other would have their light at different depths, and
    the exitance would differ from node to node; with these products it does not, however high the prism is.

    Parameters
    ----------
    mesh : TetMesh
    part : PathSegments
    mean, along, twice : (s,) ndarray
        Factors of a function's value at the start of a segment, of its first derivative along it, and of half of its
        second.
    """
    assert mesh.columns is not None
    some = np.flatnonzero(are_layered(mesh, part.cells) & (part.cells >= 0))
    cells, weights, slopes = part.cells[some], part.weights[some], part.slopes[some]
    nodes, ends = mesh.tetrahedra[cells], mesh.columns[cells]
    # The height in the prism, from 0 to 1, is linear in a tetrahedron as all of its weights are.
    is_low = nodes == ends[:, :, 1]
    height, rise = (np.where(is_low, each, 0.0).sum(axis=1)[:, None] for each in (weights, slopes))
    lower = mean[some, None] * weights * height
    lower += along[some, None] * (weights * rise + slopes * height) + twice[some, None] * slopes * rise
    linear = mean[some, None] * weights + along[some, None] * slopes
    rest = np.stack([np.where(is_low, linear, 0.0) - lower, lower - np.where(is_low, linear, 0.0)], axis=2)
    return sum_by_index(ends, rest, len(mesh.points))


def _phi(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """``∫0..1 u^k exp(-x u) du`` for k of 0, 1 and 2."""
    small = np.flatnonzero(x < 1e-2)
    with np.errstate(divide="ignore", invalid="ignore"):
        less = np.expm1(-x)
        first = -less / x
        second = (first - 1.0 - less) / x
        third = (2.0 * second - 1.0 - less) / x
    x = x[small]
    first[small] = 1 - x / 2 + x**2 / 6 - x**3 / 24 + x**4 / 120 - x**5 / 720
    second[small] = 1 / 2 - x / 3 + x**2 / 8 - x**3 / 30 + x**4 / 144 - x**5 / 840
    third[small] = 1 / 3 - x / 4 + x**2 / 10 - x**3 / 36 + x**4 / 168 - x**5 / 960
    return first, second, third
