"""From a closed surface to tetrahedra: pytetwild (fTetWild) behind a guard."""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import InputError, RunError
from tetlux.meshing.refine import moved_to_surface
from tetlux.meshing.repair import bodies
from tetlux.meshing.surface import Surface
from tetlux.meshing.tetmesh import TetMesh, tetrahedron_volumes

# The command that fills input.npz of its working directory.
MESHER: tuple[str, ...] = (sys.executable, "-m", "tetlux.meshing._mesher_process")
# How far fTetWild may stray from the surface, as a share of the diagonal: three times its default, and
# several times quicker; what it strays is taken back when the boundary nodes are moved onto the surface.
EPSILON = 3e-3
# At 30 it is a third quicker, and about one mesh in two holds slivers of quality below 0.02; at 10 the worst
# seen on spheres, tori, slabs, cylinders and figures was 0.13.
STOP_ENERGY = 10.0
# Below this share of the body's volume a separate lump of tetrahedra is debris of the envelope.
DEBRIS = 1e-3


def tetrahedralize(
    surface: Surface,
    *,
    edge_length: float | None = None,
    epsilon: float = EPSILON,
    stop_energy: float = STOP_ENERGY,
    time_limit: float = 600.0,
) -> TetMesh:
    """Fill a closed surface with tetrahedra.

    pytetwild runs in a process of its own. Its boundary nodes are moved onto `surface` afterwards.

    Parameters
    ----------
    surface : Surface
    edge_length : float, optional
        Wanted edge length, unit; a twelfth of the bounding box's diagonal if not given. Thin parts get
        shorter edges where the shape needs them.
    epsilon : float
        Largest distance between the surface and fTetWild's boundary, as a share of the diagonal.
    stop_energy : float
        fTetWild's AMIPS energy at which a tetrahedron is good enough; 3 is a regular one.
    time_limit : float
        Seconds until the mesher is stopped.

    Returns
    -------
    TetMesh

    Raises
    ------
    InputError
        If `edge_length`, `epsilon` or `time_limit` is not positive.
    RunError
        If the mesher crashes, takes too long, or returns something that is not this body.

    Notes
    -----
    fTetWild (Hu et al. 2020) is not deterministic: two runs differ in the last per cent of the nodes.
    """
    wanted = surface.diagonal / 12.0 if edge_length is None else edge_length
    for name, value in (("edge_length", wanted), ("epsilon", epsilon), ("time_limit", time_limit)):
        if not np.isfinite(value) or value <= 0:
            raise InputError(f"{name} is {value:g}; give a number greater than 0.")
    # Unit size, about the origin: fTetWild's tolerances are absolute in places.
    origin, size = surface.points.mean(axis=0), surface.diagonal
    points, tetrahedra = _run_pytetwild(
        (surface.points - origin) / size,
        surface.faces,
        edge_length=wanted / size,
        epsilon=epsilon,
        stop_energy=stop_energy,
        time_limit=time_limit,
        name=surface.name,
    )
    points, tetrahedra = _cleaned(points, tetrahedra, surface)
    mesh = TetMesh(points * size + origin, tetrahedra, surface.unit)
    mesh = moved_to_surface(mesh, surface)
    _check_against(mesh, surface, epsilon)
    return mesh


def _run_pytetwild(
    points: FloatArray,
    faces: IntArray,
    *,
    edge_length: float,
    epsilon: float,
    stop_energy: float,
    time_limit: float,
    name: str,
) -> tuple[FloatArray, IntArray]:
    with tempfile.TemporaryDirectory(prefix="tetlux-mesher-", ignore_cleanup_errors=True) as folder:
        job = Path(folder) / "input.npz"
        np.savez(
            job,
            points=points,
            faces=faces.astype(np.int32),
            edge_length=edge_length,
            epsilon=epsilon,
            stop_energy=stop_energy,
        )
        try:
            done = subprocess.run(
                MESHER,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                errors="replace",
                timeout=time_limit,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            raise RunError(
                f"{name}: the mesher was stopped after {time_limit:g} s; give a surface with fewer triangles, "
                "or a longer time limit."
            ) from error
        result = Path(folder) / "output.npz"
        if done.returncode != 0 or not result.exists():
            last = (done.stderr.strip().splitlines() or ["no message"])[-1]
            cause = f"signal {-done.returncode}" if done.returncode < 0 else last
            raise RunError(
                f"{name}: the mesher failed ({cause}); repair or simplify the surface in a mesh editor and try again."
            )
        with np.load(result) as data:
            return data["points"].astype(np.float64), data["tetrahedra"].astype(np.int64)


def _cleaned(points: FloatArray, tetrahedra: IntArray, surface: Surface) -> tuple[FloatArray, IntArray]:
    """Positive tetrahedra only, without the crumbs that an envelope can leave, and without unused nodes."""
    if len(tetrahedra) == 0 or not np.isfinite(points).all():
        raise RunError(
            f"{surface.name}: the mesher returned no tetrahedra; give a shorter edge length or a cleaner surface."
        )
    volumes = tetrahedron_volumes(points, tetrahedra)
    if (volumes < 0).any():
        raise RunError(f"{surface.name}: the mesher returned inverted tetrahedra; try a shorter edge length.")
    keep = volumes > 0
    lump = bodies(len(points), tetrahedra)
    share = np.bincount(lump, volumes) / volumes.sum()
    keep &= share[lump] > DEBRIS
    tetrahedra = tetrahedra[keep]
    used, compact = np.unique(tetrahedra, return_inverse=True)
    return points[used], compact.reshape(tetrahedra.shape)


def _check_against(mesh: TetMesh, surface: Surface, epsilon: float) -> None:
    """Refuse a mesh that is not the body of the surface."""
    # The envelope may shift the whole boundary by epsilon; self-intersecting input overlaps itself.
    slack = 0.02 + 2.0 * epsilon * surface.diagonal * surface.area / surface.volume
    # A surface that crosses itself counts what overlaps more than once, and the mesh is of the union.
    lowest = -0.9 if surface.overlaps else -slack
    for quantity, change in (
        ("volume", mesh.volume / surface.volume - 1.0),
        ("area", mesh.area / surface.area - 1.0),
    ):
        if not lowest <= change <= slack:
            raise RunError(
                f"{surface.name}: the mesh's {quantity} is {change:+.1%} off the surface's; parts are thinner than "
                f"the mesher's envelope of {epsilon * surface.diagonal:.3g} {surface.unit}: give a smaller epsilon."
            )
    wanted = int(bodies(len(surface.points), surface.faces).max()) + 1
    parts = int(bodies(len(mesh.points), mesh.tetrahedra).max()) + 1
    if parts > wanted:
        raise RunError(
            f"{surface.name}: the mesh fell into {parts} parts where the surface has {wanted}; "
            "give a smaller epsilon, or thicken the narrowest part."
        )
