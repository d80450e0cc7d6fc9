"""`InChannel`: what the section of a light is told of the case when it makes the light of one channel."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from tetlux.cases.file.images import of_channel
from tetlux.cases.file.schema.parts import Encoding
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError


@dataclass(frozen=True)
class InChannel:
    """One channel of a case.

    Parameters
    ----------
    channel, count : int
        Number of the channel, and of channels.
    regions : mapping of str to int
        Numbers of the regions, or labels, by name; None is the whole body.
    read_pixels : callable
        Reads an image file of the case in linear light, (rows, columns, 3).
    """

    channel: int
    count: int
    regions: Mapping[str, int | None]
    read_pixels: Callable[[str, Encoding], FloatArray]

    def pixels(self, file: str, encoding: Encoding) -> FloatArray | None:
        """What the channel sees of an image, (rows, columns); None if it is black here and not in other channels."""
        colours = self.read_pixels(file, encoding)
        pixels = of_channel(colours, self.channel, self.count)
        return None if not pixels.any() and colours.any() else pixels

    def region(self, name: str | int | None) -> int | None:
        """Number of a region by its name.

        Raises
        ------
        InputError
            If there is none of this name.
        """
        if name is None:
            return None
        if str(name) not in self.regions:
            raise InputError(f'there is no region "{name}"; the regions here are {", ".join(self.regions)}.')
        return self.regions[str(name)]
