"""`tetlux stress`: scenes to the edges and beyond, and a map of what breaks there."""

import csv
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tetlux.cases.publish import cannot_write, check_writable, claimed, publish
from tetlux.cases.stress.panels import PANELS, Panel
from tetlux.cases.stress.picture import draw_map
from tetlux.cases.stress.report import in_words
from tetlux.cases.stress.rules import broken, violations
from tetlux.cases.stress.runs import TIME_LIMIT, Run, runs_of
from tetlux.cases.stress.scenes import TOLERANCE

# Runs between two lines that say how far it is.
PROGRESS = 50
FILES = ("stress.csv", "stress.md", "stress.png")
COLUMNS = (
    *("panel", "x_name", "x", "y_name", "y", "method", "outcome", "message", "broken", "violation"),
    *("lowest", "overshoot", "ledger", "residual", "iterations", "estimate", "tolerance", "error", "scaling"),
    *("nodes", "seconds", "warnings"),
)


def stress(
    out: Path,
    *,
    quick: bool = False,
    panels: Sequence[Panel] = PANELS,
    time_limit: float = TIME_LIMIT,
    report: Callable[[str], None] = print,
) -> int:
    """Run the grid of scenes; write ``stress.csv``, ``stress.md`` and ``stress.png``.

    Parameters
    ----------
    out : Path
        Folder of the three files.
    quick : bool
        Few values on each axis.
    panels : sequence of Panel
    time_limit : float
        Seconds after which a scene counts as hung.
    report : callable
        Called with lines of text on the way, and with the map in words.

    Returns
    -------
    int
        0 if no rule is broken by a method that may not, else 1.

    Raises
    ------
    InputError
        If `out` cannot be written to.
    RunError
        If the files cannot be written.
    """
    check_writable(out)
    panels = [panel.quick() for panel in panels] if quick else panels
    total = sum(len(panel.places()) * len(panel.methods) for panel in panels)
    report(f"{total} runs on {len(panels)} pairs of axes")
    runs: list[Run] = []
    # None of an earlier version.
    with tempfile.TemporaryDirectory(prefix="tetlux-stress-") as meshes:
        for run in runs_of(panels, meshes=Path(meshes), time_limit=time_limit):
            runs.append(run)
            if len(runs) % PROGRESS == 0:
                report(f"{len(runs)} of {total}, {sum(map(bool, map(violations, runs)))} of them violations")
    runs = _in_order(runs, panels)
    words = in_words(runs)
    _write(runs, words, out)
    report(words)
    report(f"written to {out}: {', '.join(FILES)}")
    return 1 if any(map(violations, runs)) else 0


def _in_order(runs: list[Run], panels: Sequence[Panel]) -> list[Run]:
    """Runs as they stand on the map, and not as they ended."""
    names = [panel.name for panel in panels]

    def key(run: Run) -> tuple[int, int, int]:
        panel = run.panel
        return names.index(panel.name), panel.methods.index(run.method), panel.places().index((run.x, run.y))

    return sorted(runs, key=key)


def _write(runs: Sequence[Run], words: str, out: Path) -> None:
    """Write the files, whole: into a folder beside them first."""
    with claimed(out, ".") as folder:
        try:
            with (folder / "stress.csv").open("w", newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, COLUMNS, extrasaction="ignore")
                writer.writeheader()
                writer.writerows(map(_as_row, runs))
            (folder / "stress.md").write_text(words, encoding="utf-8")
            draw_map(runs, folder / "stress.png")
            publish(folder, out, FILES)
        except OSError as error:
            raise cannot_write(out, error) from error


def _as_row(run: Run) -> dict[str, Any]:
    figures = {} if run.figures is None else asdict(run.figures)
    return {
        **figures,
        "panel": run.panel.name,
        "x_name": run.panel.x.name,
        "x": run.x,
        "y_name": run.panel.y.name,
        "y": run.y,
        "method": run.method.name,
        "outcome": run.outcome,
        "message": run.message,
        "broken": "; ".join(f"{rule}: {figure}" for rule, figure in broken(run).items()),
        "violation": bool(violations(run)),
        "tolerance": TOLERANCE,
        "warnings": " ".join(figures.get("warnings", ())),
    }
