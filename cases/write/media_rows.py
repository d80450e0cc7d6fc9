"""Coefficients of each medium of a run, as rows of its summary."""

import math
from typing import Any

import numpy as np

from tetlux.cases.file.case import Case
from tetlux.cases.file.light_names import BODY
from tetlux.fem.media.coefficients import (
    AnyMedium,
    Coefficients,
    MediaByLabel,
    at_cells,
    base_of,
    by_label,
    coefficients_on,
)
from tetlux.fem.media.varying import VaryingMedium
from tetlux.fem.scenes import media_by_scene
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.tets.mesh import TetMesh


def media_rows(case: Case, mesh: TetMesh | None) -> list[list[dict[str, Any]]]:
    """List the coefficients of the body and of each region, or of each label, for each channel.

    Parameters
    ----------
    case : Case
    mesh : TetMesh or None
        The mesh that the case was solved on; None by charges, where media are uniform.

    Returns
    -------
    list of list of dict
        For each channel a row for each medium: coefficients in 1/unit, lengths in unit; where they vary, means over
        the volume.
    """
    names = dict(enumerate((BODY, *(region.surface.name for region in case.regions))))
    if case.mesh is not None:
        names = {label: case.mesh.labels.get(label, str(label)) for label in case.mesh.region_volumes}
    channels = []
    for media in _media_by_label(case):
        rows = {region: {"name": names[region], **coefficients(medium)} for region, medium in media.items()}
        if mesh is not None:
            on_mesh = coefficients_on(mesh, media)
            for region in [region for region, medium in media.items() if isinstance(medium, VaryingMedium)]:
                rows[region] |= _means(mesh, on_mesh, region)
        channels.append(list(rows.values()))
    return channels


def _media_by_label(case: Case) -> list[MediaByLabel]:
    if case.mesh is not None:
        return [channel.media for channel in case.channels if not isinstance(channel.media, AnyMedium)]
    media = [channel.medium for channel in case.channels]
    return [by_label(each) for each in media_by_scene(media, case.regions, len(media))]


def _means(mesh: TetMesh, on_mesh: Coefficients, region: int) -> dict[str, float]:
    """Mean coefficients over the volume of a region whose medium varies."""
    cells: IntArray = np.flatnonzero(mesh.regions == region)
    sigma_a, total = (
        _mean(at_cells(each, cells), mesh.volumes[cells]) for each in (on_mesh.sigma_a, on_mesh.sigma_t_prime)
    )
    return {
        "sigma_a": sigma_a,
        "sigma_s_prime": total - sigma_a,
        "albedo": 1.0 - sigma_a / total,
        "sigma_tr": math.sqrt(3.0 * sigma_a * total),
        "mean_free_path": 1.0 / total,
    }


def coefficients(medium: AnyMedium) -> dict[str, Any]:
    """The coefficients of a medium; of one that varies, those of its base."""
    base = base_of(medium)
    figures: dict[str, Any] = {
        "sigma_a": base.sigma_a,
        "sigma_s_prime": base.reduced_scattering,
        "eta": base.eta,
        "boundary": base.boundary,
        "albedo": base.albedo,
        "sigma_tr": base.sigma_tr,
        "mean_free_path": base.mean_free_path,
    }
    if base.sigma_s is not None:
        figures |= {"sigma_s": base.sigma_s, "g": base.mean_cosine}
    if isinstance(medium, VaryingMedium):
        figures["varies"] = [name for name in ("sigma_a", "sigma_s_prime") if getattr(medium, name) is not None]
    return figures


def _mean(values: FloatArray, weights: FloatArray) -> float:
    """Weighted mean, exact where all values are equal."""
    return float(values[0] if np.ptp(values) == 0 else weights @ values / weights.sum())
