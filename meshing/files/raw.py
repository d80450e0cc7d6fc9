"""Contents of a volume mesh file before checks: nodes, cells by kind, and cell values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import InputError

# Substrings of meshio's names of solid cells, and the names in messages.
TETRAHEDRON = "tetra"
STRAIGHTENED = "{:,} tetrahedra of higher order were taken by their corners, with straight edges."
SOLIDS = {"hexahedron": "hexahedra", "wedge": "wedges", "pyramid": "pyramids", "polyhedron": "polyhedra"}


@dataclass(frozen=True, eq=False)
class RawMesh:
    """Nodes and cells of a file.

    Attributes
    ----------
    points : (n, 3) ndarray
    blocks : sequence of (str, ndarray)
        Cells of one kind by meshio's name for it, and their node numbers from 0, the corners first.
    arrays : mapping of str to sequence of ndarray
        Values of the cells of each block, by name.
    names : mapping of str to mapping of int to str
        Names of the values of an array, by the array's name.
    notes : tuple of str
        Notes on decisions of the reader.
    sets : mapping of str to object
        Named sets of cells in meshio's form: cell numbers in each block.
    """

    points: FloatArray
    blocks: Sequence[tuple[str, IntArray]]
    arrays: Mapping[str, Sequence[npt.NDArray[np.generic]]] = field(default_factory=dict)
    names: Mapping[str, Mapping[int, str]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    sets: Mapping[str, object] = field(default_factory=dict)

    @property
    def tetrahedra(self) -> list[int]:
        """The blocks of linear or curved tetrahedra."""
        return [i for i, (kind, cells) in enumerate(self.blocks) if TETRAHEDRON in kind.lower() and len(cells)]

    def corners(self) -> tuple[IntArray, tuple[str, ...]]:
        """Corners of all tetrahedra, (m, 4), and a note on curved ones.

        Raises
        ------
        InputError
            If there are other solid cells, or no tetrahedra.
        """
        found: dict[str, int] = {}
        for kind, cells in self.blocks:
            for part, name in SOLIDS.items():
                if part in kind.lower() and len(cells):
                    found[name] = found.get(name, 0) + len(cells)
        if found:
            counts = " and ".join(f"{count:,} {name}" for name, count in found.items())
            raise InputError(f"it holds {counts}, and only tetrahedra are solved on; mesh the body with tetrahedra.")
        chosen = self.tetrahedra
        if not chosen:
            raise InputError("it holds no tetrahedra; give a tetrahedral mesh.")
        curved = sum(len(self.blocks[i][1]) for i in chosen if self.blocks[i][1].shape[1] > 4)
        return np.vstack([self.blocks[i][1][:, :4] for i in chosen]), (STRAIGHTENED.format(curved),) if curved else ()

    def values(self, name: str) -> npt.NDArray[np.generic]:
        """Values of the tetrahedra by the name of an array, (m, ...)."""
        return np.concatenate([self.arrays[name][i] for i in self.tetrahedra])
