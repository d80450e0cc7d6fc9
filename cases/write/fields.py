"""Fields of a run: what is known at the vertices of the written surface, and at the nodes of the mesh."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tetlux.cases.file.channels import ALL
from tetlux.cases.file.colours import RGB
from tetlux.cases.write.results import Results
from tetlux.fem.outcome.radiance import radiance_of, view_cosine
from tetlux.meshing.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Field:
    """A quantity of a channel and a light, or of all channels or lights together.

    Attributes
    ----------
    quantity : str
        Such as exitance.
    values : (v,) ndarray
    unit : str
        Empty if the quantity has none.
    channel, light : str
    logarithmic : bool
        Whether pictures map the logarithm of the values to colours.
    """

    quantity: str
    values: FloatArray
    unit: str = ""
    channel: str = ALL
    light: str = ALL
    logarithmic: bool = True

    @property
    def name(self) -> str:
        """The name of its array in files."""
        return "_".join([self.quantity, *(each for each in (self.light, self.channel) if each != ALL)])


def surface_fields(results: Results) -> list[Field]:
    """The fields at the vertices of the surface, exitance of all channels and lights first."""
    case = results.case
    unit = f"W/{case.surface.unit}²"
    fields = [
        Field("exitance", results.exitance(channel, light), unit, channel, light)
        for light in _with_all(case.light_names)
        for channel in _with_all(case.channel_names)
    ]
    # Sums come before their parts.
    fields.sort(key=lambda field: (field.light != ALL) + (ALL not in (field.light, field.channel)))
    if results.mesh_solutions:
        # The least over channels. It is computed on the facets of a mesh.
        valid = np.min([solution.valid_on(results.surface.points) for solution in results.mesh_solutions], axis=0)
        fields.append(Field("valid", valid, logarithmic=False))
    if case.camera is not None:
        fields += _radiances(results, np.asarray(case.camera))
    return fields


def _with_all(names: tuple[str, ...]) -> tuple[str, ...]:
    return (ALL, *names) if len(names) > 1 else (ALL,)


def _radiances(results: Results, camera: FloatArray) -> list[Field]:
    """The radiance of each channel toward the camera, after their sum."""
    case = results.case
    unit = f"W/({case.surface.unit}² sr)"
    _, cosine = view_cosine(case.surface, results.surface.points, camera)
    parts = [
        Field("radiance", radiance_of(results.exitance(name), cosine, solution.medium.eta), unit, name)
        for name, solution in zip(case.channel_names, results.solutions, strict=True)
    ]
    whole = Field("radiance", np.asarray(np.sum([part.values for part in parts], axis=0)), unit)
    return [whole, *(parts if len(parts) > 1 else [])]


def surface_values(results: Results) -> dict[str, npt.NDArray[np.generic]]:
    """The arrays of ``surface.ply`` and ``surface.vtp`` at the vertices."""
    values: dict[str, npt.NDArray[np.generic]] = {field.name: field.values for field in surface_fields(results)}
    if results.has_colours:
        values |= dict(zip(RGB, results.preview[0].T, strict=True))
    return values


def volume_fields(results: Results) -> list[Field]:
    """The fluence of each channel at the nodes of the mesh."""
    unit = f"W/{results.case.surface.unit}²"
    if len(results.mesh_solutions) == 1:
        return [Field("fluence", results.mesh_solutions[0].fluence, unit)]
    return [
        Field("fluence", solution.fluence, unit, name)
        for name, solution in zip(results.case.channel_names, results.mesh_solutions, strict=True)
    ]


def volume_values(results: Results) -> dict[str, FloatArray]:
    """The arrays of ``volume.vtu`` at the nodes."""
    return {field.name: field.values for field in volume_fields(results)}
