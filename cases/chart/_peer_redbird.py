"""The program of redbirdpy's own process: linear elements on a mesh made by this project's mesher.

redbirdpy is under the GPL, an optional peer on the chart (``pip install "tetlux[peers]"``). This file is a program
of its own: it imports nothing of tetlux, nothing of tetlux imports it, and they exchange files.
"""

import sys
import time
from typing import Any

import numpy as np


def main(job_path: str, result_path: str) -> None:
    """Solve the job in ``job_path`` (npz), and write fluence at the nodes and seconds to ``result_path`` (npz)."""
    import redbirdpy  # noqa: PLC0415

    with np.load(job_path) as data:
        job: dict[str, Any] = {key: data[key] for key in data.files}
    seconds: list[float] = []
    while not seconds or (len(seconds) < job["repeats"] and sum(seconds) < job["repeat_seconds"]):
        started = time.perf_counter()
        fluence = _solve(redbirdpy, job)
        seconds.append(time.perf_counter() - started)
    np.savez(result_path, fluence=fluence, seconds=min(seconds))


def _solve(redbirdpy: Any, job: dict[str, Any]) -> Any:
    nodes, cells = job["nodes"], job["tetrahedra"]
    # redbirdpy's boundary term is (1 - R)/(1 + R)/2, that of tetlux is 1/(2A).
    reflection = (1.0 - 2.0 * float(job["robin"])) / (1.0 + 2.0 * float(job["robin"]))
    absorption = job["sigma_a"]
    scattering = 1.0 / (3.0 * job["diffusion"]) - absorption
    media = np.column_stack([absorption, scattering, np.zeros(len(absorption)), np.full(len(absorption), job["eta"])])
    config, _ = redbirdpy.meshprep(
        {
            "node": nodes,
            "elem": cells + 1,
            "seg": job["regions"] + 1,
            "prop": np.vstack([[0.0, 0.0, 1.0, 1.0], media]),
            "reff": reflection,
            # With a direction redbirdpy would move the sources by a mean free path along it.
            "srcpos": job["points"],
            "srcdir": np.zeros((1, 3)),
            # redbirdpy requires a detector.
            "detpos": job["points"][:1],
            "detdir": np.zeros((1, 3)),
            "omega": 0.0,
        }
    )
    # The fastest of its solvers for a symmetric positive definite matrix.
    _, fluence = redbirdpy.runforward(config, method="cg+amg", spd=True)
    return np.asarray(fluence)[:, : len(job["points"])] @ job["powers"]


if __name__ == "__main__":
    main(*sys.argv[1:])
