"""Seconds and memory on large meshes: ``python tests/benchmarks/large_mesh.py [--tetrahedra 50000 400000 ...]``.

A cube of 20 mm cut into tetrahedra, sigma_a 0.01, sigma_s' 1, eta 1.4, a point source one mean free path below its
upper face. For each size: seconds from the arrays of the mesh to the matrix, and from there to the fluence, by
conjugate gradients with the diagonal to a true residual of 1e-8 (the method of the peer) and by the default of
tetlux, to 1e-11; the peak memory of the process that does the latter, imports and mesh included; and the exponents
of the times against tetrahedra. Every figure is the smallest of three runs, each method in processes of its own.

With NGSolve installed, here or for the interpreter that ``--ngsolve`` names, its assembly of the same terms on the
same mesh and its own Jacobi-CG to the same residual, on two threads. It is compared in whole times, since it has to
build its tables of neighbours as tetlux has to; the import of the mesh is counted for neither.
"""

import argparse
import itertools
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import numpy.typing as npt

SIZE, SIGMA_A, SIGMA_S_PRIME, ETA, RESIDUAL = 20.0, 0.01, 1.0, 1.4, 1e-8
DEFAULT = [50_000, 150_000, 400_000, 1_300_000, 4_000_000]
RUNS = 3
FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Row = dict[str, float]


def cube(count: int) -> tuple[FloatArray, IntArray]:
    """A cube of count³ cells, each of six tetrahedra around its diagonal (Kuhn 1960)."""
    axis = np.linspace(-0.5 * SIZE, 0.5 * SIZE, count + 1)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    steps = np.array([(count + 1) ** 2, count + 1, 1])
    first = (np.indices((count,) * 3).reshape(3, -1).T @ steps)[:, None]
    cells = []
    for axes in itertools.permutations(range(3)):
        path = np.concatenate([[0], np.cumsum(steps[list(axes)])])
        # Half of the six paths from corner to corner turn the other way.
        cells.append(first + (path if np.linalg.det(np.eye(3)[list(axes)]) > 0 else path[[0, 2, 1, 3]]))
    return points, np.stack(cells, axis=1).reshape(-1, 4)


def source_node(points: FloatArray) -> int:
    """The node nearest to one mean free path below the middle of the upper face."""
    target = np.array([0.0, 0.0, 0.5 * SIZE - 1.0 / (SIGMA_A + SIGMA_S_PRIME)])
    return int(((points - target) ** 2).sum(axis=1).argmin())


def tetlux(points: FloatArray, tetrahedra: IntArray, method: str) -> Row:
    """Assemble and solve here."""
    import pyamg  # noqa: F401, PLC0415

    from tetlux.fem import Medium  # noqa: PLC0415
    from tetlux.fem.linear import krylov, solver  # noqa: PLC0415
    from tetlux.fem.operators.assembly import system_matrix  # noqa: PLC0415
    from tetlux.meshing import TetMesh  # noqa: PLC0415

    if method == "jacobi":
        krylov.STOP_RESIDUAL = RESIDUAL
    medium = Medium(sigma_a=SIGMA_A, sigma_s_prime=SIGMA_S_PRIME, eta=ETA)
    load = np.zeros(len(points))
    load[source_node(points)] = 1.0
    started = time.perf_counter()
    matrix = system_matrix(TetMesh(points, tetrahedra), medium)
    assembled = time.perf_counter()
    chosen = solver.Solver(matrix, [krylov.jacobi]) if method == "jacobi" else solver.solver_for(matrix)
    fluence = chosen.solve(load).x
    solved = time.perf_counter()
    residual = float(np.linalg.norm(load - matrix @ fluence))
    return {"assembly": assembled - started, "solve": solved - assembled, "residual": residual}


