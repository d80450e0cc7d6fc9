"""One run: solve a case and write what it asks for, whole or not at all."""

import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from tetlux.cases.case import Case
from tetlux.cases.compare import as_json, compare
from tetlux.cases.compare_picture import draw_comparison
from tetlux.cases.picture import Ray, Scene, draw
from tetlux.cases.summary import summarize
from tetlux.fem.lights import PencilBeam, PointSource
from tetlux.fem.lights.point import unit_vector
from tetlux.fem.solution import Solution
from tetlux.fem.solve import solve
from tetlux.fem.surface_exitance import surface_exitance
from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.errors import RunError
from tetlux.meshing.files import write_mesh, write_surface
from tetlux.meshing.surface import Surface

Report = Callable[[str], None]
FILES = {"surface": "surface.ply", "volume": "volume.vtu", "picture": "picture.png"}
COMPARISON = ("compare.json", "compare.png")
SUMMARY = "summary.json"


def run_case(case: Case, out: Path, report: Report = lambda _: None, *, cache: bool = True) -> Path:
    """Solve a case and write its results.

    Results are written into a folder beside the final one and moved there when all are complete, the
    summary last: where there is a summary, the run was finished.

    Parameters
    ----------
    case : Case
    out : Path
        Folder of all results; this case's go to ``out / case.name``.
    report : callable
        Called with a line of text as each stage ends.
    cache : bool
        Whether the mesher's mesh is looked up and kept in the user's cache directory.

    Returns
    -------
    Path
        The folder of this case's results.

    Raises
    ------
    RunError
        If the mesher or the solver fails, or the results cannot be written.
    """
    started = time.perf_counter()
    solution = solve(case.surface, case.medium, case.lights, tolerance=case.tolerance, cache=cache, report=report)
    target = out / case.name
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".partial-", dir=out) as folder:
            warnings = _write(case, solution, Path(folder), started)
            target.mkdir(parents=True, exist_ok=True)
            _move(Path(folder), target)
    except OSError as error:
        raise RunError(
            f"results cannot be written to {target}: {error.strerror or error}; choose another folder with --out."
        ) from error
    for warning in warnings:
        report(f"note: {warning}")
    return target


def _write(case: Case, solution: Solution, folder: Path, started: float) -> list[str]:
    """Write all files of a run into a folder, and return its warnings."""
    writing = time.perf_counter()
    mesh = solution.mesh
    warnings = list(solution.warnings)
    surface, exitance = surface_exitance(solution)
    if "surface" in case.outputs:
        write_surface(surface, folder / FILES["surface"], {"exitance": exitance})
    if "volume" in case.outputs:
        write_mesh(mesh, folder / FILES["volume"], {"fluence": solution.fluence})
    if "picture" in case.outputs:
        scene = Scene(
            points=surface.points,
            triangles=surface.faces,
            exitance=exitance,
            unit=mesh.unit,
            title=case.name,
            lights=tuple(ray for light in case.lights for ray in _rays(light, case.surface)),
        )
        warnings += draw(scene, folder / FILES["picture"])
    compared = None
    if case.comparison is not None:
        compared = compare(case.comparison, solution)
        data, image = (folder / name for name in COMPARISON)
        data.write_text(json.dumps(as_json(compared), allow_nan=False) + "\n", encoding="utf-8")
        draw_comparison(compared, case.name, mesh.unit, image)
    now = time.perf_counter()
    seconds = {**solution.seconds, "write": now - writing, "total": now - started + case.reading_seconds}
    seconds["surface"] += case.reading_seconds
    figures = summarize(case, solution, exitance, seconds, warnings)
    if compared is not None:
        figures["compare"] = compared.differences
    summary = json.dumps(figures, indent=2, allow_nan=False)
    (folder / SUMMARY).write_text(summary + "\n", encoding="utf-8")
    return warnings


def _move(folder: Path, target: Path) -> None:
    """Replace an earlier run's results by this one's, never leaving a summary beside another run's files."""
    (target / SUMMARY).unlink(missing_ok=True)
    for name in (*FILES.values(), *COMPARISON):
        if (folder / name).exists():
            (folder / name).replace(target / name)
        else:
            (target / name).unlink(missing_ok=True)
    (folder / SUMMARY).replace(target / SUMMARY)


def _rays(light: object, surface: Surface) -> tuple[Ray, ...]:
    """How a picture draws a light; diffuse light comes from everywhere and is not drawn."""
    if isinstance(light, PencilBeam):
        end = light.entry(surface)
        start = end - 0.3 * surface.diagonal * unit_vector(light.direction, "direction")
        return (Ray(_vector(start), _vector(end)),)
    if isinstance(light, PointSource):
        return (Ray(light.position, light.position),)
    return ()


def _vector(point: FloatArray) -> Vector:
    x, y, z = point.tolist()
    return x, y, z
