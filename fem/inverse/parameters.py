"""`FitUnknowns`: unknowns of media and coordinates of lights, and the parameters by which an optimizer varies them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from tetlux.fem.inverse.unknowns import Start, Unknowns, media_unknowns
from tetlux.fem.lights.places import at_place, place_of
from tetlux.fem.media.medium import Medium
from tetlux.fem.media.region import Region
from tetlux.fem.sources.light import Light
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError

AXES = ("x", "y", "z")
# Coordinates are counted in decay lengths 1/sigma_tr, of at most so many mean free paths.
MOST_MEAN_FREE_PATHS = 10.0


@dataclass(frozen=True)
class Coordinate:
    """A coordinate of the position of a point, or of the origin of a pencil beam.

    Attributes
    ----------
    light : int
        Its number, from 0.
    axis : int
    start : float
        unit.
    """

    light: int
    axis: int
    start: float


@dataclass(frozen=True, eq=False)
class FitUnknowns:
    """Everything that a fit varies.

    Parameters of the optimizer are logarithms of what media consist of and of the gain, and distances of lights from
    where they begin, in `length`.

    Attributes
    ----------
    names : tuple of str
    of_media : Unknowns
        Those that are not coordinates, in their order; maybe none.
    coordinates : mapping of str to Coordinate
        The others.
    length : float
        unit.
    """

    names: tuple[str, ...]
    of_media: Unknowns
    coordinates: Mapping[str, Coordinate] = field(default_factory=dict)
    length: float = 1.0

    @property
    def positive(self) -> BoolArray:
        """Whether each unknown is greater than 0, (u,): all but coordinates."""
        return np.array([name not in self.coordinates for name in self.names], dtype=bool)

    @property
    def media_rows(self) -> IntArray:
        """Numbers of the unknowns of media."""
        return np.flatnonzero(self.positive)

    @property
    def start(self) -> FloatArray:
        """Values to begin with, (u,)."""
        start = np.array([self.coordinates[name].start if name in self.coordinates else 0.0 for name in self.names])
        start[self.media_rows] = self.of_media.start
        return start

    def media(self, values: FloatArray) -> list[list[Medium]]:
        """For each channel the medium of the body and of each region, by values (u,)."""
        return self.of_media.media(values[self.media_rows])

    @property
    def moving(self) -> list[int]:
        """Numbers of the lights that are moved, from 0."""
        return sorted({each.light for each in self.coordinates.values()})

    def lights(self, lights: Sequence[Light], values: FloatArray) -> list[Light]:
        """The lights with those that are moved at their places, by values (u,)."""
        found = list(lights)
        for name, value in zip(self.names, values.tolist(), strict=True):
            if name in self.coordinates:
                own = self.coordinates[name]
                place = place_of(found[own.light])
                assert place is not None
                place[own.axis] = value
                found[own.light] = at_place(found[own.light], place)
        return found

    def parameters(self, values: FloatArray) -> FloatArray:
        """Parameters (u,) of values (u,)."""
        positive, found = self.positive, (values - self.start) / self.length
        found[positive] = np.log(values[positive])
        return np.asarray(found)

    def values(self, parameters: FloatArray) -> FloatArray:
        """Values (u,) of parameters (u,)."""
        positive, found = self.positive, self.start + self.length * parameters
        found[positive] = np.exp(parameters[positive])
        return np.asarray(found)

    def slopes(self, values: FloatArray) -> FloatArray:
        """Derivatives of values (u,) with respect to their parameters, (u,)."""
        return np.where(self.positive, values, self.length)

    __repr__ = one_line


def unknowns_of(
    names: Sequence[str],
    start: Start | Sequence[Start | Sequence[Medium]],
    regions: Sequence[Region],
    lights: Sequence[Light] = (),
    *,
    region_names: Sequence[str] = (),
    light_names: Sequence[str] = (),
) -> FitUnknowns:
    """The unknowns that names stand for.

    Parameters
    ----------
    names : sequence of str
    start : Medium, mapping, or sequence of these
        See `tetlux.fem.fit`.
    regions : sequence of Region
    lights : sequence of Light
    region_names, light_names : sequence of str
        What stands before the dot in names of unknowns of regions and lights; by default the numbers of regions from
        1, and ``light1``, ``light2``, ...

    Raises
    ------
    InputError
        If a name is not known or given twice, or a start is 0 or not sensible.
    """
    if isinstance(names, str) or len(names) == 0:
        raise InputError(
            "unknowns are given in a list of names, and there is none; give at least one.", field="unknowns"
        )
    repeated = next((name for name in names if list(names).count(name) > 1), None)
    if repeated is not None:
        raise InputError(f'the unknown "{repeated}" is given twice; give each once.', field="unknowns")
    known = _coordinates(lights, light_names or [f"light{number}" for number in range(1, len(lights) + 1)])
    others = [name for name in names if name not in known]
    of_media = media_unknowns(others, start, regions, region_names, tuple(known))
    medium = of_media.media(of_media.start)[0][0]
    length = min(1.0 / medium.sigma_tr if medium.sigma_tr else np.inf, MOST_MEAN_FREE_PATHS * medium.mean_free_path)
    return FitUnknowns(tuple(names), of_media, {name: known[name] for name in names if name in known}, length)


def _coordinates(lights: Sequence[Light], names: Sequence[str]) -> dict[str, Coordinate]:
    """The coordinates of all lights that have a place, by name."""
    found: dict[str, Coordinate] = {}
    for number, (light, name) in enumerate(zip(lights, names, strict=True)):
        place = place_of(light)
        if place is not None:
            found |= {f"{name}.{axis}": Coordinate(number, k, float(place[k])) for k, axis in enumerate(AXES)}
    return found
