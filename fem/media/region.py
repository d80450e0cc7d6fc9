"""A part of a body with a medium of its own."""

from collections.abc import Sequence
from dataclasses import dataclass

from tetlux.fem.media.coefficients import AnyMedium
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface


@dataclass(frozen=True, eq=False)
class Region:
    """A closed surface inside a body, and the medium that it encloses.

    Parameters
    ----------
    surface : Surface
        Inside the surface of the body, or inside that of another region; see `tetlux.meshing.check_regions`.
    medium : Medium, VaryingMedium, or sequence of these
        With the refractive index of the body's medium. A sequence gives one medium for each channel, as many as the
        body has.

    Examples
    --------
    >>> from tetlux.fem import Medium
    >>> from tetlux.meshing import sphere
    >>> Region(sphere(2.0), Medium(sigma_a=0.1, sigma_s_prime=1.0, eta=1.4)).medium.sigma_a
    0.1
    """

    surface: Surface
    medium: AnyMedium | Sequence[AnyMedium]

    __repr__ = one_line


def check_list_of_regions(regions: Sequence[Region]) -> None:
    """Refuse regions that are not a sequence of `Region`.

    Raises
    ------
    InputError
    """
    if not isinstance(regions, Sequence):
        raise InputError(f"regions are given in a list, and {type(regions).__name__} is none; write [Region(...)].")
    for region in regions:
        if not isinstance(region, Region):
            raise InputError(
                f"a {type(region).__name__} is given where a region is wanted; write Region(surface, medium), with the "
                "closed surface that bounds it."
            )


def only_medium(region: Region) -> AnyMedium:
    """The medium of a region with a single one.

    Raises
    ------
    InputError
        If the region has a sequence of media.
    """
    if isinstance(region.medium, AnyMedium):
        return region.medium
    raise InputError(f"a region has {len(region.medium)} media where one is wanted; give the one of this channel.")
