"""Small tables in which notebooks show surfaces, meshes and others."""

from collections.abc import Iterable
from html import escape
from typing import Any

from tetlux.meshing.describe import size


def html_table(title: str, rows: Iterable[tuple[str, str]]) -> str:
    """A table of names and values under a title, as HTML."""
    cells = "".join(
        f'<tr><th style="text-align:left;font-weight:normal">{escape(name)}</th>'
        f'<td style="text-align:left">{escape(value)}</td></tr>'
        for name, value in rows
    )
    return f"<table><caption style='text-align:left'><b>{escape(title)}</b></caption><tbody>{cells}</tbody></table>"


def surface_html(surface: Any) -> str:
    """What a `Surface` is, as HTML."""
    rows = [
        ("triangles", f"{len(surface.faces):,}"),
        ("size", size(surface.points, surface.unit)),
        ("volume", f"{surface.volume:.4g} {surface.unit}³"),
        *(("repaired", each) for each in surface.repairs),
        *(("note", each) for each in surface.warnings),
    ]
    return html_table(f"Surface {surface.name}", rows)


def mesh_html(mesh: Any) -> str:
    """What a `TetMesh` is, as HTML: its regions with their volumes too, if there are several."""
    regions = mesh.region_volumes if len(mesh.region_volumes) > 1 else {}
    rows = [
        ("nodes", f"{len(mesh.points):,}"),
        ("tetrahedra", f"{len(mesh.tetrahedra):,}"),
        ("size", size(mesh.points, mesh.unit)),
        ("volume", f"{mesh.volume:.4g} {mesh.unit}³"),
        *(
            (f"region {mesh.labels.get(number, number)}", f"{volume:.4g} {mesh.unit}³")
            for number, volume in regions.items()
        ),
    ]
    return html_table("TetMesh", rows)
