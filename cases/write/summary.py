"""``summary.json``: the figures of a run."""

import math
import platform
from typing import Any

import numpy as np

from tetlux.cases.file.case import Case, Channel
from tetlux.cases.plain import finite
from tetlux.cases.write.media_rows import media_rows
from tetlux.cases.write.plan_record import describe_plan
from tetlux.cases.write.results import Results, solutions_by_light
from tetlux.cases.write.run_record import describe_run
from tetlux.fem.meshless import ChargeSolution, ClosedFormSolution
from tetlux.fem.models.modulation import lag, modulus
from tetlux.fem.outcome.power import Power
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.planner.solve import AnySolution
from tetlux.fem.truncated import TruncatedSolution
from tetlux.fem.validity.local import Validity
from tetlux.fem.validity.notes import NEAR, THIN
from tetlux.meshing.arrays import FloatArray, Number
from tetlux.meshing.host.libraries import installed_versions
from tetlux.meshing.mesher.deviation import surface_deviation
from tetlux.meshing.notes import Note
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# Tolerances beside that of the exitance, by their name in a case.
MORE_TOLERANCES = ("detector_tolerance", "everywhere_tolerance", "volume_tolerance")
# Finite elements on the whole body have a name of their own in summaries.
MODEL_NAMES = {"full": "fem"}
# What becomes of the power that a dye takes from steady light.
DYE_LEDGER = ("absorbed", "lost", "emitted")
LIBRARIES = ("tetlux", "numpy", "scipy", "scikit-fem", "pyamg", "pytetwild", "embreex", "pyvista", "trimesh")


def summarize(results: Results, readings: list[dict[str, Any]], warnings: list[str]) -> dict[str, Any]:
    """Summarize a run as plain data, but for its seconds.

    Parameters
    ----------
    results : Results
    readings : list of dict
        Rows of the detectors.
    warnings : list of str

    Returns
    -------
    dict
        Lengths in the case's unit, power in W, exitance in W/unit² at the vertices that are written.
    """
    case = results.case
    mesh = results.mesh_solutions[0].mesh if results.mesh_solutions else None
    several, plan = len(case.light_names) > 1, results.solutions[0].plan
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
        "model": MODEL_NAMES.get(results.solutions[0].model, results.solutions[0].model),
        "tolerance": case.tolerance,
        **{name: getattr(case, name) for name in MORE_TOLERANCES if getattr(case, name) is not None},
        "as_ran": describe_run(case),
        **({"plan": describe_plan(plan, results.solutions)} if plan else {}),
        **(
            {"mesh": _mesh(case, mesh, _meshed_surface(results.mesh_solutions[0]))}
            if mesh
            else {"left_out": _left_out(results.solutions[0].model)}
        ),
        **({"fit": results.fit.summary()} if results.fit else {}),
        "channels": channels,
        **({"preview_white": results.preview[1]} if results.has_colours else {}),
        **({"detectors": readings} if readings else {}),
        "repairs": list(case.repairs),
        "warnings": warnings,
        "warning_codes": sorted({note.code if isinstance(note, Note) else "other" for note in warnings}),
        "versions": {"python": platform.python_version(), **installed_versions(LIBRARIES)},
    }


def _left_out(model: str) -> dict[str, str]:
    """Why a run without a mesh lacks what other runs have."""
    instead = "write model: full"
    return {
        "mesh": f"model {model} makes none; {instead}",
        "fluence": f"it has no largest value at points, whose fluence model {model} does not spread over a mesh",
        "validity": f"it is computed on a mesh; {instead}",
    }


def _meshed_surface(solution: Solution) -> Surface:
    """The surface that the mesh stands for: of the whole body, or of a part."""
    return solution.meshed_surface if isinstance(solution, TruncatedSolution) else solution.surface


def _mesh(case: Case, mesh: TetMesh, surface: Surface) -> dict[str, Any]:
    return {
        "nodes": len(mesh.points),
        "tetrahedra": len(mesh.tetrahedra),
        "volume": mesh.volume,
        "area": mesh.area,
        "surface_deviation": surface_deviation(mesh, surface),
        "min_quality": float(mesh.quality.min()),
        **({"labels": _labels(case.mesh)} if case.mesh else {}),
    }


