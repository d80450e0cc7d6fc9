"""`summary.json`: what a run found, in figures."""

import math
import platform
from typing import Any

import numpy as np

from tetlux.cases.file.case import Channel
from tetlux.cases.write.media_rows import media_rows
from tetlux.cases.write.ran import as_ran
from tetlux.cases.write.results import Results, lights_in
from tetlux.fem.outcome.solution import Power, Solution
from tetlux.fem.validity.local import Validity
from tetlux.fem.validity.notes import NEAR, THIN
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.host.libraries import installed_versions
from tetlux.meshing.mesher.deviation import surface_deviation
from tetlux.meshing.tets.mesh import TetMesh

LIBRARIES = ("tetlux", "numpy", "scipy", "scikit-fem", "pyamg", "pytetwild", "embreex", "pyvista", "trimesh")


def summarize(
    results: Results, readings: list[dict[str, Any]], seconds: dict[str, float], warnings: list[str]
) -> dict[str, Any]:
    """The summary of a run as plain data; lengths in the case's unit, power in W; exitance as it is written."""
    case, mesh = results.case, results.solutions[0].mesh
    several = len(case.light_names) > 1
    channels = [
        _channel(
            channel,
            solution,
            results.exitance(channel.name),
            several,
            media,
        )
        for channel, solution, media in zip(case.channels, results.solutions, media_rows(case, mesh), strict=True)
    ]
    return {
        "case": case.name,
        "unit": case.surface.unit,
        "model": "fem",
        "tolerance": case.tolerance,
        "as_ran": as_ran(case),
        "mesh": {
            "nodes": len(mesh.points),
            "tetrahedra": len(mesh.tetrahedra),
            "volume": mesh.volume,
            "area": mesh.area,
            "surface_deviation": surface_deviation(mesh, case.surface),
            "min_quality": float(mesh.quality.min()),
            **({"labels": _labels(case.mesh)} if case.mesh else {}),
        },
        "channels": channels,
        **({"preview_white": results.preview[1]} if results.has_colours else {}),
        **({"detectors": readings} if readings else {}),
        "seconds": {stage: round(value, 4) for stage, value in seconds.items()},
        "repairs": list(case.repairs),
        "warnings": warnings,
        "versions": {"python": platform.python_version(), **installed_versions(LIBRARIES)},
    }


def _channel(
    channel: Channel, solution: Solution, exitance: FloatArray, several: bool, media: list[dict[str, Any]]
) -> dict[str, Any]:
    estimate = solution.error_estimate
    figures: dict[str, Any] = {
        "name": channel.name,
        # Those of the body outside of its regions.
        "sigma_tr": media[0]["sigma_tr"],
        "albedo": media[0]["albedo"],
        "media": media,
        "power": _power(solution.power),
        "exitance": {
            "min": float(exitance.min()),
            "max": float(exitance.max()),
            "mean": solution.power.exited / solution.mesh.area,
        },
        "fluence": {"min": float(solution.fluence.min()), "max": float(solution.fluence.max())},
        "error_estimate": estimate if math.isfinite(estimate) else None,
        **({"validity": _validity(solution.validity)} if solution.validity else {}),
    }
    if several:
        lights = lights_in(list(channel.lights), solution)
        figures["lights"] = [{"name": name, "power": _power(one.power)} for name, one in lights]
    return figures


def _labels(mesh: TetMesh) -> list[dict[str, Any]]:
    """Labels of a mesh that was given, their names if they have any, and their volumes."""
    volumes = mesh.region_volumes.items()
    return [{"label": label, "name": mesh.labels.get(label), "volume": volume} for label, volume in volumes]


def _power(power: Power) -> dict[str, float]:
    return {
        "incident": power.incident,
        "specular": power.specular,
        "absorbed": power.absorbed,
        "exited": power.exited,
        "ballistic": power.ballistic,
        "balance_error": power.balance_error,
    }


def _validity(validity: Validity) -> dict[str, float]:
    """How far diffusion itself is to be trusted; means and shares are of the surface's area."""
    valid = np.maximum(1.0 - validity.of_facets, 0.0)
    return {
        "albedo": validity.albedo,
        "least_thickness_in_mean_free_paths": float(validity.thickness.min()),
        "share_thin": validity.mean(validity.thickness < THIN),
        "share_near_light": validity.mean(validity.distances(validity.middles) < NEAR),
        "mean_valid": validity.mean(valid),
        "least_valid": float(valid.min()),
    }
