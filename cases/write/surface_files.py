"""``surface.ply`` and ``surface.vtp``: the surface with its values."""

from pathlib import Path

from tetlux.cases.write.fields import surface_values
from tetlux.cases.write.ply import write_ply
from tetlux.cases.write.results import Results
from tetlux.cases.write.vtp import write_vtp
from tetlux.meshing.arrays import FloatArray

PLY = "surface.ply"
# The same surface for VTK, PyVista and ParaView, which do not show the values of a PLY file.
VTP = "surface.vtp"


def write_surface(results: Results, folder: Path, more: dict[str, FloatArray]) -> None:
    """Write the surface with its values and more, as PLY for mesh tools and as VTP for VTK."""
    unit, values = results.case.surface.unit, surface_values(results) | more
    notes = {"units": f"lengths in {unit}, exitance in W/{unit}^2"}
    if results.has_colours:
        notes["colours"] = f"red, green, blue: sRGB preview, white is {results.preview[1]:.6g} W/{unit}^2"
    write_ply(results.surface, folder / PLY, values, list(notes.values()))
    if results.has_colours:
        # VTK's viewers show a colour only from a single array of three bytes.
        values["preview"] = results.preview[0]
    write_vtp(results.surface, folder / VTP, values, {"case": results.case.name, **notes})
