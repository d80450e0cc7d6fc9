"""The light of dyes as a right-hand side: in each place a share of the fluence that excites them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from tetlux.fem.dyes.direct import DirectLight
from tetlux.fem.dyes.near_sources import integrate_near_sources
from tetlux.fem.known.patch import Patch
from tetlux.fem.media.coefficients import Coefficients, at_cells
from tetlux.fem.operators.assembly import Lumping
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.quadratic.assembly import weighted_product
from tetlux.fem.quadratic.error import local_residual
from tetlux.fem.quadratic.operator import STOP_RESIDUAL_OF_DUALS
from tetlux.fem.quadratic.solution import QuadraticSolution
from tetlux.fem.quadratic.space import QuadraticSpace
from tetlux.meshing.arrays import BoolArray, FloatArray, Number, NumberArray, sum_by_index
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.topology import EDGES

# Integrals of a hat function times the bubble of an edge, over the volume: of an edge that meets the node, and of one
# that does not. Each bubble sums to 1/5 over the four hats.
OF_MEETING_EDGE, OF_OPPOSITE_EDGE = 1.0 / 15.0, 1.0 / 30.0


@dataclass(frozen=True, eq=False)
class Excitation:
    """The solution that excites dyes, as the field of their light.

    Attributes
    ----------
    whole : Solution
        Of all lights, on one mesh.
    coefficients : Coefficients
        That it was solved with, the dyes' absorption among them.
    mass : {"lumped", "consistent"}
    weights : (m,) ndarray, real or complex
        Emitted power over the fluence, in each tetrahedron, 1/unit.
    direct : tuple of DirectLight
        Each light before it is scattered.
    """

    whole: Solution
    coefficients: Coefficients
    mass: Lumping
    weights: NumberArray
    direct: tuple[DirectLight, ...]
    # By the identity of a dual of the emission: this dual, and that of the excitation.
    _duals: dict[int, tuple[NumberArray, NumberArray]] = field(default_factory=dict)

    @cached_property
    def of_lights(self) -> tuple[Solution, ...]:
        """The solution of each light."""
        return self.whole.of_lights or (self.whole,)

    @cached_property
    def glows(self) -> tuple["Glow", ...]:
        """What each light makes the dyes emit."""
        return tuple(Glow(self, light) for light in range(len(self.of_lights)))

    def local_residual(self, lights: Sequence[int], dual: NumberArray, *, keep: bool) -> NumberArray:
        """See `tetlux.fem.sources.volume.SourceField`."""
        solution = self._quadratic(tuple(lights))
        if id(dual) in self._duals:
            return local_residual(solution, self._duals[id(dual)][1], keep=True)
        load = weighted_product(solution.operator.space, self.weights, dual)
        found = solution.operator.solve(load[:, None], STOP_RESIDUAL_OF_DUALS)[:, 0]
        keep = keep and len(self._duals) < solution.operator.most_duals
        if keep:
            self._duals[id(dual)] = dual, found
        return local_residual(solution, found, keep=keep)

    def _quadratic(self, lights: tuple[int, ...]) -> QuadraticSolution:
        some = self.whole if len(lights) == len(self.of_lights) else self.of_lights[lights[0]]
        assert some.quadratic is not None
        return some.quadratic if some.quadratic.lights == lights else QuadraticSolution(some.quadratic.scene, lights)

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class Glow:
    """What the dyes emit by one light of their excitation: a `tetlux.fem.sources.volume.VolumeSource`.

    Attributes
    ----------
    field : Excitation
    light : int
    """

    field: Excitation
    light: int

    @property
    def solution(self) -> Solution:
        """That excites."""
        return self.field.of_lights[self.light]

    @property
    def _direct(self) -> DirectLight:
        return self.field.direct[self.light]

    @property
    def mesh(self) -> TetMesh:
        """The mesh of both."""
        return self.solution.mesh

    @cached_property
    def at_nodes(self) -> NumberArray:
        """The load of linear elements, (n,), W."""
        return self._load(self.field.weights)

    @cached_property
    def at_dofs(self) -> NumberArray:
        """The load of quadratic elements, (size,), W."""
        quadratic, weights = self.solution.quadratic, self.field.weights
        assert quadratic is not None
        space = quadratic.operator.space
        load = weighted_product(space, weights, quadratic.fluence) + self._direct.in_space(space, weights)
        for each in quadratic.patches:
            near = integrate_near_sources(space, each.patch)
            load = load + sum_by_index(space.cells[near.cells], weights[near.cells, None] * near.values, space.size)
        return load

    @property
    def density(self) -> FloatArray:
        """Modulus of what is emitted in each tetrahedron, (m,), W/unit³; near sources that of the nodes."""
        return np.asarray(np.abs(self.field.weights * self.solution.fluence[self.mesh.tetrahedra].mean(axis=1)))

    def integrate(self, cells: BoolArray) -> Number:
        """The integral of the exciting light over some tetrahedra of the mesh, (m,), W unit."""
        total: Number = self._load(cells.astype(np.float64)).sum().item()
        return total

    def _load(self, weights: NumberArray) -> NumberArray:
        """Integrals of the fluence times weights (m,) and each hat function, (n,).

        As in the ledger of the excitation, where the absorbed power is the integral of the fluence times sigma_a.
        """
        mesh, fluence, volumes = self.mesh, self.solution.fluence, self.mesh.volumes
        values = fluence[mesh.tetrahedra]
        lumped = self.field.mass == "lumped"
        shares = values / 4.0 if lumped else (values + values.sum(axis=1, keepdims=True)) / 20.0
        load = sum_by_index(mesh.tetrahedra, (weights * volumes)[:, None] * shares, len(mesh.points))
        load = self._within_layers(load, weights)
        for patch, missing in zip(self.solution.patches, self._missing, strict=True):
            cells = np.flatnonzero(patch.cells)
            load = load + sum_by_index(mesh.tetrahedra[cells], weights[cells, None] * missing, len(mesh.points))
        return np.asarray(load + self._direct.at_nodes(weights))

    def _within_layers(self, load: NumberArray, weights: NumberArray) -> NumberArray:
        """The load where light fades in layers thinner than tetrahedra, see `tetlux.fem.operators.fitting`.

        Nodes there stand for less of the fluence. Where the excitation is emitted itself, what is absorbed at once
        makes dyes glow too.
        """
        fitting, quadratic = self.solution.fitting, self.solution.quadratic
        if fitting is None:
            return load
        assert quadratic is not None
        emission = quadratic.scene.deposits[self.light].terms.emission
        every = np.arange(len(self.mesh.tetrahedra))
        at_once = weights * self.mesh.volumes * emission / at_cells(self.field.coefficients.sigma_a, every)
        corners = np.repeat(0.25 * at_once[:, None], 4, axis=1)
        absorbed = sum_by_index(self.mesh.tetrahedra, corners, len(self.mesh.points))
        return fitting.absorption_scale * load + (1.0 - fitting.absorption_scale) * absorbed

    @cached_property
    def _missing(self) -> tuple[NumberArray, ...]:
        """Of each patch, integrals of ``G - I G`` times hat functions over its tetrahedra, (c, 4)."""
        parts = zip(self.solution.patches, self.solution.known_absorption, strict=True)
        return tuple(_integrate_charges(patch, absorbed) for patch, absorbed in parts)

    __repr__ = one_line


def _integrate_charges(patch: Patch, absorbed: complex) -> NumberArray:
    """Integrals of ``G - I G`` times hat functions over the tetrahedra of a patch, (c, 4), I by linear elements.

    They are made to sum to what the ledger says that the patch absorbs beyond ``I G``, by Gauss's theorem on its faces.
    """
    mesh, charges = patch.mesh, patch.charges
    cells = np.flatnonzero(patch.cells)
    if len(cells) == 0:
        return np.zeros((0, 4))
    ends, inverse = np.unique(mesh.tetrahedron_edges[cells], return_inverse=True)
    edges, at_nodes = mesh.edges[ends], patch.at_nodes
    bubbles = charges.fluence(mesh.points[edges].mean(axis=1)) - at_nodes[edges].mean(axis=1)
    shares = np.full((6, 4), OF_OPPOSITE_EDGE)
    shares[np.arange(6)[:, None], EDGES] = OF_MEETING_EDGE
    missing = mesh.volumes[cells, None] * (bubbles[inverse.reshape(-1, 6)] @ shares)
    near = integrate_near_sources(QuadraticSpace(mesh, np.zeros((len(mesh.edges), 3))), patch)
    missing[np.searchsorted(cells, near.cells)] += near.values[:, :4]
    bright = 0.25 * mesh.volumes[cells, None] * np.abs(at_nodes[mesh.tetrahedra[cells]])
    return np.asarray(missing + (absorbed / charges.medium.sigma_a - missing.sum()) * bright / bright.sum())
