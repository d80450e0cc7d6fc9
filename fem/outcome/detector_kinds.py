"""The kinds of detectors on the surface, as users give them; `tetlux.fem.outcome.detectors` places and reads them."""

import math
from dataclasses import dataclass

from tetlux.fem.inputs import as_vector
from tetlux.meshing.arrays import Vector
from tetlux.meshing.errors import InputError


@dataclass(frozen=True)
class PointDetector:
    """Reads the exitance at one point.

    Parameters
    ----------
    position : (3,) floats
        Taken to the nearest point of the surface, unit.

    Raises
    ------
    InputError
        If a coordinate is not finite.

    Examples
    --------
    >>> spot = PointDetector((10.0, 0.0, 3.0))
    """

    position: Vector

    def __post_init__(self) -> None:
        as_vector(self.position, "position")


@dataclass(frozen=True)
class DiscDetector:
    """Reads the light that leaves through a flat disc at any angle.

    Parameters
    ----------
    center : (3,) floats
        Taken to the nearest point of the surface, unit; the disc is flat and touches the surface there.
    radius : float
        Radius of the disc, unit.

    Raises
    ------
    InputError
        If a coordinate is not finite or the radius not greater than 0.

    Examples
    --------
    >>> disc = DiscDetector(center=(10.0, 0.0, 0.0), radius=0.5)
    """

    center: Vector
    radius: float

    def __post_init__(self) -> None:
        as_vector(self.center, "center")
        if not math.isfinite(self.radius) or self.radius <= 0:
            raise InputError(f"radius is {self.radius:g}; give a length greater than 0.")


@dataclass(frozen=True)
class FibreDetector(DiscDetector):
    """Reads the light that a fibre at right angles to the surface collects.

    Parameters
    ----------
    center : (3,) floats
        Taken to the nearest point of the surface, unit.
    radius : float
        Of the fibre's core, unit.
    numerical_aperture : float
        Sine of the largest angle to the fibre that it accepts, in the outside medium: greater than 0, up to 1.

    Raises
    ------
    InputError
        If a coordinate is not finite, the radius not greater than 0 or the aperture out of range.

    Examples
    --------
    >>> fibre = FibreDetector(center=(10.0, 0.0, 0.0), radius=0.3, numerical_aperture=0.37)
    """

    numerical_aperture: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.numerical_aperture <= 1:
            raise InputError(
                f"numerical_aperture is {self.numerical_aperture:g}; it must be greater than 0 and at most 1."
            )


Detector = PointDetector | DiscDetector | FibreDetector
