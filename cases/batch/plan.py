"""`Plan`: what a batch does, as a graph of plain data that can be printed, and tested without solving.

Edges point from what is made to what it is made of: surfaces <- meshes <- tasks <- runs. A mesh is made once and serves
all of its tasks; a task is what one worker does in one go.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class PlannedSurface:
    """A body that is read once: a surface with the regions in it, or a mesh that a case gives.

    Attributes
    ----------
    number : int
    name : str
    faces : int
    """

    number: int
    name: str
    faces: int


@dataclass(frozen=True)
class PlannedMesh:
    """A mesh that is adapted once, for some runs of a group, and from which all runs of the group start.

    Attributes
    ----------
    number : int
    surface : int
        Number of its surface.
    pilots : tuple of int
        The runs whose tolerances it is refined for. Empty if there is nothing to share: each run makes its own mesh,
        or solves on the mesh that its case gives.
    runs : int
        How many runs start from it.
    """

    number: int
    surface: int
    pilots: tuple[int, ...]
    runs: int


@dataclass(frozen=True)
class PlannedTask:
    """Runs that one worker solves one after the other, ordered so that equal systems follow each other.

    Attributes
    ----------
    number : int
    mesh : int
        Number of the mesh that they start from.
    runs : tuple of int
        Numbers of the runs.
    systems : int
        How many systems are assembled on that mesh.
    """

    number: int
    mesh: int
    runs: tuple[int, ...]
    systems: int


@dataclass(frozen=True)
class Plan:
    """All runs of a batch.

    Attributes
    ----------
    names : tuple of str
        The name of each run, by its number.
    surfaces : tuple of PlannedSurface
    meshes : tuple of PlannedMesh
    tasks : tuple of PlannedTask
    leaders : tuple of int
        For each run the one of the same lights and of similar media that places of charges are chosen for: so what a
        run finds does not depend on which runs were solved before.
    right_hand_sides : int
        Lights of all channels of all runs.
    """

    names: tuple[str, ...]
    surfaces: tuple[PlannedSurface, ...]
    meshes: tuple[PlannedMesh, ...]
    tasks: tuple[PlannedTask, ...]
    leaders: tuple[int, ...]
    right_hand_sides: int

    @property
    def systems(self) -> int:
        """How many systems are assembled, if no run needs a finer mesh than that of its group."""
        return sum(task.systems for task in self.tasks)