def _channel(
    channel: Channel, solution: AnySolution, exitance: FloatArray, several: bool, media: list[dict[str, Any]]
) -> dict[str, Any]:
    area = solution.mesh.area if isinstance(solution, Solution) else solution.area
    figures: dict[str, Any] = {
        "name": channel.name,
        **({"frequency": channel.frequency} if channel.frequency else {}),
        # The first medium is that of the body outside of its regions.
        "sigma_tr": media[0]["sigma_tr"],
        "albedo": media[0]["albedo"],
        "media": media,
        "power": _power(solution.power),
        **({"power_phase": _phases(solution.power)} if channel.frequency else {}),
        "exitance": {
            "min": float(exitance.min()),
            "max": float(exitance.max()),
            "mean": _size(solution.power.exited) / area,
        },
        "error_estimate": finite(solution.error_estimate),
        **_figures_of_model(solution),
        **_dyes(solution),
    }
    if several:
        lights = solutions_by_light(list(channel.lights), solution)
        figures["lights"] = [{"name": name, "power": _power(part.power)} for name, part in lights]
    return figures


def _figures_of_model(solution: AnySolution) -> dict[str, Any]:
    """The figures that only one of the models has."""
    if isinstance(solution, ClosedFormSolution):
        return {"closed_form": {"name": solution.exact.name, "bound": finite(solution.error_bound)}}
    if isinstance(solution, ChargeSolution):
        # The fluence has a pole at each source, so there is no largest value.
        return {"charges": {"count": solution.charges, "bound": finite(solution.error_bound)}}
    of_fields = {"everywhere_error": solution.everywhere_error, "volume_error": solution.volume_error}
    fluence = modulus(solution.fluence)
    return {
        "fluence": {"min": float(fluence.min()), "max": float(fluence.max())},
        **{name: value for name, value in of_fields.items() if math.isfinite(value)},
        **({"validity": _validity(solution.validity)} if solution.validity else {}),
    }


def _labels(mesh: TetMesh) -> list[dict[str, Any]]:
    """The labels of a mesh that the case gives, with their names and volumes."""
    volumes = mesh.region_volumes.items()
    return [{"label": label, "name": mesh.labels.get(label), "volume": volume} for label, volume in volumes]


def _dyes(solution: AnySolution) -> dict[str, list[dict[str, float]]]:
    """The ledger of each dye that emits the light of a channel, in the order of the case; of modulated light moduli."""
    dyes = solution.dyes if isinstance(solution, Solution) else ()
    names = ("absorbed", "lost", "emitted", "stored") if any(dye.stored for dye in dyes) else DYE_LEDGER
    return {"dyes": [{name: _size(getattr(dye, name)) for name in names} for dye in dyes]} if dyes else {}


def _size(value: Number) -> Number:
    """A power as it is, or the modulus of a complex one."""
    return abs(value) if isinstance(value, complex) else value


def _power(power: Power) -> dict[str, float]:
    """The ledger; of modulated light moduli, and with what is stored."""
    names = ["incident", "specular", "absorbed", "exited", "ballistic"]
    names += ["stored"] if isinstance(power.exited, complex) else []
    return {name: _size(getattr(power, name)) for name in (*names, "balance_error")}


def _phases(power: Power) -> dict[str, float]:
    """How far powers of modulated light lag, degrees."""
    return {name: float(lag(np.asarray(getattr(power, name)))) for name in ("absorbed", "exited", "stored")}


def _validity(validity: Validity) -> dict[str, float]:
    """The validity of the diffusion approximation; means and shares are by surface area."""
    valid = np.maximum(1.0 - validity.facet_errors, 0.0)
    return {
        "albedo": validity.albedo,
        "least_thickness_in_mean_free_paths": float(validity.thickness.min()),
        "share_thin": validity.mean(validity.thickness < THIN),
        "share_near_light": validity.mean(validity.facet_distances < NEAR),
        "mean_valid": validity.mean(valid),
        "least_valid": float(valid.min()),
    }
