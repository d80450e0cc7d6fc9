"""A benchmark: a case, the points where its exitance is measured, and the true exitance there."""

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

# Other programs of the machine disturb a run: a short one is repeated so many times.
REPEATS = 3


@dataclass(frozen=True, eq=False)
class Benchmark:
    """A case that methods are measured on.

    Attributes
    ----------
    case : Case
    deposits : list of Deposit
        What its lights leave in the body.
    samples : Samples
        Where exitance is compared.
    reference : Reference
    repeats : int
        How often a short run is made at most; the quickest counts.
    """

    case: Case
    deposits: list[Deposit]
    samples: Samples
    reference: Reference
    repeats: int = 1

    @property
    def shape(self) -> Shape | None:
        """The built-in shape of its surface, if that has one."""
        return self.case.surface.shape

    @property
    def lit(self) -> tuple[FloatArray, FloatArray]:
        """See `tetlux.fem.grading.places_to_resolve`."""
        return places_to_resolve(self.deposits)

    @property
    def sources(self) -> list[tuple[FloatArray, float]]:
        """Positions (3,) and powers, W, of all points where light is deposited."""
        terms = [deposit.terms for deposit in self.deposits]
        return [(point, float(power)) for t in terms for point, power in zip(t.points, t.powers, strict=True)]

    @property
    def in_points(self) -> bool:
        """Whether all light is deposited in points."""
        sources = ideal_sources(self.deposits)
        return sources is not None and sources.are_points

    def error_of(self, exitance: FloatArray) -> float:
        """Relative L2 error of an exitance (n,) at the samples."""
        return relative_error(exitance, self.reference.exitance, self.samples.weights)


def benchmark_of(case: Case, *, quick: bool = False) -> Benchmark:
    """Take samples of a case, and find the true exitance there.

    Raises
    ------
    RunError
        If the run that is to be the reference fails, no light leaves the body, or it has several media.
    """
    if not case.is_simple:
        raise RunError("a chart is of one channel and one even medium; leave lists, regions and fields out.")
    surface, medium = case.surface, case.medium
    deposits = [light.deposit_in(Body(surface, (medium,))) for light in case.lights]
    samples = surface_samples(surface, *places_to_resolve(deposits))
    measured = closed_form_reference(surface.shape, medium, deposits, samples)
    if measured is None:
        # A surface is more than its triangles where these stand for a curve.
        samples = samples._replace(points=surface.project(samples.points)[0])
        measured = samples, finer_run_reference(case, samples, quick=quick)
    samples, reference = measured
    if not np.max(reference.exitance, initial=0.0) > 0:
        raise RunError("no light leaves the body, so there is nothing to measure.")
    return Benchmark(case, deposits, samples, reference, 1 if quick else REPEATS)
