"""`TruncatedSolution`: light in the part of a body that it reaches."""

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from tetlux.fem.outcome.solution import Solution
from tetlux.fem.truncated.part import Part
from tetlux.meshing.arrays import BoolArray, FloatArray, NumberArray
from tetlux.meshing.surface.surface import Surface

# The field beyond the part continues that at the surface of the part between this share of the distance of the cut and
# the cut; nearer to the cut than the rest of it, what is solved for is that of the cut.
RIM = 0.85


@dataclass(frozen=True, eq=False)
class TruncatedSolution(Solution):
    """A solution on the part of a body that light reaches; `mesh` is that of the part.

    Beyond the part the exitance is that of a field that decays from its rim, and the fluence is nan.

    Attributes
    ----------
    part : Part
        The part that was cut out.
    cut_error : float
        Estimated relative L2 error of the exitance by the cut, which is part of `error_estimate`.
    """

    part: Part | None = None
    cut_error: float = np.nan

    model = "truncated"

    @property
    def meshed_surface(self) -> Surface:
        """The surface of the part, which the mesh approximates."""
        assert self.part is not None
        return self.part.surface

    def is_modelled_at(self, points: FloatArray) -> BoolArray:
        """Whether points (q, 3) belong to the part that was solved for, (q,)."""
        assert self.part is not None
        places = np.asarray(points, dtype=float).reshape(-1, 3)
        return ~self.part.is_cut(places, 1.0 - RIM)

    def exitance_on(self, queries: FloatArray) -> NumberArray:
        """Exitance at points (q, 3) that lie on the surface, (q,), W/unit²; beyond the part a decaying field."""
        inside = self.is_modelled_at(queries)
        found = np.empty(len(queries))
        found[inside] = super().exitance_on(queries[inside])
        beyond = np.flatnonzero(~inside)
        if len(beyond):
            level, distance, decay = self._rim
            away = np.linalg.norm(queries[beyond] - self._center, axis=1)
            found[beyond] = level * np.exp(-decay * np.maximum(away - distance, 0.0))
        return found

    def fluence_at(self, points: FloatArray) -> NumberArray:
        """Fluence at points (q, 3), (q,), W/unit²; nan outside the part."""
        queries = np.asarray(points, dtype=float).reshape(-1, 3)
        assert self.part is not None
        found = np.full(len(queries), np.nan, self.fluence.dtype)
        inside = np.isfinite(queries).all(axis=1) & ~self.part.is_cut(queries)
        found[inside] = super().fluence_at(queries[inside])
        return found

    @property
    def _center(self) -> FloatArray:
        assert self.part is not None
        return np.asarray(0.5 * (self.part.box.low + self.part.box.high))

    @cached_property
    def _rim(self) -> tuple[float, float, float]:
        """Mean exitance near the rim of the part, the mean distance from the middle there, and the rate of decay."""
        assert self.part is not None
        nodes = self.mesh.points[self.mesh.boundary_nodes]
        rim = ~self.part.is_cut(nodes) & self.part.is_cut(nodes, 1.0 - RIM)
        if not rim.any():
            return 0.0, 0.0, 0.0
        level = max(float(self.exitance[rim].mean()), 0.0)
        distance = float(np.linalg.norm(nodes[rim] - self._center, axis=1).mean())
        return level, distance, self.medium.sigma_tr


def truncate(solution: Solution, whole: Surface, part: Part, cut_error: float) -> TruncatedSolution:
    """The solution on a part as one of the whole body."""
    values: dict[str, Any] = {each.name: getattr(solution, each.name) for each in fields(Solution)}
    values["surface"] = whole
    values["error_estimate"] = solution.error_estimate + cut_error
    values["of_lights"] = tuple(truncate(each, whole, part, 0.0) for each in solution.of_lights)
    return TruncatedSolution(**values, part=part, cut_error=cut_error)


def estimate_cut_error(solution: Solution, part: Part) -> float:
    """Estimated relative L2 error of the exitance by the cut.

    The light of the whole body violates the boundary condition of the cut by ``M (1 - zb k)``, where M is ``phi/(2A)``
    without the cut, and ``k`` the rate at which light decays there. By the maximum principle the exitance is off by no
    more than the largest violation. The cut lowers M by ``2 zb k/(1 + zb k)``, as a plane wave at a wall.
    """
    mesh, medium = solution.mesh, solution.medium
    nodes = mesh.boundary_nodes
    cut = part.is_cut(mesh.points[nodes])
    if not cut.any():
        return 0.0
    rate = (medium.sigma_tr + 2.0 / part.distance) * medium.extrapolation_length
    wall = float(np.abs(solution.boundary_condition.exitance(solution.fluence[nodes[cut]], 0.0)).max())
    violation = wall * (1.0 + rate) / (2.0 * rate) * abs(1.0 - rate)
    squares = mesh.boundary_areas @ (solution.fluence[mesh.boundary_faces].mean(axis=1) ** 2)
    norm = float(np.sqrt(squares)) * 0.5 / medium.boundary_factor
    return violation * float(np.sqrt(part.surface.area)) / norm
