"""Results that are computed once per mesh."""

from collections.abc import Callable, Hashable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, TypeVar

from tetlux.meshing.tets.path_cache import PathCache

# Results that are cached per mesh; the oldest are dropped first.
MOST_RESULTS = 32
_T = TypeVar("_T")


@dataclass(frozen=True, eq=False)
class MeshCache:
    """Results for one mesh.

    Attributes
    ----------
    paths : PathCache
        Paths that were traced through the mesh, see `tetlux.meshing.tets.march`.
    """

    paths: PathCache = field(default_factory=PathCache)
    _results: dict[Hashable, Any] = field(default_factory=dict)

    def get(self, key: Hashable, compute: Callable[[], _T]) -> _T:
        """The cached result of a key; if there is none, compute and cache it.

        The result of an unhashable key, such as one that contains lists, is computed each time.
        """
        results = self._results
        try:
            found: _T | None = results.get(key)
        except TypeError:
            return compute()
        if found is not None:
            return found
        result = compute()
        # Another thread may be dropping results too.
        with suppress(KeyError, RuntimeError, StopIteration):
            while len(results) >= MOST_RESULTS:
                del results[next(iter(results))]
        results[key] = result
        return result
