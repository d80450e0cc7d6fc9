"""The script of the mesher's process: pytetwild can crash, hang and write into its working directory.

It runs without Python's site packages and imports nothing of tetlux, since start-up takes a third of the time of a
small body. Its argument is a JSON object: `paths`, the module paths; `pytetwild`, the folder of that package;
`parent`, the id of the parent process.
"""

import ctypes
import importlib
import json
import os
import signal
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

PR_SET_PDEATHSIG = 1


def main() -> None:
    """Tetrahedralize ``input.npz`` of the working directory into ``output.npz``."""
    setting = json.loads(sys.argv[1])
    die_with(setting["parent"])
    # This also drops the script's own folder, whose module names could shadow others.
    sys.path[:] = setting["paths"]
    import numpy as np  # noqa: PLC0415

    tetrahedralize = _import_tetrahedralize(setting["pytetwild"])
    with np.load(Path("input.npz")) as job:
        points, tetrahedra = tetrahedralize(
            job["points"],
            job["faces"],
            edge_length_abs=float(job["edge_length"]),
            epsilon=float(job["epsilon"]),
            stop_energy=float(job["stop_energy"]),
            vtk_ordering=True,
            quiet=True,
            disable_filtering=not bool(job["filtered"]),
        )
    np.savez(Path("output.npz"), points=points, tetrahedra=tetrahedra)


def die_with(parent: int) -> None:
    """On Linux, have this process killed when its parent dies; it could run on for minutes."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:
            sys.exit("the process that asked for the mesh is gone")


def _import_tetrahedralize(folder: str) -> Callable[..., Any]:
    """Import pytetwild's function without the package's ``__init__``, which takes .3 s to import PyVista.

    Where that fails (``__init__`` of a Windows wheel locates its libraries), import the package as usual.
    """
    package = types.ModuleType("pytetwild")
    package.__path__ = [folder]
    sys.modules["pytetwild"] = package
    try:
        module = importlib.import_module("pytetwild.pytetwild")
    except ImportError:
        for name in [n for n in sys.modules if n.partition(".")[0] == "pytetwild"]:
            del sys.modules[name]
        module = importlib.import_module("pytetwild.pytetwild")
    function: Callable[..., Any] = module.tetrahedralize
    return function


if __name__ == "__main__":
    main()
