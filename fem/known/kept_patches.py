"""Patches that are kept with a mesh, so that readings on it depend smoothly on the coefficients.

Which tetrahedra charges are subtracted on follows from a comparison with the fluence: chosen anew for each set of
coefficients, a reading would jump by the error of interpolation along the border of the patch. So a light that was
solved for on a mesh before has the patch that it had then, unless its medium is another one by now.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal
from weakref import WeakKeyDictionary

from tetlux.fem.known.charges import Charges
from tetlux.fem.known.patch import Patch, is_sound
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import BoolArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.mesh import TetMesh

# A patch serves for media whose mean free path and decay length differ from those it was chosen for by this factor.
OTHER_MEDIUM = 1.5

# Linear and quadratic elements subtract the same charges on different patches.
Elements = Literal["linear", "quadratic"]


@dataclass(frozen=True, eq=False)
class _Choice:
    medium: Medium
    cells: BoolArray

    def serves(self, medium: Medium) -> bool:
        """Whether a medium is about that which the patch was chosen for."""
        ratios = (
            medium.mean_free_path / self.medium.mean_free_path,
            (medium.sigma_tr or 1.0) / (self.medium.sigma_tr or 1.0),
        )
        return all(1.0 / OTHER_MEDIUM <= ratio <= OTHER_MEDIUM for ratio in ratios)

    __repr__ = one_line


_Key = tuple[Elements, str, int]
_OF_MESHES: WeakKeyDictionary[TetMesh, dict[_Key, _Choice]] = WeakKeyDictionary()


def kept_patch(mesh: TetMesh, charges: Charges, at_nodes: NumberArray, elements: Elements) -> Patch | None:
    """The patch that charges had on a mesh, None if there was none or it does not hold them now."""
    choice = _OF_MESHES.get(mesh, {}).get(_key(charges, elements))
    if choice is None or not choice.serves(charges.medium):
        return None
    patch = Patch(mesh, charges, choice.cells, at_nodes)
    return patch if is_sound(patch) else None


def keep_patch(patch: Patch, elements: Elements) -> None:
    """Keep a patch with its mesh, for charges that have a name and a medium that does not vary."""
    charges = patch.charges
    if charges.name and charges.varying is None:
        choices = _OF_MESHES.setdefault(patch.mesh, {})
        known = choices.get(_key(charges, elements))
        if known is None or not known.serves(charges.medium):
            choices[_key(charges, elements)] = _Choice(charges.medium, patch.cells)


def keep_or_choose(
    mesh: TetMesh, charges: Charges, at_nodes: NumberArray, elements: Elements, choose: Callable[[], Patch]
) -> Patch:
    """The patch that charges had on a mesh, or one that is chosen now and kept."""
    found = kept_patch(mesh, charges, at_nodes, elements)
    if found is None:
        found = choose()
        keep_patch(found, elements)
    return found


def forget_patches(mesh: TetMesh) -> None:
    """Forget the patches that are kept with a mesh."""
    _OF_MESHES.pop(mesh, None)


def _key(charges: Charges, elements: Elements) -> _Key:
    return elements, charges.name, len(charges.positions)
