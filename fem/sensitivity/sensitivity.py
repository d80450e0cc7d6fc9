"""`sensitivity`: derivatives of what detectors read to the coefficients of a body."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from tetlux.fem.known.split import Subtract, check_lights, replace_fitted
from tetlux.fem.media.coefficients import by_label
from tetlux.fem.models.diffusion import is_diffusion
from tetlux.fem.outcome.detector_kinds import Detector
from tetlux.fem.outcome.detectors import MOST_TETRAHEDRA_TO_READ, place_detector
from tetlux.fem.quadratic.measurement import DiscreteMeasurement
from tetlux.fem.quadratic.scene import QuadraticScene
from tetlux.fem.quadratic.solution import QuadraticSolution
from tetlux.fem.sensitivity.entry_paths import entry_shares
from tetlux.fem.sensitivity.near_sources import missing_charges
from tetlux.fem.sensitivity.nearby import Coefficient
from tetlux.fem.sensitivity.parameters import Per, parameter_shares
from tetlux.fem.sensitivity.positions import check_places, derivatives_to_places
from tetlux.fem.sensitivity.products import multiply
from tetlux.fem.sensitivity.subtracted import Readout
from tetlux.fem.sources.light import Light
from tetlux.fem.system import System
from tetlux.meshing.arrays import FloatArray, IntArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.host.blocks import map_in_threads

COEFFICIENTS: tuple[Coefficient, ...] = ("sigma_a", "sigma_s_prime")
# Relative residual at which iterations stop: readings are corrected by the product of those of lights and duals, and
# derivatives are off by about one of them. Iterations to 1e-10 are a quarter more.
STOP_RESIDUAL = 1e-8
# A reading below this share of the brightest place of the surface is rounding.
RESOLVED = 1e-14


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Derivatives of readings of each of l lights at each of d detectors.

    Attributes
    ----------
    readings : (l, d) ndarray
        Exitance, W/unit²; complex for modulated light.
    derivatives : dict of str to (l, d, p) ndarray
        By coefficient, ``sigma_a`` or ``sigma_s_prime``: derivatives of the readings, W/unit, or of their logarithms,
        unit, to the coefficient of each parameter. With `positions`, ``position`` has (k, d, 3), the derivatives of
        the readings of each of these k lights to its coordinates, W/unit³ or 1/unit.
    path_lengths : (l, d, r) ndarray
        Mean partial path lengths of the light of each reading in each medium, unit: ``-d ln y/d sigma_a`` at constant
        D. Their sum is the mean time of flight times the speed of light.
    labels : tuple of int
        Of the r media: 0 is the body's and 1, 2, ... the regions', or labels of the mesh.
    """

    readings: NumberArray
    derivatives: dict[str, NumberArray]
    path_lengths: NumberArray
    labels: tuple[int, ...]

    __repr__ = one_line


