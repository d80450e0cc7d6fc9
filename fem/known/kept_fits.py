"""Fits of charges that are kept with a mesh, so that readings on it depend smoothly on the coefficients.

Where charges go follows from a light's depth and from random draws: chosen anew for each set of coefficients, a reading
would jump by the error of the fit. So charges of a light on a mesh that was solved on before are placed as they were
then, and a light that was not fitted then is not fitted now.
"""

from dataclasses import dataclass, field
from weakref import WeakKeyDictionary

from tetlux.fem.known.fitted import FittedLight
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.mesh import TetMesh

# A fit serves for a light that is up to this factor deeper or shallower than the one it was made for.
OTHER_DEPTH = 1.5


@dataclass(frozen=True, eq=False)
class KeptFits:
    """Fits by light.

    Attributes
    ----------
    choices : dict
        By the light's name: the depths that it was solved for, unit, and the fit, None if it was not fitted.
    """

    choices: dict[str, list[tuple[float, FittedLight | None]]] = field(default_factory=dict)

    def find(self, light: str, depth: float) -> tuple[bool, FittedLight | None]:
        """Whether there was a choice for a light at about this depth, and the fit."""
        for known, fit in self.choices.get(light, []):
            if known <= OTHER_DEPTH * depth and depth <= OTHER_DEPTH * known:
                return True, fit
        return False, None

    def keep(self, light: str, depth: float, fit: FittedLight | None) -> None:
        """Remember a choice."""
        self.choices.setdefault(light, []).append((depth, fit))

    def copy(self) -> "KeptFits":
        """The same choices, to which others can be added."""
        return KeptFits({light: list(choices) for light, choices in self.choices.items()})

    __repr__ = one_line


_OF_MESHES: WeakKeyDictionary[TetMesh, KeptFits] = WeakKeyDictionary()


def fits_of(mesh: TetMesh) -> KeptFits:
    """The fits that are kept with a mesh; none at first."""
    return _OF_MESHES.setdefault(mesh, KeptFits())


def keep_fits(mesh: TetMesh, kept: KeptFits) -> None:
    """Keep fits with a mesh."""
    _OF_MESHES[mesh] = kept
