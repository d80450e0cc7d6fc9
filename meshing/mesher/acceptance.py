"""Check that a mesh represents its surfaces."""

import numpy as np

from tetlux.meshing.errors import RunError
from tetlux.meshing.mesher.deviation import two_sided_distance
from tetlux.meshing.mesher.shells import Shell
from tetlux.meshing.repair.pinches import parts_of
from tetlux.meshing.repair.topology import bodies, compact
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# A mesh that is farther from the surface than this many deviations lacks a part of the body.
LOST_PART = 2.5
# Sample points for the distance of a mesh from its surface: a lost part is larger than a triangle, so few suffice.
PART_SAMPLES = 3_000


class NotTheBodyError(RunError):
    """The mesh does not represent the surface; a mesh within a smaller deviation may."""


def has_lost_part(mesh: TetMesh, shell: Shell) -> bool:
    """Whether the mesh is so far from the surface of a shell, at some place, that it must lack a part."""
    part = part_of(mesh, shell)
    return two_sided_distance(part.surface, shell.surface, PART_SAMPLES) > LOST_PART * shell.deviation


def part_of(mesh: TetMesh, shell: Shell) -> TetMesh:
    """The part of the mesh inside a shell."""
    if 0 in shell.regions or not shell.regions:
        return mesh
    tetrahedra = mesh.tetrahedra[np.isin(mesh.regions, shell.regions)]
    if len(tetrahedra) == 0:
        raise NotTheBodyError(
            f"{shell.surface.name}: the mesh lost it, since it is too small beside the body; "
            "leave it out, or make it larger."
        )
    return TetMesh(*compact(mesh.points, tetrahedra), mesh.unit)


def check_body(mesh: TetMesh, surface: Surface, deviation: float) -> None:
    """Refuse a mesh that does not represent a surface within a deviation, unit.

    Raises
    ------
    NotTheBodyError
    """
    # Nearly all boundary nodes lie on the surface; flat facets cut off thin round parts by at most the deviation.
    slack = 0.02 + deviation * surface.area / surface.volume
    # The volume of a surface that crosses itself counts overlaps repeatedly; the mesh is of their union.
    lowest = -0.9 if surface.overlaps else -slack
    for quantity, change in (
        ("volume", mesh.volume / surface.volume - 1.0),
        ("area", mesh.area / surface.area - 1.0),
    ):
        if not lowest <= change <= slack:
            raise NotTheBodyError(
                f"{surface.name}: the mesh's {quantity} is {change:+.1%} off the surface's; parts are thinner than "
                f"{deviation:.3g} {surface.unit}: make them thicker, or leave them out."
            )
    body_of = bodies(len(surface.points), surface.faces)
    # Sample one triangle per body, since the sums do not show that a small body is missing.
    _, first = np.unique(body_of, return_index=True)
    vertices = surface.points[surface.faces[first]].reshape(-1, 3)
    distances = np.linalg.norm(mesh.closest_boundary(vertices)[0] - vertices, axis=1)
    if not surface.overlaps and (distances > LOST_PART * deviation).any():
        raise NotTheBodyError(
            f"{surface.name}: the mesh lacks one of the surface's {len(first)} bodies, which is too small beside the "
            "others; leave it out, or make it larger."
        )
    part_numbers = parts_of(surface.points, surface.faces)
    expected = max(len(first), 0 if part_numbers is None else int(part_numbers.max()) + 1)
    parts = int(bodies(len(mesh.points), mesh.tetrahedra).max()) + 1
    if parts > expected:
        raise NotTheBodyError(
            f"{surface.name}: the mesh fell into {parts} parts where the surface has {expected}; "
            "thicken the narrowest part."
        )