def sensitivity(
    system: System,
    lights: Sequence[Light],
    detectors: Sequence[Detector],
    *,
    to: Sequence[Coefficient] = COEFFICIENTS,
    per: Per = "node",
    log: bool = False,
    positions: Sequence[int] = (),
    subtract: Subtract = "fitted",
    dtype: npt.DTypeLike = np.float64,
) -> Sensitivity:
    """Derivatives of readings with respect to absorption and scattering, by adjoint solutions.

    Each light and each detector takes one solution; the rest is products. The derivative with respect to the
    coefficients of a region is that of the reading as it is computed on this mesh, including depths and powers of
    lights, what is subtracted, and D, so that it agrees with differences of readings of `System.solve`.

    Parameters
    ----------
    system : System
        On a mesh that is fine enough for what the detectors read; with a `shift`, light is modulated.
    lights : sequence of Light
        At least one; each has readings of its own.
    detectors : sequence of detectors
        At least one.
    to : sequence of {"sigma_a", "sigma_s_prime"}
    per : {"node", "tetrahedron", "region"} or Grid
        What has a coefficient. Over all nodes, tetrahedra or grid points of a region the derivatives sum to that of the
        region.
    log : bool
        Whether of logarithms of readings, whose imaginary part is minus the phase lag in radians.
    positions : sequence of int
        Numbers, from 0, of lights whose readings are differentiated to their position, too: of points, and of the
        origins of pencil beams.
    subtract : {"fitted", "half-space", "free-space", "nothing"}
        See `tetlux.fem.solve`.
    dtype : dtype
        Of the derivatives: single precision halves their memory. Its complex kind is used for modulated light.

    Returns
    -------
    Sensitivity

    Raises
    ------
    InputError
        If an argument is not sensible, or a reading is 0 or below and its logarithm is asked for.
    RunError
        If the linear solver fails, or charges of a light come or go with the least change of a coefficient.

    Notes
    -----
    The forward and adjoint fluences and their products: Arridge 1999, Inverse Problems 15, R41, sec. 4. Coefficients
    along a beam also change the depth and power of its sources; this part goes to the tetrahedra along its path, for
    broad beams by length and power.

    Examples
    --------
    >>> from tetlux.fem import Medium, PencilBeam, PointDetector, System, solve
    >>> from tetlux.meshing import sphere
    >>> ball, tissue = sphere(10.0), Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> beam, there = PencilBeam((0, 0, 20), (0, 0, -1)), PointDetector((10, 0, 0))
    >>> mesh = solve(ball, tissue, [beam], detectors=[there], detector_tolerance=0.02).mesh
    >>> found = sensitivity(System(mesh, tissue, ball), [beam], [there], per="region", log=True)
    >>> round(float(found.path_lengths[0, 0, 0]))  # mm
    66
    >>> bool(found.derivatives["sigma_a"][0, 0, 0] < 0)
    True
    """
    _check(system, lights, detectors, to)
    check_places(lights, positions)
    if system.surface is None or system.surface is system.mesh.surface:
        subtract = replace_fitted(subtract)
    labels, numbers = _media(system)
    media = parameter_shares(system.mesh, numbers, "region")
    shares = media if per == "region" else parameter_shares(system.mesh, numbers, per)
    solution = system.solve(lights, subtract=subtract)
    assert solution.quadratic is not None
    scene = replace(solution.quadratic.scene, stop_residual=STOP_RESIDUAL)
    measured = [scene.operator.discretise(place_detector(each, solution).measurement) for each in detectors]
    _check_layers(scene, measured)
    duals = scene.operator.solve(np.column_stack([each.load for each in measured]), STOP_RESIDUAL)
    readout = Readout(system, lights, subtract, scene, measured, duals)
    readings = readout.readings()
    if log:
        check_readings(readings, resolved(scene))
    if np.iscomplexobj(readings):
        dtype = np.result_type(dtype, np.complex64)
    derivatives, mass = _derivatives(readout, shares, media, to, dtype)
    if log:
        for name in derivatives:
            derivatives[name] /= readings.astype(dtype)
    found = {name: np.moveaxis(each, 0, -1) for name, each in derivatives.items()}
    if len(positions):
        of_places = derivatives_to_places(readout, positions)
        found["position"] = of_places / readings[list(positions), :, None] if log else of_places
    return Sensitivity(readings, found, np.moveaxis(mass / readings, 0, -1), labels)


def _derivatives(
    readout: Readout, shares: csr_array, media: csr_array, to: Sequence[Coefficient], dtype: npt.DTypeLike
) -> tuple[dict[str, NumberArray], NumberArray]:
    """Derivatives to each coefficient of each parameter, (p, l, d), and ``∫ u z`` over each medium, (r, l, d)."""
    space, fluences, duals = readout.scene.operator.space, readout.scene.fluence, readout.duals
    # 3 D² is the derivative of -D to sigma_t'.
    squares = 3.0 * np.square(readout.scene.operator.coefficients.diffusion)
    factors = np.ascontiguousarray(np.broadcast_to(squares, media.shape[0]))
    sums = multiply(space, fluences, duals, factors, shares, media, dtype)
    added_mass, added_stiffness = np.zeros((2, *sums.mass_of_media.shape), sums.mass_of_media.dtype)
    every = [(light, patch) for light, patches in enumerate(readout.scene.patches) for patch in patches]
    missed = map_in_threads(lambda each: missing_charges(space, each[1]), every)
    for (light, _), missing in zip(every, missed, strict=True):
        dual = duals[space.cells[missing.cells]]
        for values, target, added in (
            (missing.mass, sums.mass, added_mass),
            (factors[missing.cells, None] * missing.stiffness, sums.stiffness, added_stiffness),
        ):
            products = np.einsum("ca,cad->cd", values, dual)
            target[:, light] += shares[missing.cells].T @ products
            added[:, light] += media[missing.cells].T @ products
    mass = sums.mass_of_media + added_mass
    found: dict[str, NumberArray] = {}
    if "sigma_a" in to:
        found["sigma_a"] = np.subtract(sums.stiffness, sums.mass, out=sums.mass)
    if "sigma_s_prime" in to:
        found["sigma_s_prime"] = sums.stiffness
    _add_rest(found, readout, shares, {"sigma_a": added_stiffness - added_mass, "sigma_s_prime": added_stiffness})
    return found, mass


