"""`SharedMesh`: a mesh that many solves of one body start from, with all that they share on it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

from tetlux.fem.known.kept_fits import KeptFits
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.operators.assembly import Assembly, Lumping
from tetlux.fem.system import System
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.mesh import TetMesh

# Systems that are kept on a mesh: that of the run before, and those of its other channels.
MOST_SYSTEMS = 4
# Lights that each system is prepared for.
EXPECTED_LIGHTS = 4

SystemKey = tuple[tuple[AnyMedium, ...], Lumping, bool, complex]


@dataclass(eq=False)
class SharedMesh:
    """A mesh that solves of one body start from, one after the other.

    A run whose estimated error is within its tolerance on this mesh is done; others refine it for themselves. What a
    solve finds depends on this mesh and, by the places of fitted charges, on the solves before.

    Attributes
    ----------
    mesh : TetMesh
    kept : KeptFits
        Places of charges, chosen once for each light.
    """

    mesh: TetMesh
    kept: KeptFits = field(default_factory=KeptFits)
    _systems: dict[SystemKey, System] = field(default_factory=dict)

    @cached_property
    def assembly(self) -> Assembly:
        """What does not depend on the media."""
        return Assembly(self.mesh)

    def system(self, key: SystemKey, assemble: Callable[[], System]) -> System:
        """The system of some media, assembled unless one of the last solves had the same."""
        found = self._systems.pop(key, None) or assemble()
        self._systems[key] = found
        while len(self._systems) > MOST_SYSTEMS:
            del self._systems[next(iter(self._systems))]
        return found

    __repr__ = one_line
