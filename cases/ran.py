"""The case as it ran, as plain data: what a summary repeats, so that a run can be understood and repeated."""

import os
from pathlib import Path
from typing import Any

from tetlux.cases.case import Case
from tetlux.cases.lighting import BODY
from tetlux.fem.coefficients import AnyMedium, base_of
from tetlux.fem.varying import VaryingMedium

# Keys whose values are paths, relative to the case file.
PATHS = ("file", "files")


def as_ran(case: Case) -> dict[str, Any]:
    """A case with all that was left to defaults, and the coefficients that follow from it.

    Parameters
    ----------
    case : Case

    Returns
    -------
    dict
        ``source``, the path of the case file; ``sweep``, the values of this run; ``scene``, a case file of this run
        alone, with full paths, which can be run as it is; ``media``, a row for each channel and region.
    """
    return {
        "source": os.path.abspath(case.source),  # noqa: PTH100
        "sweep": dict(case.swept),
        "scene": scene_of(case),
        "media": media_of(case),
    }


def scene_of(case: Case) -> dict[str, Any]:
    """The case file of this run alone: names and defaults written out, paths in full."""
    scene: dict[str, Any] = case.spec.model_dump(mode="json", exclude_none=True)
    names = {"lights": case.light_names, "regions": tuple(region.surface.name for region in case.regions)}
    for section, given in names.items():
        for entry, name in zip(scene[section], given, strict=True):
            entry["name"] = name
    if len(case.channels) > 1:
        scene["channels"] = list(case.channel_names)
    _write_paths_in_full(scene, case.source.parent)
    return scene


def _write_paths_in_full(value: object, folder: Path) -> None:
    if isinstance(value, dict):
        for key, one in value.items():
            if key in PATHS and isinstance(one, str):
                value[key] = os.path.abspath(folder / one)  # noqa: PTH100
            else:
                _write_paths_in_full(one, folder)
    elif isinstance(value, list):
        for one in value:
            _write_paths_in_full(one, folder)


def media_of(case: Case) -> list[dict[str, Any]]:
    """Coefficients of each channel and region in 1/unit, lengths in unit."""
    rows = []
    for i, channel in enumerate(case.channels):
        rows.append({"channel": channel.name, "region": BODY, **coefficients(channel.medium)})
        for region in case.regions:
            inner = region.medium if isinstance(region.medium, AnyMedium) else region.medium[i]
            rows.append({"channel": channel.name, "region": region.surface.name, **coefficients(inner)})
    return rows


def coefficients(medium: AnyMedium) -> dict[str, Any]:
    """What is known of a medium; of one that varies, means over the surface's vertices."""
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
