"""`Options`: arguments of `solve` that have a default, and which of them are for finite elements alone."""

from collections.abc import Mapping, Sequence
from typing import Any, TypedDict

from tetlux.fem.adapt import MOST_TETRAHEDRA
from tetlux.fem.known.split import Subtract
from tetlux.fem.media.region import Region
from tetlux.fem.operators.assembly import Lumping
from tetlux.fem.outcome.detector_kinds import Detector
from tetlux.fem.solve_scenes import Report, no_report
from tetlux.meshing.errors import InputError
from tetlux.meshing.tets.mesh import TetMesh


class Options(TypedDict, total=False):
    """Arguments of `solve` by finite elements that have a default, for the types of what it returns."""

    regions: Sequence[Region]
    tolerance: float | None
    detectors: Sequence[Detector]
    detector_tolerance: float | None
    everywhere_tolerance: float | None
    volume_tolerance: float | None
    mesh: TetMesh | None
    mass: Lumping
    subtract: Subtract
    limit: bool
    most_tetrahedra: int
    cache: bool
    report: Report
    frequency: float
    outside_index: float


# Arguments for finite elements alone, with their defaults.
OF_FINITE_ELEMENTS: Mapping[str, Any] = {
    "detector_tolerance": None,
    "everywhere_tolerance": None,
    "volume_tolerance": None,
    "mass": "lumped",
    "subtract": "fitted",
    "limit": True,
    "most_tetrahedra": MOST_TETRAHEDRA,
    "cache": True,
    "report": no_report,
    "frequency": 0.0,
    "outside_index": 1.0,
}


# Those that models take all the same.
ALSO_OF_CHARGES = {"detector_tolerance", "frequency", "outside_index"}
ALSO_OF_TRUNCATED = set(OF_FINITE_ELEMENTS) - {"everywhere_tolerance", "volume_tolerance", "frequency"}
TAKEN: Mapping[str, set[str]] = {"charges": ALSO_OF_CHARGES, "truncated": ALSO_OF_TRUNCATED}


def check_options_of(model: str, options: Options) -> None:
    """Refuse arguments that are for finite elements on the whole body alone.

    Raises
    ------
    InputError
    """
    names = [
        name
        for name, default in OF_FINITE_ELEMENTS.items()
        if options.get(name, default) != default and name not in TAKEN.get(model, ())
    ]
    if names:
        raise InputError(
            f'model "{model}" does not take {" and ".join(names)}; leave out what it does not take, or give '
            'model="full".'
        )
