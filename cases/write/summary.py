"""`summary.json`: what a run found, in figures."""

import math
import platform
from typing import Any

import numpy as np

from tetlux.cases.file.case import Case, Channel
from tetlux.cases.write.media_rows import media_rows
from tetlux.cases.write.ran import as_ran
from tetlux.cases.write.results import AnySolution, Results, lights_in
from tetlux.fem.meshless import ChargeSolution
from tetlux.fem.outcome.solution import Power
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
    case = results.case
    mesh = results.with_mesh[0].mesh if results.with_mesh else None
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
        "model": "fem" if mesh else "charges",
        "tolerance": case.tolerance,
        "as_ran": as_ran(case),
        **({"mesh": _mesh(case, mesh)} if mesh else {}),
        "channels": channels,
        **({"preview_white": results.preview[1]} if results.has_colours else {}),
        **({"detectors": readings} if readings else {}),
        "seconds": {stage: round(value, 4) for stage, value in seconds.items()},
        "repairs": list(case.repairs),
        "warnings": warnings,
        "versions": {"python": platform.python_version(), **installed_versions(LIBRARIES)},
    }


def _mesh(case: Case, mesh: TetMesh) -> dict[str, Any]:
    return {
        "nodes": len(mesh.points),
        "tetrahedra": len(mesh.tetrahedra),
        "volume": mesh.volume,
        "area": mesh.area,
        "surface_deviation": surface_deviation(mesh, case.surface),
        "min_quality": float(mesh.quality.min()),
        **({"labels": _labels(case.mesh)} if case.mesh else {}),
    }


def _channel(
    channel: Channel, solution: AnySolution, exitance: FloatArray, several: bool, media: list[dict[str, Any]]
) -> dict[str, Any]:
    area = solution.area if isinstance(solution, ChargeSolution) else solution.mesh.area
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
            "mean": solution.power.exited / area,
        },
        "error_estimate": _finite(solution.error_estimate),
        **_of_model(solution),
    }
    if several:
        lights = lights_in(list(channel.lights), solution)
        figures["lights"] = [{"name": name, "power": _power(one.power)} for name, one in lights]
    return figures


def _of_model(solution: AnySolution) -> dict[str, Any]:
    """Figures that only one of the models has."""
    if isinstance(solution, ChargeSolution):
        # Fluence has a pole at each source, and no largest value.
        return {"charges": {"count": solution.charges, "bound": _finite(solution.error_bound)}}
    return {
        "fluence": {"min": float(solution.fluence.min()), "max": float(solution.fluence.max())},
        **({"validity": _validity(solution.validity)} if solution.validity else {}),
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


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
