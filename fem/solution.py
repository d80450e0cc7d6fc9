"""`Solution`: fluence, exitance, and where the power went."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from tetlux.fem.fresnel import moments
from tetlux.fem.medium import Medium
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.tetmesh import TetMesh


@dataclass(frozen=True)
class Power:
    """The ledger of a run: ``incident = specular + absorbed + exited + ballistic``, all in W.

    Attributes
    ----------
    incident : float
        Power that meets the body, or that sources inside it emit.
    specular : float
        Reflected at the surface at once.
    absorbed : float
        Turned to heat inside.
    exited : float
        Left through the surface after having been scattered: the integral of the exitance.
    ballistic : float
        Passed through without having been scattered.
    """

    incident: float
    specular: float
    absorbed: float
    exited: float
    ballistic: float

    @property
    def balance_error(self) -> float:
        """What the ledger lacks, as a share of the incident power."""
        out = self.specular + self.absorbed + self.exited + self.ballistic
        return (self.incident - out) / self.incident


@dataclass(frozen=True, eq=False)
class Solution:
    """Light in one body, solved.

    Attributes
    ----------
    mesh : TetMesh
    medium : Medium
    fluence : (n,) ndarray
        Fluence at the nodes of `mesh` (CS667 notes, definition 1.9 i), W/unit².
    power : Power
    transmitted_irradiance : float
        Diffuse light that passed to the inside, W/unit².
    error_estimate : float
        Estimated relative L2 error of the exitance; nan if there was one mesh only.
    seconds : dict
        Seconds spent on surface, mesh, assemble, solve, and total.
    warnings : list of str
    """

    mesh: TetMesh
    medium: Medium
    fluence: FloatArray
    power: Power
    transmitted_irradiance: float = 0.0
    error_estimate: float = np.nan
    seconds: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    @cached_property
    def exitance(self) -> FloatArray:
        """Exitance at the boundary nodes of `mesh`, (b,), W/unit².

        ``M = phi/(2A)``; under diffuse light ``M = E_t + E.n``, where the boundary condition makes
        ``E.n = (phi - 4 E_t/(1 - 2 C1))/(2A)``.
        """
        exitance = self.fluence[self.mesh.boundary_nodes] / (2.0 * self.medium.boundary_factor)
        if self.transmitted_irradiance:
            _, c2 = moments(self.medium.eta)
            exitance = exitance + self.transmitted_irradiance * (1.0 - 2.0 / (1.0 + 3.0 * c2))
        return exitance

    def exitance_at(self, points: FloatArray) -> FloatArray:
        """Exitance at the points of the surface nearest to given points.

        Parameters
        ----------
        points : (q, 3) array_like

        Returns
        -------
        (q,) ndarray
            W/unit².
        """
        queries = np.asarray(points, dtype=float).reshape(-1, 3)
        _, face, weights = self.mesh.closest_boundary(queries)
        return np.asarray((weights * self.exitance[self.mesh.boundary_triangles[face]]).sum(axis=1))

    def fluence_at(self, points: FloatArray) -> FloatArray:
        """Fluence at given points, linear within each tetrahedron.

        Parameters
        ----------
        points : (q, 3) array_like

        Returns
        -------
        (q,) ndarray
            W/unit²; nan outside the body.
        """
        cells, weights = self.mesh.locate(np.asarray(points, dtype=float).reshape(-1, 3))
        return np.asarray((weights * self.fluence[self.mesh.tetrahedra[cells]]).sum(axis=1))
