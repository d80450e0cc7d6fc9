"""The program of redbirdpy's own process for `tests.benchmarks.redbird`.

redbirdpy is under the GPL and optional. This file imports nothing of tetlux, nothing imports it, and they exchange
files.
"""

import sys
from typing import Any

import numpy as np


def main(job_path: str, result_path: str) -> None:
    """Do the job in ``job_path`` (npz), and write what was found to ``result_path`` (npz)."""
    import redbirdpy  # noqa: PLC0415
    from redbirdpy import analytical  # noqa: PLC0415
    from redbirdpy.utility import getreff  # noqa: PLC0415

    with np.load(job_path) as data:
        job: dict[str, Any] = {key: data[key] for key in data.files}
    sigma_a, reduced, eta = (float(job[name]) for name in ("sigma_a", "sigma_s_prime", "eta"))
    origin, along = np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]])
    far, on_face, times = (job[name] for name in ("distances", "offsets", "times"))
    found = {
        "reflection": getreff(eta),
        "infinite": analytical.infinite_cw(sigma_a, reduced, origin, far[:, None] * along),
        "infinite_td": analytical.infinite_td(sigma_a, reduced, eta, origin, far[:, None] * along, times[:1]),
        "half_space": analytical.semi_infinite_cw(sigma_a, reduced, eta, 1.0, origin, on_face[:, None] * along),
    }
    # With a direction redbirdpy would move the source by a mean free path along it.
    config, _ = redbirdpy.meshprep(
        {
            "node": job["nodes"],
            "elem": job["tetrahedra"] + 1,
            "seg": np.ones(len(job["tetrahedra"]), dtype=int),
            "prop": np.array([[0.0, 0.0, 1.0, 1.0], [sigma_a, reduced, 0.0, eta]]),
            "reff": float(job["reflection"]),
            "srcpos": job["source"][None],
            "srcdir": np.zeros((1, 3)),
            "detpos": job["source"][None],
            "detdir": np.zeros((1, 3)),
            "omega": 2.0 * np.pi * float(job["frequency"]),
        }
    )
    _, fluence = redbirdpy.runforward(config)
    np.savez(result_path, fluence=np.asarray(fluence)[:, 0], **{name: np.squeeze(each) for name, each in found.items()})


if __name__ == "__main__":
    main(*sys.argv[1:])
