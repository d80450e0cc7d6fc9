"""`load_results` and `load_result`: the results of a batch as a table, and those of a run as arrays."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from tetlux.cases.results.batch_tables import readings_file, results_file
from tetlux.cases.results.rows import Row, cell, order_columns, reading_rows, result_rows
from tetlux.cases.run import FILES, SUMMARY
from tetlux.meshing.arrays import FloatArray, IndexArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.files.meshes import read_with_meshio

if TYPE_CHECKING:
    import pandas


def load_results(folder: str | Path, table: Literal["results", "readings"] = "results") -> pandas.DataFrame:
    """Load the results of all runs in a folder.

    Parameters
    ----------
    folder : str or Path
        The folder that `tetlux run` wrote into. Its ``results.csv`` is read, also that of a batch that is still at
        work or was killed; without one, the summaries of all runs below the folder.
    table : {"results", "readings"}
        ``results``: a row for each run and channel; ``readings``: for each run, channel, light and detector.

    Returns
    -------
    pandas.DataFrame
        Swept values under their keys (lists as text). Lengths are in the unit of the column ``unit``, power is in W,
        exitance and fluence in W/unit², seconds in s; see docs/results.md.

    Raises
    ------
    InputError
        If pandas is not installed, or there are no results.

    Examples
    --------
    >>> import tempfile
    >>> from tetlux.cases.cli import main
    >>> with tempfile.TemporaryDirectory() as out:
    ...     code = main(["run", "sphere", "--out", out, "--quiet"])
    ...     table = load_results(out)
    >>> [(run, channel, round(exited, 2)) for run, channel, exited in table[["run", "channel", "exited"]].values]
    [('sphere', 'all', 0.76)]
    """
    try:
        import pandas  # noqa: PLC0415 - an extra, and slow to import
    except ImportError as error:
        raise InputError('load_results needs pandas; install it by pip install "tetlux[tables]".') from error
    folder = Path(folder)
    file = results_file(folder) if table == "results" else readings_file(folder)
    rows = file.read() if results_file(folder).path.exists() else list(_rows_of_summaries(folder, table))
    if not rows:
        raise InputError(f"{folder} holds no {table}; give the folder that tetlux run wrote into.")
    columns = order_columns((name for row in rows for name in row), file.head, file.figures)
    data = {name: _column([row.get(name) for row in rows]) for name in columns}
    return pandas.DataFrame(data)


def _column(values: list[Any]) -> list[Any]:
    """Numbers, or text where a column has any."""
    if any(not isinstance(value, int | float | None) for value in values):
        return [None if value is None else cell(value) for value in values]
    return values


def _rows_of_summaries(folder: Path, table: str) -> Iterator[Row]:
    """The rows of all summaries below a folder."""
    for path in sorted(folder.rglob(SUMMARY)):
        summary = _summary(path)
        yield from result_rows(summary) if table == "results" else reading_rows(summary)


@dataclass(frozen=True, eq=False)
class Volume:
    """The tetrahedra of a run.

    Attributes
    ----------
    points : (n, 3) ndarray
        Nodes, in the unit of the run.
    tetrahedra : (m, 4) ndarray
        Corners, as numbers of nodes.
    values : mapping of str to (n,) ndarray
        ``fluence``, or ``fluence_<channel>``, at each node, W/unit².
    """

    points: FloatArray
    tetrahedra: IndexArray
    values: Mapping[str, FloatArray]

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class RunResult:
    """The results of one run.

    Attributes
    ----------
    folder : Path
        Where the run is.
    summary : mapping
        The content of ``summary.json``.
    readings : list of dict
        What the detectors read: the rows of ``readings.csv`` of this run.
    points : (v, 3) ndarray or None
        Vertices of the surface, in the unit ``summary["unit"]``; None without the output ``surface``.
    triangles : (t, 3) ndarray or None
        Corners, as numbers of vertices.
    values : mapping of str to (v,) ndarray
        The arrays of ``surface.ply`` at the vertices, such as ``exitance``, W/unit².
    volume : Volume or None
        None without the output ``volume``.
    """

    folder: Path
    summary: Mapping[str, Any]
    readings: list[dict[str, Any]]
    points: FloatArray | None
    triangles: IndexArray | None
    values: Mapping[str, FloatArray]
    volume: Volume | None

    @property
    def exitance(self) -> FloatArray:
        """The exitance at the vertices, summed over channels and lights, (v,), W/unit²."""
        if self.points is None:
            raise InputError(f"{self.folder} holds no surface; run its case with outputs: [surface].")
        return self.values["exitance"]

    __repr__ = one_line


def load_result(folder: str | Path) -> RunResult:
    """Load the results of one run.

    Parameters
    ----------
    folder : str or Path
        The folder of the run, which holds its ``summary.json``.

    Returns
    -------
    RunResult

    Raises
    ------
    InputError
        If there is no finished run.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from tetlux.cases.cli import main
    >>> with tempfile.TemporaryDirectory() as out:
    ...     code = main(["run", "sphere", "--out", out, "--quiet"])
    ...     result = load_result(Path(out, "sphere"))
    >>> result.points.shape == (len(result.exitance), 3)
    True
    >>> round(result.summary["channels"][0]["power"]["exited"], 2)
    0.76
    """
    folder = Path(folder)
    if not (folder / SUMMARY).is_file():
        raise InputError(f"{folder} holds no {SUMMARY}; give the folder of a finished run.")
    summary = _summary(folder / SUMMARY)
    points, triangles, values = None, None, {}
    if (folder / FILES["surface"]).is_file():
        surface = read_with_meshio(folder / FILES["surface"], "ply")
        points, triangles, values = surface.points, surface.cells_dict["triangle"], dict(surface.point_data)
    volume = None
    if (folder / FILES["volume"]).is_file():
        mesh = read_with_meshio(folder / FILES["volume"], "vtu")
        volume = Volume(mesh.points, mesh.cells_dict["tetra"], dict(mesh.point_data))
    return RunResult(folder, summary, reading_rows(summary), points, triangles, values, volume)


def _summary(path: Path) -> dict[str, Any]:
    """The content of a summary.

    Raises
    ------
    InputError
        If it is not one.
    """
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read; run the case again.") from error
    if not isinstance(summary, dict) or not {"case", "channels", "as_ran", "seconds"} <= summary.keys():
        raise InputError(f"{path} is not the summary of a run of this version; run the case again.")
    return summary
