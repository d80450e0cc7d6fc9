"""`Reading`: the exitance and power at a detector, and their errors."""

from dataclasses import dataclass

from tetlux.meshing.arrays import Number, Vector


@dataclass(frozen=True)
class Reading:
    """Exitance and power at a detector, with estimated errors.

    Attributes
    ----------
    position : (3,) floats
        Where the detector is on the surface, unit.
    normal : (3,) floats
        Outward unit normal there.
    exitance : float, or complex for modulated light
        Exitance at the point, or its mean over the disc, W/unit².
    area : float or None
        Area of the flat disc, unit²; None for a point.
    power : float, complex or None
        Exitance times area, and for a fibre the share of it within its aperture, W; None for a point.
    relative_error : float or None
        Estimated numerical error of this reading, relative: see `tetlux.fem.quadratic.error`, and
        `tetlux.fem.meshless.reading_error` without a mesh. None where it is not estimated.
    model_error : float or None
        Expected relative error of the diffusion approximation there, which no mesh reduces: see
        `tetlux.fem.validity.local`. None where it is not known, as of one of several lights.

    Examples
    --------
    >>> from tetlux.fem import DiscDetector, Medium, PointSource, read, solve
    >>> from tetlux.meshing import sphere
    >>> tissue = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> solution = solve(sphere(10.0), tissue, [PointSource((0, 0, 0))], model="closed-form")
    >>> reading = read(DiscDetector(center=(10, 0, 0), radius=0.5), solution)
    >>> f"{reading.exitance:.2e} W/mm², {reading.area:.3f} mm², {reading.power:.2e} W"
    '4.30e-04 W/mm², 0.785 mm², 3.38e-04 W'
    >>> reading.model_error < 0.1  # of diffusion itself; `relative_error` is the numerical one
    True
    """

    position: Vector
    normal: Vector
    exitance: Number
    area: float | None = None
    power: Number | None = None
    relative_error: float | None = None
    model_error: float | None = None
