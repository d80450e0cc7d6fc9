"""Run pytetwild in a separate process with a time limit, since it can crash, hang or exhaust memory."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import RunError
from tetlux.meshing.host.scratch import run_child, scratch

# The command that meshes input.npz of its working directory; -S (no site packages), since it is given module paths.
MESHER: tuple[str, ...] = (sys.executable, "-S", str(Path(__file__).with_name("_mesher_process.py")))
MAKE_ROOM = "make room in the system's folder for temporary files, or name another one in TMPDIR."


def run_pytetwild(
    points: FloatArray,
    faces: IntArray,
    *,
    edge_length: float,
    epsilon: float,
    stop_energy: float,
    seconds: float,
    time_limit: float,
    name: str,
    filtered: bool = True,
) -> tuple[FloatArray, IntArray]:
    """Mesh a surface by pytetwild in a child process.

    Parameters
    ----------
    points : (n, 3) ndarray
        Vertices.
    faces : (f, 3) ndarray
        Triangles, outward oriented.
    edge_length : float
        Target edge length, in the unit of `points`.
    epsilon : float
        Envelope, as a share of the bounding box's diagonal.
    stop_energy : float
        AMIPS energy at which a tetrahedron is good enough.
    seconds, time_limit : float
        Seconds that remain, and the limit that a message names.
    name : str
        The surface, for messages.
    filtered : bool
        Whether to leave out tetrahedra outside the surface.

    Returns
    -------
    points : (k, 3) ndarray
    tetrahedra : (m, 4) ndarray

    Raises
    ------
    RunError
        If pytetwild fails, is killed, exceeds the time, or its files cannot be written.
    """
    try:
        with scratch("mesher") as folder:
            np.savez(
                folder / "input.npz",
                points=points,
                faces=faces.astype(np.int32),
                edge_length=edge_length,
                epsilon=epsilon,
                stop_energy=stop_energy,
                filtered=filtered,
            )
            # The process needs no linear algebra, and so none of the threads that NumPy would start for it.
            environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
            done = run_child([*MESHER, _module_paths()], folder, seconds, environment)
            result = folder / "output.npz"
            if done.returncode != 0 or not result.exists():
                raise _failure(name, done)
            with np.load(result) as data:
                return data["points"].astype(np.float64), data["tetrahedra"].astype(np.int64)
    except subprocess.TimeoutExpired as error:
        raise RunError(
            f"{name}: the mesher was stopped after {time_limit:g} s; leave out thin parts and the smallest "
            "regions, or simplify the surface in a mesh editor."
        ) from error
    except OSError as error:
        raise RunError(f"{name}: the mesher could not be run ({error.strerror or error}); {MAKE_ROOM}") from error


def _failure(name: str, done: subprocess.CompletedProcess[str]) -> RunError:
    """The error for a mesher that ended without a mesh."""
    last = (done.stderr.strip().splitlines() or ["no message"])[-1]
    cause = f"signal {-done.returncode}" if done.returncode < 0 else last
    remedy = "repair or simplify the surface in a mesh editor and try again."
    if last.startswith("OSError"):
        remedy = MAKE_ROOM
    elif done.returncode == -9:
        remedy = "it was killed, as the system does when memory runs out: free some, or simplify the surface."
    return RunError(f"{name}: the mesher failed ({cause}); {remedy}")


def _module_paths() -> str:
    """Module paths for `_mesher_process`, as JSON. An editable install may know them by an import hook only."""
    spec = importlib.util.find_spec("pytetwild")
    folder = (spec.submodule_search_locations or [""])[0] if spec else ""
    candidates = [*sys.path, str(Path(np.__file__).parents[1]), str(Path(folder).parent)]
    # Drop relative paths: the process has another working directory.
    paths = [path for path in dict.fromkeys(candidates) if Path(path).is_absolute()]
    return json.dumps({"paths": paths, "pytetwild": folder, "parent": os.getpid()})
