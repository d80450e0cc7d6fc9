"""What workers are given, and what they give back: plain data that can be pickled."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from tetlux.cases.file.case import Case
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.region import Region
from tetlux.fem.share import share_mesh
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.tets.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class MeshData:
    """A mesh without what can be computed from it.

    Attributes
    ----------
    points : (n, 3) ndarray
    tetrahedra : (m, 4) ndarray
    unit : str
    regions : (m,) ndarray
    """

    points: FloatArray
    tetrahedra: IntArray
    unit: str
    regions: IntArray

    @classmethod
    def of(cls, mesh: TetMesh) -> "MeshData":
        """The data of a mesh."""
        return cls(mesh.points, mesh.tetrahedra, mesh.unit, mesh.regions)

    def mesh(self) -> TetMesh:
        """The mesh."""
        return TetMesh(self.points, self.tetrahedra, self.unit, self.regions)


@dataclass(frozen=True, eq=False)
class MeshJob:
    """Adapt the mesh of a group.

    Attributes
    ----------
    mesh : int
        Its number in the plan.
    runs : int
        How many runs start from it.
    cases : tuple of Case
        Those that it is adapted for, and then others that it is graded for.
    pilots : int
        How many of these it is adapted for.
    cache : bool
        Whether the mesher's mesh is looked up and kept in the user's cache directory.
    """

    mesh: int
    runs: int
    cases: tuple[Case, ...]
    pilots: int
    cache: bool

    def adapt(self) -> MeshData:
        """Make the mesh."""
        first = self.cases[0]
        channels = [(case, channel) for case in self.cases for channel in case.channels]
        count = sum(len(case.channels) for case in self.cases[: self.pilots])
        found = share_mesh(
            first.surface,
            [channel.medium for _, channel in channels],
            [list(channel.lights.values()) for _, channel in channels],
            pilots=count,
            regions=_regions_of_all(self.cases),
            tolerance=first.tolerance,
            detectors=[entry.detector for entry in first.detectors],
            detector_tolerance=first.detector_tolerance,
            everywhere_tolerance=first.everywhere_tolerance,
            volume_tolerance=first.volume_tolerance,
            cache=self.cache,
            frequency=[channel.frequency for _, channel in channels],
            outside_index=first.outside_index,
        )
        return MeshData.of(found.mesh)


@dataclass(frozen=True, eq=False)
class RunJob:
    """One run.

    Attributes
    ----------
    run : int
        Its number in the plan.
    case : Case
    leader : int
        The number of the run whose places of charges it follows.
    """

    run: int
    case: Case
    leader: int


@dataclass(frozen=True, eq=False)
class SolveJob:
    """Solve runs one after the other.

    Attributes
    ----------
    task : int
        Its number in the plan.
    mesh : int
        The number of the mesh that the runs start from.
    start : MeshData or None
        That mesh; None if each run makes its own.
    runs : tuple of RunJob
    leaders : mapping of int to Case
        Their leaders, by number.
    out : str
        Folder of all results; empty to send files back as bytes.
    cache : bool
    """

    task: int
    mesh: int
    start: MeshData | None
    runs: tuple[RunJob, ...]
    leaders: Mapping[int, Case]
    out: str
    cache: bool


def _regions_of_all(cases: Sequence[Case]) -> list[Region]:
    """The regions of a body, each with a medium for each channel of each case."""
    regions = []
    for number, region in enumerate(cases[0].regions):
        media: list[AnyMedium] = []
        for case in cases:
            medium = case.regions[number].medium
            media += [medium] * len(case.channels) if isinstance(medium, AnyMedium) else medium
        regions.append(Region(region.surface, media))
    return regions


Job = MeshJob | SolveJob


@dataclass(frozen=True, eq=False)
class MeshMade:
    """The answer to a `MeshJob`."""

    mesh: int
    data: MeshData = field(repr=False)


@dataclass(frozen=True)
class MeshNotMade:
    """The answer to a `MeshJob` that failed: runs make their own meshes, and say what is wrong if there is."""

    mesh: int


@dataclass(frozen=True)
class JobEnded:
    """The last answer to every job."""


@dataclass(frozen=True)
class StopAfterRun:
    """Asks a worker to leave the rest of its job after the run that it is at."""
