"""A labelled mesh of 300,000 tetrahedra from a gmsh file to its exitance.

Run ``python -m tests.benchmarks.labelled_mesh`` in the root of the repository: it makes a cube of three layers with an
island, writes it as gmsh 4.1 and 2.2 (binary), and prints the seconds of each stage, once for each file. Seconds of the
solve part are those of `solve`: surface, assemble and solve; imports and reading are not among them.
"""

import struct
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from tests.meshes_made import cube_of_cubes
from tetlux.fem import Medium, PencilBeam, solve
from tetlux.meshing import TetMesh, read_mesh
from tetlux.meshing.files.meshes import write_mesh

# Cubes along an edge, of six tetrahedra each; a millimetre wide.
CUBES = 37
LIMIT = 6.0


def labelled_cube(cubes: int) -> TetMesh:
    """A cube below z = 0: label 1 to a depth of 5, 2 to one of 10, 3 below, and an island of 4 in that."""
    points, tetrahedra, places = cube_of_cubes(cubes, 1.0)
    depth = cubes - places[:, 2]
    labels = np.select([depth <= 5, depth <= 10], [1, 2], 3)
    labels[(np.abs(places - [cubes / 2, cubes / 2, cubes / 3]) < 4).all(axis=1)] = 4
    return TetMesh(points - [0.5 * cubes, 0.5 * cubes, cubes], tetrahedra, regions=labels)


def write_gmsh_2(mesh: TetMesh, path: Path) -> None:
    """Write gmsh 2.2, binary, each element with a head of its own, as gmsh does."""
    nodes = np.empty(len(mesh.points), dtype=[("number", "<i4"), ("place", "<f8", 3)])
    nodes["number"], nodes["place"] = np.arange(1, len(nodes) + 1), mesh.points
    count = len(mesh.tetrahedra)
    numbers = np.arange(1, count + 1)
    head = np.broadcast_to([4, 1, 2], (count, 3))
    rows = np.column_stack([head, numbers, mesh.regions, mesh.regions, mesh.tetrahedra + 1]).astype("<i4")
    with path.open("wb") as file:
        file.write(b"$MeshFormat\n2.2 1 8\n" + struct.pack("<i", 1) + b"\n$EndMeshFormat\n")
        file.write(f"$Nodes\n{len(nodes)}\n".encode() + nodes.tobytes() + b"\n$EndNodes\n")
        file.write(f"$Elements\n{count}\n".encode() + rows.tobytes() + b"\n$EndElements\n")


def main() -> int:
    """Print the stages of both files; 1 if one took too long to solve."""
    made = labelled_cube(CUBES)
    media = {
        1: Medium(sigma_a=0.015, sigma_s_prime=0.8, eta=1.4),
        2: Medium(sigma_a=0.01, sigma_s_prime=1.2, eta=1.4),
        3: Medium(sigma_a=0.02, sigma_s_prime=1.0, eta=1.4),
        4: Medium(sigma_a=0.004, sigma_s_prime=0.3, eta=1.4),
    }
    slow = 0
    with tempfile.TemporaryDirectory() as folder:
        files = {"gmsh 4.1": Path(folder, "new.msh"), "gmsh 2.2": Path(folder, "old.msh")}
        write_mesh(made, files["gmsh 4.1"])
        write_gmsh_2(made, files["gmsh 2.2"])
        for name, path in files.items():
            started = time.perf_counter()
            mesh = read_mesh(path)
            reading = time.perf_counter() - started
            processor = time.process_time()
            solution = solve(mesh, media, [PencilBeam((0.1, 0.2, 10.0), (0.0, 0.0, -1.0))], tolerance=0.5)
            processor = time.process_time() - processor
            stages = ", ".join(f"{stage} {seconds:.2f} s" for stage, seconds in solution.seconds.items())
            print(f"{name}: {len(mesh.tetrahedra):,} tetrahedra; read and checked {reading:.2f} s; {stages}")
            print(f"  processor time of the solve part {processor:.2f} s; exited {solution.power.exited:.4f} W")
            slow += solution.seconds["total"] > LIMIT
    return 1 if slow else 0


if __name__ == "__main__":
    sys.exit(main())
