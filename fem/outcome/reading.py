"""`Reading`: the exitance and power at a detector, and their errors."""

from dataclasses import dataclass

from tetlux.meshing.arrays import Number, Vector


@dataclass(frozen=True)
class Reading:
    """Exitance and power at a detector, with estimated errors.

    Attributes
    ----------
    position : (3,) floats
        Of the detector on the surface, unit.
    normal : (3,) floats
        Outward unit normal there.
    exitance : float, or complex for modulated light
        At the point, or the mean over the disc, W/unit².
    area : float or None
        Of the flat disc, unit²; None for a point.
    power : float, complex or None
        Exitance times area, and for a fibre the share of it within its aperture, W; None for a point.
    relative_error : float or None
        Estimated numerical error of this reading, relative: see `tetlux.fem.quadratic.error`, and
        `tetlux.fem.meshless.reading_error` without a mesh. None where it is not estimated.
    model_error : float or None
        Expected relative error of the diffusion approximation there, which no mesh reduces: see
        `tetlux.fem.validity.local`. None where it is not known, as of one of several lights.
    """

    position: Vector
    normal: Vector
    exitance: Number
    area: float | None = None
    power: Number | None = None
    relative_error: float | None = None
    model_error: float | None = None