def _add_rest(
    derivatives: dict[str, NumberArray], readout: Readout, shares: csr_array, added: dict[str, NumberArray]
) -> None:
    """Add what derivatives of media have besides products to derivatives (p, l, d), in place.

    Products already have `added` (r, l, d) in place of the derivatives of charges.
    """
    system = readout.system
    labels, numbers = _media(system)
    names: list[Coefficient] = [name for name in COEFFICIENTS if name in derivatives]
    rest = np.array([readout.derivatives(label, names) for label in labels])
    for light, deposit in enumerate(readout.deposits()):
        ways = shares.T @ entry_shares(deposit, system.mesh, system.true_surface, numbers, len(labels))
        for number, name in enumerate(names):
            derivatives[name][:, light] += ways @ (rest[:, number, light] - added[name][:, light])


def _media(system: System) -> tuple[tuple[int, ...], IntArray]:
    """The labels of media, and the number of that of each tetrahedron, (m,)."""
    labels = tuple(by_label(system.media))
    if len(labels) == 1:
        return labels, np.zeros(len(system.mesh.tetrahedra), dtype=np.int64)
    order = np.argsort(labels)
    return labels, order[np.searchsorted(np.array(labels)[order], system.mesh.regions)]


def _check(system: System, lights: Sequence[Light], detectors: Sequence[Detector], to: Sequence[Coefficient]) -> None:
    """Refuse what has no sensitivities."""
    check_lights(lights)
    if len(detectors) == 0:
        raise InputError(
            "sensitivities are of what detectors read, and there is none; give at least one.", field="detectors"
        )
    if isinstance(to, str) or not to or not set(to) <= set(COEFFICIENTS):
        names = " and ".join(f'"{name}"' for name in COEFFICIENTS)
        raise InputError(f"to is {to!r}; give a list of {names}, or of one of them.", field="to")
    if not is_diffusion(system.model):
        raise InputError("the model is not diffusion, for which alone there are sensitivities.", field="system")
    if len(system.mesh.tetrahedra) > MOST_TETRAHEDRA_TO_READ:
        raise InputError(
            f"the mesh has {len(system.mesh.tetrahedra):,} tetrahedra, and sensitivities are of readings of quadratic "
            f"elements, which are made on {MOST_TETRAHEDRA_TO_READ:,} at most; give a coarser mesh.",
            field="system",
        )


def _check_layers(scene: QuadraticScene, measured: Sequence[DiscreteMeasurement]) -> None:
    """Refuse detectors in diffuse light that fades within a tetrahedron, which linear elements read."""
    layers = QuadraticSolution(scene, tuple(range(len(scene.deposits)))).thin_layers
    if layers.any() and any(layers[each.cells].any() for each in measured):
        raise InputError(
            "diffuse light fades within a tetrahedron at a detector, so that its reading has no sensitivities; give a "
            "mesh that is finer at the surface."
        )


def resolved(scene: QuadraticScene) -> FloatArray:
    """The least exitance that rounding resolves, of each light, (l,), W/unit²."""
    nodes, robin = scene.operator.mesh.boundary_nodes, scene.operator.robin
    return np.asarray(RESOLVED * robin * np.abs(scene.fluence[nodes]).max(axis=0))


def check_readings(readings: NumberArray, least: FloatArray) -> None:
    """Refuse readings (l, d) that have no logarithm since they are less than is resolved of each light (l,)."""
    dark = np.argwhere((np.abs(readings) if np.iscomplexobj(readings) else readings) <= least[:, None])
    if len(dark):
        light, detector = dark[0].tolist()
        raise InputError(
            f"detector {detector + 1} is in the dark: it reads {readings[light, detector]:.3g} of light {light + 1}, "
            f"and less than {least[light]:.3g} is not resolved; leave it out."
        )
