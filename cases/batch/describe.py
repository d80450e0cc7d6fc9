"""What a plan amounts to, in words: for ``tetlux check``."""

import json
from collections.abc import Sequence
from dataclasses import asdict

from tetlux.cases.batch.plan import Plan
from tetlux.cases.file.case import Case
from tetlux.meshing.describe import count
from tetlux.meshing.host.blocks import CORES

# CPU seconds, measured on surfaces of 5,000 to 10,000 triangles at tolerances of .02 to .1: to start; for a mesh that
# is not in the cache; for each channel of a run with a mesh of its own, or of one that starts from a shared mesh; for a
# picture; for each channel of a fit of ten readings.
TO_START, PER_MESH, PER_OWN_RUN, PER_SHARED_RUN, PER_PICTURE, PER_FIT = 2.0, 2.0, 1.5, 0.2, 3.0, 15.0


def describe_plan(plan: Plan, cases: Sequence[Case]) -> str:
    """One line: how many runs, surfaces, meshes, systems and right-hand sides, and about how long.

    The seconds are a guess, right to a factor of three where tolerances are moderate: how fine a mesh has to be shows
    only when it is solved on.
    """
    own = sum(mesh.runs for mesh in plan.meshes if not mesh.pilots)
    meshes = own + sum(1 for mesh in plan.meshes if mesh.pilots)
    parts = [
        count(len(plan.names), "run"),
        count(len(plan.surfaces), "surface"),
        count(meshes, "mesh", "meshes"),
        count(plan.systems, "system"),
        count(plan.right_hand_sides, "right-hand side"),
    ]
    return f"{', '.join(parts)}; about {_in_words(_seconds(plan, cases))} on {count(CORES, 'core')}"


def print_plan(plan: Plan) -> None:
    """Print a plan as JSON."""
    print(json.dumps(asdict(plan), indent=1))


def _seconds(plan: Plan, cases: Sequence[Case]) -> float:
    shared = {mesh.number for mesh in plan.meshes if mesh.pilots}
    total = PER_MESH * len(plan.surfaces)
    for task in plan.tasks:
        each = PER_SHARED_RUN if task.mesh in shared else PER_OWN_RUN
        for run in task.runs:
            of_channel = each + PER_FIT * (cases[run].fit is not None)
            total += of_channel * len(cases[run].channels) + PER_PICTURE * ("picture" in cases[run].outputs)
    return TO_START + total / min(CORES, len(plan.names))


def _in_words(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"
