"""`summary.json`: what a run found, in figures."""

import math
import platform
from importlib.metadata import version
from typing import Any

from tetlux.cases.case import Case
from tetlux.fem.solution import Solution
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.deviation import surface_deviation

LIBRARIES = ("tetlux", "numpy", "scipy", "scikit-fem", "pyamg", "pytetwild", "pyvista", "trimesh")


def summarize(
    case: Case, solution: Solution, exitance: FloatArray, seconds: dict[str, float], warnings: list[str]
) -> dict[str, Any]:
    """The summary of a run as plain data; lengths in the case's unit, power in W; exitance as it is written."""
    mesh, power = solution.mesh, solution.power
    estimate = solution.error_estimate
    return {
        "case": case.name,
        "unit": case.surface.unit,
        "model": "fem",
        "tolerance": case.tolerance,
        "mesh": {
            "nodes": len(mesh.points),
            "tetrahedra": len(mesh.tetrahedra),
            "volume": mesh.volume,
            "area": mesh.area,
            "surface_deviation": surface_deviation(mesh, case.surface),
            "min_quality": float(mesh.quality.min()),
        },
        "channels": [
            {
                "name": "all",
                "sigma_tr": case.medium.sigma_tr,
                "albedo": case.medium.albedo,
                "power": {
                    "incident": power.incident,
                    "specular": power.specular,
                    "absorbed": power.absorbed,
                    "exited": power.exited,
                    "ballistic": power.ballistic,
                    "balance_error": power.balance_error,
                },
                "exitance": {
                    "min": float(exitance.min()),
                    "max": float(exitance.max()),
                    "mean": power.exited / mesh.area,
                },
                "fluence": {"min": float(solution.fluence.min()), "max": float(solution.fluence.max())},
                "error_estimate": estimate if math.isfinite(estimate) else None,
            }
        ],
        "seconds": {stage: round(value, 4) for stage, value in seconds.items()},
        "repairs": list(case.surface.repairs),
        "warnings": warnings,
        "versions": {"python": platform.python_version(), **{name: version(name) for name in LIBRARIES}},
    }
