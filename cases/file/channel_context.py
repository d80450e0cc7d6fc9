"""`ChannelContext`: what the section of a light needs to know of its case to build the light of one channel."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from tetlux.cases.file.images import pixels_in_channel
from tetlux.cases.file.schema.parts import Encoding
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError


@dataclass(frozen=True)
class ChannelContext:
    """One channel of a case.

    Parameters
    ----------
    channel, count : int
        Number of this channel from 0, and how many there are.
    regions : mapping of str to int
        Numbers of the regions, or labels, by name; None stands for the whole body.
    read_pixels : callable
        Reads an image file of the case as linear light, (rows, columns, 3).
    """

    channel: int
    count: int
    regions: Mapping[str, int | None]
    read_pixels: Callable[[str, Encoding], FloatArray]

    def pixels(self, file: str, encoding: Encoding) -> FloatArray | None:
        """The image as the channel sees it, (rows, columns); None if it is black in this channel and not in others."""
        colours = self.read_pixels(file, encoding)
        pixels = pixels_in_channel(colours, self.channel, self.count)
        return None if not pixels.any() and colours.any() else pixels

    def region(self, name: str | int | None) -> int | None:
        """The number of a region by its name; None stands for the whole body.

        Raises
        ------
        InputError
            If no region has this name.
        """
        return find_part(self.regions, name)


def find_part(parts: Mapping[str, int | None], name: str | int | None) -> int | None:
    """The number of a region or label by its name; None stands for the whole body.

    Raises
    ------
    InputError
        If none has this name.
    """
    if name is None:
        return None
    if str(name) not in parts:
        raise InputError(f'there is no region "{name}"; the regions here are {", ".join(parts)}.', field="region")
    return parts[str(name)]
