"""``sensitivity.npz``: derivatives of what detectors read to the coefficients at each node, and path lengths."""

from pathlib import Path
from typing import Any

import numpy as np

from tetlux.cases.file.case import Case, Channel
from tetlux.cases.file.channels import ALL
from tetlux.cases.file.light_names import BODY
from tetlux.cases.plain import finite
from tetlux.cases.write.results import Results
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.region import Region
from tetlux.fem.models.modulation import shift_of_frequency
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.sensitivity.sensitivity import COEFFICIENTS, Sensitivity, sensitivity
from tetlux.fem.system import System
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.mesh import TetMesh


class Sensitivities:
    """Those of all channels, lights and detectors, on the mesh of a run.

    Parameters
    ----------
    results : Results
        By finite elements, with detectors.
    """

    def __init__(self, results: Results) -> None:
        self.case = results.case
        self.mesh = results.mesh_solutions[0].mesh
        self.found = [
            _of_channel(self.case, channel, number, solution)
            for number, (channel, solution) in enumerate(zip(self.case.channels, results.mesh_solutions, strict=True))
        ]

    def write(self, path: Path) -> None:
        """Write derivatives (l, d, n) of each channel, in single precision, and what they belong to."""
        case, several = self.case, len(self.case.channels) > 1
        arrays: dict[str, Any] = {
            "points": self.mesh.points,
            "detectors": np.array([entry.name for entry in case.detectors]),
            "channels": np.array(case.channel_names),
            "media": np.array(self._media()),
        }
        for channel, found in zip(case.channels, self.found, strict=True):
            suffix = f"_{channel.name}" if several else ""
            arrays |= {f"{name}{suffix}": values for name, values in found.derivatives.items()}
            arrays[f"readings{suffix}"], arrays[f"path_lengths{suffix}"] = found.readings, found.path_lengths
            arrays[f"lights{suffix}"] = np.array(list(channel.lights))
        np.savez_compressed(path, **arrays)

    def fields(self) -> dict[str, FloatArray]:
        """Derivatives by volume of readings of all lights, at the nodes; of modulated light those of amplitudes."""
        volumes, fields = _node_volumes(self.mesh), {}
        several = len(self.case.channels) > 1
        for channel, found in zip(self.case.channels, self.found, strict=True):
            readings = found.readings.sum(axis=0)
            for coefficient in COEFFICIENTS:
                rows = _of_amplitudes(found.derivatives[coefficient].sum(axis=0), readings)
                for entry, row in zip(self.case.detectors, rows, strict=True):
                    parts = ["sensitivity", coefficient, entry.name, *([channel.name] if several else [])]
                    fields["_".join(parts)] = np.asarray(row / volumes)
        return fields

    def add_path_lengths(self, rows: list[dict[str, Any]]) -> None:
        """Add mean partial path lengths, unit, by medium to rows of detectors."""
        detectors = [entry.name for entry in self.case.detectors]
        for row in rows:
            number = self.case.channel_names.index(row["channel"])
            lights, found = list(self.case.channels[number].lights), self.found[number]
            chosen = slice(None) if row["light"] == ALL else [lights.index(row["light"])]
            place = detectors.index(row["name"])
            readings = found.readings[chosen, place]
            lengths = (readings @ found.path_lengths[chosen, place]) / readings.sum()
            values = [finite(value) for value in np.real(lengths).tolist()]
            row["path_lengths"] = dict(zip(self._media(), values, strict=True))

    def _media(self) -> list[str]:
        """Names of the media, in the order of path lengths."""
        names = dict(enumerate((BODY, *(region.surface.name for region in self.case.regions))))
        if self.case.mesh is not None:
            names = {label: self.case.mesh.labels.get(label, str(label)) for label in self.case.mesh.region_volumes}
        return [names[label] for label in self.found[0].labels]

    __repr__ = one_line


def _of_channel(case: Case, channel: Channel, number: int, solution: Solution) -> Sensitivity:
    """Sensitivities of a channel, on the mesh of its solution."""
    regions = tuple(
        Region(region.surface, region.medium if isinstance(region.medium, AnyMedium) else region.medium[number])
        for region in case.regions
    )
    shift = 0j
    if channel.frequency:
        shift = shift_of_frequency(channel.frequency, solution.medium, case.surface.unit, case.outside_index)
    surface = None if case.mesh is not None else case.surface
    system = System(
        solution.mesh,
        channel.media,
        surface,
        expected=len(channel.lights) + len(case.detectors),
        regions=regions,
        shift=shift if channel.frequency else 0.0,
    )
    detectors = [entry.detector for entry in case.detectors]
    return sensitivity(system, list(channel.lights.values()), detectors, dtype=np.float32)


def _of_amplitudes(derivatives: NumberArray, readings: NumberArray) -> FloatArray:
    """Derivatives (d, n) of the moduli of readings (d,)."""
    if not np.iscomplexobj(derivatives):
        return derivatives
    return np.asarray(np.real(derivatives * np.conj(readings / np.abs(readings))[:, None]))


def _node_volumes(mesh: TetMesh) -> FloatArray:
    """A quarter of the volumes of the tetrahedra around each node, (n,), unit³."""
    shares = np.repeat(0.25 * mesh.volumes, 4)
    sums = np.bincount(mesh.tetrahedra.ravel(), weights=shares, minlength=len(mesh.points))
    return np.asarray(sums, dtype=float)
