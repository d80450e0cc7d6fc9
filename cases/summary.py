"""`summary.json`: what a run found, in figures."""

import math
import platform
from collections.abc import Mapping
from typing import Any

import numpy as np

from tetlux.cases.case import Channel
from tetlux.cases.lighting import BODY
from tetlux.cases.results import Results, lights_in
from tetlux.fem.coefficients import Coefficients, MediaByLabel, at_cells, by_label, coefficients_on
from tetlux.fem.local_validity import Validity
from tetlux.fem.scene import media_of
from tetlux.fem.solution import Power, Solution
from tetlux.fem.validity import NEAR, THIN
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.deviation import surface_deviation
from tetlux.meshing.libraries import installed_versions
from tetlux.meshing.tetmesh import TetMesh

LIBRARIES = ("tetlux", "numpy", "scipy", "scikit-fem", "pyamg", "pytetwild", "embreex", "pyvista", "trimesh")


def summarize(
    results: Results, readings: list[dict[str, Any]], seconds: dict[str, float], warnings: list[str]
) -> dict[str, Any]:
    """The summary of a run as plain data; lengths in the case's unit, power in W; exitance as it is written."""
    case, mesh = results.case, results.solutions[0].mesh
    several = len(case.light_names) > 1
    if case.mesh is not None:
        media: list[MediaByLabel] = [channel.media for channel in case.channels if isinstance(channel.media, Mapping)]
        names = {label: case.mesh.labels.get(label, str(label)) for label in media[0]}
    else:
        media = [
            by_label(each) for each in media_of([c.medium for c in case.channels], case.regions, len(case.channels))
        ]
        names = dict(enumerate((BODY, *(region.surface.name for region in case.regions))))
    channels = [
        _channel(
            channel,
            solution,
            results.exitance(channel.name),
            several,
            _media(mesh, coefficients_on(mesh, each), names),
        )
        for channel, solution, each in zip(case.channels, results.solutions, media, strict=True)
    ]
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


def _media(mesh: TetMesh, coefficients: Coefficients, names: Mapping[int, str]) -> list[dict[str, Any]]:
    """Coefficients of the body outside of its regions and of each region; means over the volume where they vary."""
    found = []
    for region, name in names.items():
        cells = np.flatnonzero(mesh.regions == region)
        sigma_a, total = (
            _mean(at_cells(each, cells), mesh.volumes[cells])
            for each in (coefficients.sigma_a, coefficients.sigma_t_prime)
        )
        found.append(
            {
                "name": name,
                "sigma_a": sigma_a,
                "sigma_s_prime": total - sigma_a,
                "sigma_tr": math.sqrt(3.0 * sigma_a * total),
                "albedo": 1.0 - sigma_a / total,
            }
        )
    return found


def _mean(values: FloatArray, weights: FloatArray) -> float:
    """Weighted mean, without rounding where all values are alike."""
    return float(values[0] if np.ptp(values) == 0 else weights @ values / weights.sum())


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
