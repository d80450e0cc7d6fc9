"""What happens in a batch, as plain data: displays and tables of results are listeners that are called with each event.

All listeners are called in the process of the batch, one event at a time, in the order in which things are known there.
Runs are numbered from 0 in the order of the plan; they end in any order.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal


@dataclass(frozen=True)
class BatchStarted:
    """Nothing is solved yet.

    Attributes
    ----------
    names : tuple of str
        The name of each run, which is its folder relative to `out`.
    out : Path
    workers : int
        How many runs are solved at a time.
    sources : tuple of str
        The case file of each run.
    """

    names: tuple[str, ...]
    out: Path
    workers: int
    sources: tuple[str, ...] = ()


@dataclass(frozen=True)
class MeshStarted:
    """A worker adapts the mesh of a group of runs.

    Attributes
    ----------
    mesh : int
        Its number in the plan.
    runs : int
        How many runs start from it.
    worker : str
    """

    mesh: int
    runs: int
    worker: str


@dataclass(frozen=True)
class MeshFinished:
    """The mesh of a group of runs is there.

    Attributes
    ----------
    mesh : int
    tetrahedra : int
    seconds : float
        Wall time.
    worker : str
    """

    mesh: int
    tetrahedra: int
    seconds: float
    worker: str


@dataclass(frozen=True)
class RunStarted:
    """A worker begins a run.

    Attributes
    ----------
    run : int
    name : str
    worker : str
        Name of the worker; "" if runs are solved in the process of the batch.
    repairs : tuple of str
        What was repaired when the run's surfaces were read.
    """

    run: int
    name: str
    worker: str = ""
    repairs: tuple[str, ...] = ()


@dataclass(frozen=True)
class StageEnded:
    """A stage of a run has ended, or of the mesh of a group.

    Attributes
    ----------
    run : int
    text : str
        A line for people.
    seconds : float
        Since the run began.
    """

    run: int
    text: str
    seconds: float


@dataclass(frozen=True)
class RunFinished:
    """All files of a run are in its folder.

    Attributes
    ----------
    run : int
    name : str
    folder : Path
    summary : mapping
        The content of its ``summary.json``.
    seconds : float
        Wall time of the run, without its share of a group's mesh.
    worker : str
    kept : bool
        Whether it was finished by an earlier batch and is kept by ``--resume``.
    notes : tuple of str
        Its warnings.
    readings : tuple of str
        What its detectors read, in lines for people.
    """

    run: int
    name: str
    folder: Path
    summary: Mapping[str, Any]
    seconds: float
    worker: str = ""
    kept: bool = False
    notes: tuple[str, ...] = ()
    readings: tuple[str, ...] = ()


@dataclass(frozen=True)
class RunFailed:
    """A run could not be finished; the others go on.

    Attributes
    ----------
    run : int
    name : str
    reason : str
        One sentence.
    seconds : float
    worker : str
    sweep : mapping
        The swept values of the run, by key.
    ends_batch : bool
        Whether no other run could do better: the disk is full.
    """

    run: int
    name: str
    reason: str
    seconds: float
    worker: str = ""
    sweep: Mapping[str, Any] = field(default_factory=dict)
    ends_batch: bool = False


@dataclass(frozen=True)
class WorkerLost:
    """A worker process died and is replaced; its work is done again once.

    Attributes
    ----------
    worker : str
    reason : str
    runs : tuple of int
        The runs that it had.
    """

    worker: str
    reason: str
    runs: tuple[int, ...]


@dataclass(frozen=True)
class BatchEnded:
    """The last event.

    Attributes
    ----------
    finished, failed, kept, left : int
        Runs by outcome: finished now, failed, finished by an earlier batch, and not begun since it was interrupted.
    seconds : float
    how : {"complete", "interrupted", "stopped"}
        "stopped" if nothing more could be written.
    """

    finished: int
    failed: int
    kept: int
    left: int
    seconds: float
    how: Literal["complete", "interrupted", "stopped"] = "complete"


Event = (
    BatchStarted
    | MeshStarted
    | MeshFinished
    | RunStarted
    | StageEnded
    | RunFinished
    | RunFailed
    | WorkerLost
    | BatchEnded
)
Listener = Callable[[Event], None]
