"""`LightContext`: what the section of a light needs to know of its case to build the light of one channel."""

from typing import Protocol

from tetlux.cases.file.schema.parts import Encoding
from tetlux.meshing.arrays import FloatArray


class LightContext(Protocol):
    """One channel of a case, as `tetlux.cases.file.channel_context.ChannelContext` implements it."""

    @property
    def channel(self) -> int:
        """Number of the channel."""
        ...

    @property
    def count(self) -> int:
        """How many channels there are."""
        ...

    def pixels(self, file: str, encoding: Encoding) -> FloatArray | None:
        """The image as the channel sees it, (rows, columns); None if it is black in this channel and not in others."""
        ...

    def region(self, name: str | int | None) -> int | None:
        """The number of a region by its name; None stands for the whole body."""
        ...