def ngsolve(points: FloatArray, tetrahedra: IntArray, factor: float) -> Row:
    """The same by NGSolve; `factor` is A, so that only tetlux needs to know how it follows from eta."""
    import netgen.meshing as netgen  # noqa: PLC0415
    import ngsolve as ng  # noqa: PLC0415

    faces = np.sort(tetrahedra[:, [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]].reshape(-1, 3), axis=1)
    faces, times = np.unique(faces, axis=0, return_counts=True)
    imported = netgen.Mesh(3)
    imported.AddPoints(points)
    imported.Add(netgen.FaceDescriptor(surfnr=1, domin=1, domout=0, bc=1))
    imported.AddElements(dim=3, index=1, data=tetrahedra.astype(np.int32), base=0)
    imported.AddElements(dim=2, index=1, data=faces[times == 1].astype(np.int32), base=0)
    ng.SetNumThreads(2)
    diffusion = 1.0 / (3.0 * (SIGMA_A + SIGMA_S_PRIME))
    with ng.TaskManager():
        mesh = ng.Mesh(imported)
        started = time.perf_counter()
        space = ng.H1(mesh, order=1)
        u, v = space.TnT()
        form = ng.BilinearForm(space, symmetric=False)
        form += (diffusion * ng.grad(u) * ng.grad(v) + SIGMA_A * u * v) * ng.dx + u * v / (2.0 * factor) * ng.ds
        preconditioner = ng.Preconditioner(form, "local")
        form.Assemble()
        assembled = time.perf_counter()
        load = form.mat.CreateColVector()
        load[:] = 0.0
        load[source_node(points)] = 1.0
        result, aim = load.CreateVector(), 0.1 * RESIDUAL
        solver = ng.solvers.CGSolver(form.mat, preconditioner.mat, tol=aim, maxiter=2000)
        solver.Solve(rhs=load, sol=result)
        solved = time.perf_counter()
        residual = float(ng.Norm(load - form.mat * result))
    return {"assembly": assembled - started, "solve": solved - assembled, "residual": residual}


def measure(interpreter: str, path: Path, method: str) -> Row:
    """The quickest of the runs of a method, each in a process of its own."""
    rows = []
    for _ in range(RUNS):
        command = [interpreter, __file__, "--child", method, str(path)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise SystemExit(f"{method} failed:\n{done.stderr}")
        rows.append(json.loads(done.stdout.splitlines()[-1]))
    return min(rows, key=lambda row: row["assembly"] + row["solve"])


def child(method: str, path: Path) -> None:
    """What runs in a process of its own: one method on one mesh, its figures as JSON."""
    with np.load(path) as arrays:
        points, tetrahedra, factor = arrays["points"], arrays["tetrahedra"], float(arrays["factor"])
    row = ngsolve(points, tetrahedra, factor) if method == "ngsolve" else tetlux(points, tetrahedra, method)
    # Linux counts in kilobytes.
    row["gigabytes"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(json.dumps(row))


def main() -> None:
    """Print a row for each size and method, and the exponents."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tetrahedra", type=int, nargs="+", default=DEFAULT, help="about so many, 50,000 to 4,000,000")
    parser.add_argument("--ngsolve", default=sys.executable, help="an interpreter that has NGSolve")
    parser.add_argument("--child", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        child(arguments.child[0], Path(arguments.child[1]))
        return
    from tetlux.fem import Medium  # noqa: PLC0415

    factor = Medium(sigma_a=SIGMA_A, sigma_s_prime=SIGMA_S_PRIME, eta=ETA).boundary_factor
    methods = {"jacobi": sys.executable, "default": sys.executable}
    if subprocess.run([arguments.ngsolve, "-c", "import ngsolve"], capture_output=True, check=False).returncode == 0:
        methods["ngsolve"] = arguments.ngsolve
    else:
        print("NGSolve is not installed: name an interpreter that has it with --ngsolve.")
    print("| tetrahedra | method | assembly, s | solve, s | both, s | true residual | peak, GB |")
    print("|---|---|---|---|---|---|---|")
    whole: dict[str, list[tuple[int, float]]] = {method: [] for method in methods}
    with tempfile.TemporaryDirectory() as folder:
        for wanted in arguments.tetrahedra:
            points, tetrahedra = cube(max(1, round((wanted / 6) ** (1 / 3))))
            path = Path(folder) / "mesh.npz"
            np.savez(path, points=points, tetrahedra=tetrahedra, factor=factor)
            for method, interpreter in methods.items():
                row = measure(interpreter, path, method)
                both = row["assembly"] + row["solve"]
                whole[method].append((len(tetrahedra), both))
                print(
                    f"| {len(tetrahedra):,} | {method} | {row['assembly']:.3f} | {row['solve']:.3f} | {both:.3f} | "
                    f"{row['residual']:.1e} | {row['gigabytes']:.2f} |",
                    flush=True,
                )
    if len(arguments.tetrahedra) > 1:
        for method, found in whole.items():
            counts, seconds = np.log(np.array(found)).T
            print(f"{method}: time grows like tetrahedra to the {np.polyfit(counts, seconds, 1)[0]:.2f}")


if __name__ == "__main__":
    main()
