"""Places of charges that are kept with a mesh, so that readings on it depend smoothly on the coefficients.

Where charges go follows from a light's depth and from random draws: chosen anew for each set of coefficients, a reading
would jump by the error of the fit. So a light on a mesh that was solved on before has the places that it had then, and
is left to other ways if it was then.
"""

from dataclasses import dataclass, field
from weakref import WeakKeyDictionary

from tetlux.fem.known.fitted import FittedLight
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.mesh import TetMesh

# A fit serves for a light that is so many times deeper or shallower than the one they were chosen for.
OTHER_DEPTH = 1.5


@dataclass(frozen=True, eq=False)
class KeptPlaces:
    """Places by light.

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

    def copy(self) -> "KeptPlaces":
        """The same choices, to which others can be added."""
        return KeptPlaces({light: list(choices) for light, choices in self.choices.items()})

    __repr__ = one_line


_OF_MESHES: WeakKeyDictionary[TetMesh, KeptPlaces] = WeakKeyDictionary()


def kept_on(mesh: TetMesh) -> KeptPlaces:
    """What is kept with a mesh; nothing at first."""
    return _OF_MESHES.setdefault(mesh, KeptPlaces())


def keep_with(mesh: TetMesh, kept: KeptPlaces) -> None:
    """Keep places with a mesh."""
    _OF_MESHES[mesh] = kept
