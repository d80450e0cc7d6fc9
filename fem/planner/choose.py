"""`plan`: the public function that says how a scene would be solved."""

from collections.abc import Sequence
from dataclasses import replace

from tetlux.fem.assessment import Tolerances
from tetlux.fem.inputs import DEFAULT_TOLERANCE
from tetlux.fem.labels import GivenMedia
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.region import Region
from tetlux.fem.outcome.detector_kinds import Detector
from tetlux.fem.outcome.plan import Plan, cheapest
from tetlux.fem.planner.charges import charges_candidate
from tetlux.fem.planner.closed_form import closed_form_candidate
from tetlux.fem.planner.full import full_candidate
from tetlux.fem.planner.request import Request, make_request
from tetlux.fem.planner.truncated import truncated_candidate
from tetlux.fem.scenes import media_by_channel
from tetlux.fem.sources.light import Light
from tetlux.fem.validity.beforehand import expected_model_error
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# A part is cut out where that takes less than this share of the seconds of the whole body.
LARGEST_SHARE_OF_FULL = 0.7


def plan(
    body: Surface | TetMesh,
    medium: AnyMedium | GivenMedia | Sequence[AnyMedium | GivenMedia],
    lights: Sequence[Light],
    *,
    regions: Sequence[Region] = (),
    tolerance: float | None = DEFAULT_TOLERANCE,
    detectors: Sequence[Detector] = (),
    detector_tolerance: float | None = None,
    everywhere_tolerance: float | None = None,
    volume_tolerance: float | None = None,
    mesh: TetMesh | None = None,
    frequency: float = 0.0,
    outside_index: float = 1.0,
) -> Plan:
    """Say how ``solve(..., model="auto")`` would solve a scene, and why, without solving it.

    Of the models that can give what is asked for within the tolerance, the fastest is chosen. Seconds and memory are
    predictions.

    Parameters
    ----------
    body, medium, lights, regions, detectors, mesh, frequency, outside_index
        As for `tetlux.fem.solve`.
    tolerance, detector_tolerance, everywhere_tolerance, volume_tolerance
        As for `tetlux.fem.solve`.

    Returns
    -------
    Plan
        Print it for at most six lines.

    Raises
    ------
    InputError
        As `tetlux.fem.solve`.

    Examples
    --------
    >>> from tetlux.fem import DiffuseLight, Medium, plan
    >>> from tetlux.meshing import torus
    >>> tissue = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> found = plan(torus(10.0, 4.0), tissue, [DiffuseLight(1.0)], everywhere_tolerance=0.05)
    >>> found.chosen, found["charges"].reason
    ('full', 'charges tell no errors of single places')
    """
    wanted = Tolerances(tolerance, detector_tolerance, (), everywhere_tolerance, volume_tolerance)
    channels, _ = media_by_channel(body, mesh, medium)
    scenes = [lights] * len(channels)
    request = make_request(
        body,
        channels,
        scenes,
        regions=regions,
        tolerances=wanted,
        detectors=detectors,
        mesh=mesh,
        frequency=frequency,
        outside_index=outside_index,
    )
    return plan_of(request)


def plan_of(request: Request) -> Plan:
    """The plan of a request that was checked."""
    full, truncated = full_candidate(request), truncated_candidate(request)
    if truncated.suits and full.suits and truncated.seconds > LARGEST_SHARE_OF_FULL * full.seconds:
        truncated = replace(truncated, suits=False, reason=f"{truncated.reason}, which saves too little")
    candidates = (closed_form_candidate(request), charges_candidate(request), truncated, full)
    errors = [
        expected_model_error(body, deposits) for body, deposits in zip(request.bodies, request.deposits, strict=True)
    ]
    return Plan(
        cheapest(candidates),
        candidates,
        request.tolerances.exitance,
        max(each.near for each in errors),
        max(each.elsewhere for each in errors),
        request.runs,
    )
