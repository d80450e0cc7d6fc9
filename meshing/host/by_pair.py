"""`ByPair`: what is computed once for two objects, and kept as long as both live."""

from collections.abc import Callable
from typing import Generic, TypeVar
from weakref import WeakKeyDictionary

_First = TypeVar("_First")
_Second = TypeVar("_Second")
_Value = TypeVar("_Value")


class ByPair(Generic[_First, _Second, _Value]):
    """Values by two objects, such as a mesh and the points that runs on it share.

    A value must not refer to either of them, or none of the three is ever freed.

    Examples
    --------
    >>> class Body: ...
    >>> first, second, kept = Body(), Body(), ByPair()
    >>> kept.get(first, second, lambda: 1), kept.get(first, second, lambda: 2), kept.get(second, first, lambda: 3)
    (1, 1, 3)
    """

    def __init__(self) -> None:
        self._kept: WeakKeyDictionary[_First, WeakKeyDictionary[_Second, _Value]] = WeakKeyDictionary()

    def get(self, first: _First, second: _Second, make: Callable[[], _Value]) -> _Value:
        """The value of two objects, which is made if there is none."""
        of_first = self._kept.setdefault(first, WeakKeyDictionary())
        if second not in of_first:
            of_first[second] = make()
        return of_first[second]
