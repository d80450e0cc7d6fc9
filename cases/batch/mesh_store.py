"""`MeshStore`: the meshes of a batch's groups, kept beside its results until it is complete.

The mesher does not give the same mesh twice. A batch that is resumed goes on with the meshes that it had, so that it
finds what it would have found.
"""

import contextlib
import hashlib
import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from tetlux.cases.batch.jobs import MeshData
from tetlux.cases.batch.plan import Plan

FOLDER = ".meshes"


class MeshStore:
    """Meshes by the content of the runs of their group.

    Parameters
    ----------
    out : Path
        Folder of all results.
    plan : Plan
    contents : sequence of str
        The hash of each run, see `tetlux.cases.write.content`.
    """

    def __init__(self, out: Path, plan: Plan, contents: Sequence[str]) -> None:
        self._folder = out / FOLDER
        self._paths = {number: self._folder / f"{key}.npz" for number, key in _keys(plan, contents).items()}

    def load(self, mesh: int) -> MeshData | None:
        """The mesh of a group, if it is kept and can be read."""
        try:
            with self._paths[mesh].open("rb") as file, np.load(file, allow_pickle=False) as data:
                return MeshData(data["points"], data["tetrahedra"], str(data["unit"]), data["regions"])
        except Exception:  # a damaged file is a missing one, whatever its reader raises
            return None

    def save(self, mesh: int, data: MeshData) -> None:
        """Keep a mesh; do nothing if it cannot be written."""
        with contextlib.suppress(OSError):
            self._folder.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=self._folder, suffix=".part", delete=False) as file:
                np.savez(
                    file,
                    points=data.points,
                    tetrahedra=data.tetrahedra,
                    unit=np.array(data.unit),
                    regions=data.regions,
                )
            Path(file.name).replace(self._paths[mesh])

    def clear(self) -> None:
        """Remove what this batch has kept, when it is complete."""
        for path in self._paths.values():
            path.unlink(missing_ok=True)
        with contextlib.suppress(OSError):
            self._folder.rmdir()


def _keys(plan: Plan, contents: Sequence[str]) -> Mapping[int, str]:
    runs: dict[int, list[str]] = {mesh.number: [] for mesh in plan.meshes if mesh.pilots}
    for task in plan.tasks:
        if task.mesh in runs:
            runs[task.mesh] += [contents[run] for run in task.runs]
    return {
        number: hashlib.blake2b(json.dumps(sorted(each)).encode(), digest_size=16).hexdigest()
        for number, each in runs.items()
    }
