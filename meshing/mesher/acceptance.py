"""Is a mesh the body of its surfaces? What is refused, and in which words."""

import numpy as np

from tetlux.meshing.errors import RunError
from tetlux.meshing.mesher.deviation import surface_deviation
from tetlux.meshing.mesher.shells import Shell
from tetlux.meshing.repair.pinches import parts_of
from tetlux.meshing.repair.topology import bodies, compact
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# A mesh whose boundary is farther from the surface than so many deviations has lost a part.
LOST = 2.5
# Places at which that is looked for: a lost part is larger than a triangle.
LOOKS = 3_000


class NotTheBodyError(RunError):
    """The mesher's mesh is another body than the surface's; a closer one may not be."""


def has_lost_a_part(mesh: TetMesh, shell: Shell) -> bool:
    """Whether the mesh is so far from a surface somewhere that a part is missing."""
    return surface_deviation(part_of(mesh, shell), shell.surface, LOOKS) > LOST * shell.deviation


def part_of(mesh: TetMesh, shell: Shell) -> TetMesh:
    """What a surface bounds of the mesh."""
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
    """Refuse a mesh that is not the body of the surface."""
    # Boundary nodes are on the surface, but for those few that could not get there; chords cut through what is
    # thin and round, by the deviation at most.
    slack = 0.02 + deviation * surface.area / surface.volume
    # A surface that crosses itself counts what overlaps more than once, and the mesh is of the union.
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
    of_surface = bodies(len(surface.points), surface.faces)
    # The first vertices of each body: a small one may be gone without a trace in the sums.
    _, first = np.unique(of_surface, return_index=True)
    vertices = surface.points[surface.faces[first]].reshape(-1, 3)
    astray = np.linalg.norm(mesh.closest_boundary(vertices)[0] - vertices, axis=1)
    if not surface.overlaps and (astray > LOST * deviation).any():
        raise NotTheBodyError(
            f"{surface.name}: the mesh lacks one of the surface's {len(first)} bodies, which is too small beside the "
            "others; leave it out, or make it larger."
        )
    parted = parts_of(surface.points, surface.faces)
    wanted = max(len(first), 0 if parted is None else int(parted.max()) + 1)
    parts = int(bodies(len(mesh.points), mesh.tetrahedra).max()) + 1
    if parts > wanted:
        raise NotTheBodyError(
            f"{surface.name}: the mesh fell into {parts} parts where the surface has {wanted}; "
            "thicken the narrowest part."
        )
