"""`Benchmark`: a case, sample points of its surface, and the reference exitance there."""

from dataclasses import dataclass

import numpy as np

from tetlux.cases.chart.reference import Reference, closed_form_reference, finer_run_reference
from tetlux.cases.chart.samples import Samples, relative_error, surface_samples
from tetlux.cases.file.case import Case
from tetlux.fem.body.body import Body
from tetlux.fem.exact.registry import ideal_sources
from tetlux.fem.grading import places_to_resolve
from tetlux.fem.lights import Deposit
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import RunError
from tetlux.meshing.surface.solids import Shape

# Short runs are repeated this many times, since other processes disturb their timing.
REPEATS = 3


@dataclass(frozen=True, eq=False)
class Benchmark:
    """A case on which methods are compared.

    Attributes
    ----------
    case : Case
    deposits : list of Deposit
        The deposits of its lights.
    samples : Samples
        Points where exitance is compared.
    reference : Reference
    repeats : int
        How many times a short run is made; the fastest counts.
    """

    case: Case
    deposits: list[Deposit]
    samples: Samples
    reference: Reference
    repeats: int = 1

    @property
    def shape(self) -> Shape | None:
        """The built-in shape of the surface, if it has one."""
        return self.case.surface.shape

    @property
    def lit(self) -> tuple[FloatArray, FloatArray]:
        """Points where light is deposited, and the lengths to resolve there; see `places_to_resolve`."""
        return places_to_resolve(self.deposits)

    @property
    def sources(self) -> list[tuple[FloatArray, float]]:
        """Positions (3,) and powers, W, of all point deposits."""
        terms = [deposit.terms for deposit in self.deposits]
        return [(point, float(power)) for t in terms for point, power in zip(t.points, t.powers, strict=True)]

    @property
    def has_point_sources(self) -> bool:
        """Whether all deposits are points."""
        sources = ideal_sources(self.deposits)
        return sources is not None and sources.are_points

    def error_of(self, exitance: FloatArray) -> float:
        """Relative L2 error of an exitance (n,) at the samples."""
        return relative_error(exitance, self.reference.exitance, self.samples.weights)


def prepare_benchmark(case: Case, *, quick: bool = False) -> Benchmark:
    """Choose sample points of a case, and compute the reference exitance there.

    Raises
    ------
    RunError
        If the case has several media, the reference run fails, or no light leaves the body.
    """
    if not case.has_single_medium:
        raise RunError("a chart needs one channel and one uniform medium; leave lists, regions and fields out.")
    surface, medium = case.surface, case.medium
    deposits = [light.deposit_in(Body(surface, (medium,))) for light in case.lights]
    samples = surface_samples(surface, *places_to_resolve(deposits))
    referenced = closed_form_reference(surface.shape, medium, deposits, samples)
    if referenced is None:
        # Triangles may stand for a smooth surface: move the samples onto it.
        samples = samples._replace(points=surface.project(samples.points)[0])
        referenced = samples, finer_run_reference(case, samples, quick=quick)
    samples, reference = referenced
    if not np.max(reference.exitance, initial=0.0) > 0:
        raise RunError("no light leaves the body; give a smaller or less absorbing one.")
    return Benchmark(case, deposits, samples, reference, 1 if quick else REPEATS)
