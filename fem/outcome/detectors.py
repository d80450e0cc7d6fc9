"""Detectors on the surface: where they are, and what they read of a solution."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.fem.inputs import as_vector
from tetlux.fem.outcome.detector_kinds import Detector, DiscDetector, FibreDetector, PointDetector
from tetlux.fem.outcome.exitance_field import ExitanceField, FieldWithErrors
from tetlux.fem.outcome.radiance import collected_share
from tetlux.fem.outcome.reading import Reading
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.quadratic.error import read_with_error
from tetlux.fem.quadratic.measurement import Measurement
from tetlux.fem.quadratic.reading_error import ReadingError
from tetlux.meshing.arrays import FloatArray, Vector, perpendicular_axes
from tetlux.meshing.describe import as_text, one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface

# Largest distance of a point detector from the surface, as a share of the body's diagonal.
LARGEST_DISTANCE_SHARE = 0.05
# Largest distance between a disc and the surface, as a share of the disc's radius; on a sphere it is reached by a disc
# of half the sphere's radius.
LARGEST_GAP_SHARE = 0.25
# Number of circles of quadrature points on a disc, at Gauss points of the square of the radius.
CIRCLES = 16
# Number of quadrature points on each circle.
SPOKES = 32
# Most tetrahedra of a mesh that is read by quadratic elements; on larger ones these take a minute and gigabytes. Larger
# meshes are read by linear elements, without an error.
MOST_TETRAHEDRA_TO_READ = 400_000


def read(detector: Detector, solution: ExitanceField) -> Reading:
    """Read a detector.

    The exitance of a disc is a mean over the flat disc that touches the surface, taken at the surface points nearest to
    the points of the disc. A fibre collects radiance up to the angle whose sine is its numerical aperture. The radiance
    is proportional to Fresnel's transmittance at its angle, and its flux is the exitance. Detectors do not change the
    light in the body.

    Readings of a solution on a mesh come from quadratic elements on the same mesh, which are solved for at the first
    reading: see `tetlux.fem.quadratic`. Far from the light their error is a tenth of that of the linear elements of
    `Solution.exitance`.

    Parameters
    ----------
    detector : PointDetector, DiscDetector or FibreDetector
    solution : Solution or another ExitanceField

    Returns
    -------
    Reading

    Raises
    ------
    InputError
        If a point is farther from the surface than 5 % of the body's diagonal, or a disc's center farther than its
        radius; or if the surface is not flat enough for the disc, or ends under it.

    Examples
    --------
    >>> from tetlux.fem import Medium, PointDetector, PointSource, solve
    >>> from tetlux.meshing import sphere
    >>> medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> solution = solve(sphere(radius=10.0), medium, [PointSource((0, 0, 0))], model="closed-form")
    >>> reading = read(PointDetector((10.0, 0.0, 0.0)), solution)
    >>> bool(0 < reading.exitance < 1 / (4 * 3.14 * 10**2))  # W/mm², less than without absorption
    True
    """
    return read_all([detector], solution)[0]


def _read(placed: "PlacedDetector", solution: ExitanceField, error: float | None = None) -> Reading:
    model = None
    if isinstance(solution, Solution) and is_quadratic(solution):
        found = estimate_reading(solution, placed.measurement)
        exitance, error = found.value, found.relative
    else:
        exitance = (placed.measurement.weights @ solution.exitance_on(placed.measurement.points)).item()
    if isinstance(solution, Solution | FieldWithErrors) and solution.validity is not None:
        model = float(placed.measurement.weights @ (1.0 - solution.validity.at(placed.measurement.points)))
    power = None if placed.area is None else placed.share * exitance * placed.area
    return Reading(placed.position, placed.normal, exitance, placed.area, power, error, model)


def is_quadratic(solution: Solution) -> bool:
    """Whether a solution is read by quadratic elements: its mesh may be too large."""
    return solution.quadratic is not None and len(solution.mesh.tetrahedra) <= MOST_TETRAHEDRA_TO_READ


def estimate_reading(solution: Solution, measurement: Measurement) -> ReadingError:
    """The exitance at points of a solution by quadratic elements, with its error.

    Where distributed light decays within a tetrahedron, linear elements are better; the error is the difference.
    """
    quadratic = solution.quadratic
    assert quadratic is not None
    found = read_with_error(quadratic, measurement)
    if not quadratic.thin_layers.any():
        return found
    cells = quadratic.operator.discretise(measurement).cells
    if not quadratic.thin_layers[cells].any():
        return found
    if len(solution.of_lights) > 1:
        parts = [estimate_reading(part, measurement) for part in solution.of_lights]
        return ReadingError.add(parts)
    value = (measurement.weights @ solution.exitance_on(measurement.points)).item()
    squares = np.zeros(len(found.squares))
    squares[cells[0]] = abs(value - found.value) ** 2
    return ReadingError(value, squares, 0.0, 0.0)


def read_all(detectors: Sequence[Detector], solution: ExitanceField) -> tuple[Reading, ...]:
    """`read` several detectors; this is faster than reading one after another."""
    if not detectors:
        return ()
    placed = [place_detector(detector, solution) for detector in detectors]
    if isinstance(solution, FieldWithErrors):
        errors = solution.errors_on(np.array([each.position for each in placed])).tolist()
        return tuple(_read(each, solution, error) for each, error in zip(placed, errors, strict=True))
    if not (isinstance(solution, Solution) and is_quadratic(solution)):
        return tuple(_read(each, solution) for each in placed)
    assert solution.quadratic is not None
    parts, rest = solution.quadratic.prepare([each.measurement for each in placed]), iter(placed)
    return tuple(_read(next(rest), solution) for some in parts for _ in some)


@dataclass(frozen=True, eq=False)
class PlacedDetector:
    """A detector on a body.

    Attributes
    ----------
    position, normal : (3,) floats
        Its position on the surface, and the outward unit normal there. Meshes are made fine towards it, the error of
        ``model="charges"`` is that at it, and pictures measure the distance from the light to it.
    measurement : Measurement
        The points at which it reads.
    area : float or None
        Of the flat disc, unit²; None for a point.
    share : float
        Collected share of the exitance.
    """

    position: Vector
    normal: Vector
    measurement: Measurement
    area: float | None = None
    share: float = 1.0

    __repr__ = one_line


def place_detector(detector: Detector, solution: ExitanceField) -> PlacedDetector:
    """Place a detector on the body of a solution: see `read`."""
    if isinstance(detector, PointDetector):
        reach = LARGEST_DISTANCE_SHARE * solution.surface.diagonal
        place, normal = _on_surface(
            solution, "position", detector.position, reach, f"{LARGEST_DISTANCE_SHARE:.0%} of the diagonal"
        )
        return PlacedDetector(_vector(place), _vector(normal), Measurement(place[None], np.ones(1)))
    if not isinstance(detector, DiscDetector):
        raise InputError(f"{detector!r} is no detector; give PointDetector, DiscDetector or FibreDetector.")
    place, normal = _on_surface(solution, "center", detector.center, detector.radius, "its radius")
    flat = place + detector.radius * _unit_disc(normal)
    points, _ = drop_perpendiculars(solution.surface, flat)
    gap = float(np.linalg.norm(points - flat, axis=1).max())
    if gap > LARGEST_GAP_SHARE * detector.radius:
        raise InputError(
            f"the disc of radius {detector.radius:.3g} at {as_text(place)} does not lie on the surface, which bends "
            f"away or ends {gap:.3g} {solution.surface.unit} from it; make it smaller or move it."
        )
    weights = np.repeat(np.polynomial.legendre.leggauss(CIRCLES)[1], SPOKES) / (2.0 * SPOKES)
    share = 1.0
    if isinstance(detector, FibreDetector):
        eta = solution.medium.eta
        share = collected_share(eta, detector.numerical_aperture) / collected_share(eta, 1.0)
    measurement = Measurement(points, weights)
    return PlacedDetector(_vector(place), _vector(normal), measurement, math.pi * detector.radius**2, share)


def _on_surface(
    solution: ExitanceField, name: str, given: Vector, reach: float, what: str
) -> tuple[FloatArray, FloatArray]:
    """The nearest point of the surface and the normal there, unless it is out of reach."""
    position = as_vector(given, name)
    (place,), (normal,) = drop_perpendiculars(solution.surface, position[None])
    distance = float(np.linalg.norm(position - place))
    if distance > reach:
        raise InputError(
            f"the detector's {name} {as_text(position)} is {distance:.3g} {solution.surface.unit} from the surface, "
            f"more than {what}, {reach:.3g}; the nearest point of the surface is {as_text(place)}."
        )
    return place, normal


def drop_perpendiculars(surface: Surface, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The places on the smooth surface (q, 3) nearest to points (q, 3), unit, and the normals there.

    The nearest place on the triangles lies under another one, on a ball of 5,120 triangles up to 5e-5 of its radius
    away, and readings near the light change by .1 % on that way. Shifted back, it is 4e-8 of the radius away.
    """
    places, normals = surface.project(points)
    offset = points - places
    return surface.project(points + offset - np.einsum("qi,qi->q", offset, normals)[:, None] * normals)


def _unit_disc(normal: FloatArray) -> FloatArray:
    """Points (CIRCLES * SPOKES, 3) of the unit disc across a normal, circle by circle."""
    radius = np.sqrt(0.5 * (np.polynomial.legendre.leggauss(CIRCLES)[0] + 1.0))
    # Every other circle is rotated by half a step, so that points do not line up.
    rotation = 0.5 * (np.arange(CIRCLES) % 2)
    angle = 2.0 * np.pi / SPOKES * (np.arange(SPOKES) + rotation[:, None])
    across, up = perpendicular_axes(normal)
    spread = np.cos(angle)[:, :, None] * across + np.sin(angle)[:, :, None] * up
    return np.asarray((radius[:, None, None] * spread).reshape(-1, 3))


def _vector(values: FloatArray) -> Vector:
    x, y, z = values.tolist()
    return x, y, z
