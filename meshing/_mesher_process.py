"""What runs in the mesher's own process: pytetwild can crash, hang and write into its working directory."""

from pathlib import Path

import numpy as np


def main() -> None:
    """Tetrahedralize ``input.npz`` of the working directory into ``output.npz``."""
    from pytetwild.pytetwild import tetrahedralize  # noqa: PLC0415

    job = np.load(Path("input.npz"))
    points, tetrahedra = tetrahedralize(
        job["points"],
        job["faces"],
        edge_length_abs=float(job["edge_length"]),
        epsilon=float(job["epsilon"]),
        stop_energy=float(job["stop_energy"]),
        vtk_ordering=True,
        quiet=True,
    )
    np.savez(Path("output.npz"), points=points, tetrahedra=tetrahedra)


if __name__ == "__main__":
    main()
