"""Light diffusing through bodies of any shape, by tetrahedral finite elements.

The subpackages are `tetlux.meshing` (shapes), `tetlux.fem` (light) and `tetlux.cases` (files and the command line);
each is imported when it is first used, so that ``import tetlux`` takes no time.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import ModuleType

    from tetlux import cases as cases
    from tetlux import fem as fem
    from tetlux import meshing as meshing

__all__ = ["__version__", "cases", "fem", "meshing"]

__version__ = "0.1.0"


def __getattr__(name: str) -> "ModuleType":
    if name in __all__:
        return import_module(f"tetlux.{name}")
    raise AttributeError(f"module 'tetlux' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
