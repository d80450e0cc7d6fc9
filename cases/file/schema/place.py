"""`Place`: what the section of a light asks of the case when it makes the light of one channel."""

from typing import Protocol

from tetlux.cases.file.schema.parts import Encoding
from tetlux.meshing.arrays import FloatArray


class Place(Protocol):
    """One channel of a case; `tetlux.cases.file.in_channel.InChannel` is the one there is."""

    @property
    def channel(self) -> int:
        """Number of the channel."""
        ...

    @property
    def count(self) -> int:
        """How many channels there are."""
        ...

    def pixels(self, file: str, encoding: Encoding) -> FloatArray | None:
        """What the channel sees of an image, (rows, columns); None if it is black here and not in other channels."""
        ...

    def region(self, name: str | int | None) -> int | None:
        """Number of a region by its name; None is the whole body."""
        ...
