"""`tetlux stress`: run scenarios at extreme values, and map where the solver fails."""

import csv
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tetlux.cases.stress.grid import PANELS
from tetlux.cases.stress.panels import Panel
from tetlux.cases.stress.picture import draw_map
from tetlux.cases.stress.report import as_markdown
from tetlux.cases.stress.rules import broken_rules, violations
from tetlux.cases.stress.scenes.scenarios import TOLERANCE
from tetlux.cases.stress.trials import TIME_LIMIT, Trial, run_trials
from tetlux.cases.write.publish import check_writable, replace_files

FILES = ("stress.csv", "stress.md", "stress.png")
COLUMNS = (
    *("panel", "x_name", "x", "y_name", "y", "method", "outcome", "message", "broken", "violation"),
    *("lowest", "overshoot", "ledger", "residual", "iterations", "estimate", "tolerance", "error", "bound", "scaling"),
    *("nodes", "seconds", "warnings"),
)
# Trials between two progress lines.
PROGRESS = 50


def stress(
    out: Path,
    *,
    quick: bool = False,
    panels: Sequence[Panel] = PANELS,
    time_limit: float = TIME_LIMIT,
    report: Callable[[str], None] = print,
) -> int:
    """Run the grid of scenarios; write ``stress.csv``, ``stress.md`` and ``stress.png``.

    Parameters
    ----------
    out : Path
        Folder of the three files.
    quick : bool
        Whether to run a few values on each axis only.
    panels : sequence of Panel
    time_limit : float
        Seconds after which a trial counts as hung.
    report : callable
        Called with progress lines, and with the map as text.

    Returns
    -------
    int
        1 if a variant that counts breaks a rule, else 0.

    Raises
    ------
    InputError
        If `out` cannot be written to.
    RunError
        If the files cannot be written.
    """
    check_writable(out)
    panels = [panel.quick() for panel in panels] if quick else panels
    total = sum(len(panel.places()) * len(panel.variants) for panel in panels)
    report(f"{total} runs on {len(panels)} pairs of axes")
    trials: list[Trial] = []
    # An empty cache, so that no mesh was made by an earlier version of the mesher.
    with tempfile.TemporaryDirectory(prefix="tetlux-stress-") as meshes:
        for trial in run_trials(panels, meshes=Path(meshes), time_limit=time_limit):
            trials.append(trial)
            if len(trials) % PROGRESS == 0:
                report(f"{len(trials)} of {total} done, {sum(map(bool, map(violations, trials)))} violations")
    trials = _sort(trials, panels)
    text = as_markdown(trials)
    write_map(trials, text, out)
    report(text)
    report(f"written to {out}: {', '.join(FILES)}")
    return 1 if any(map(violations, trials)) else 0


def _sort(trials: list[Trial], panels: Sequence[Panel]) -> list[Trial]:
    """Sort trials by their places on the map."""
    names = [panel.name for panel in panels]

    def key(trial: Trial) -> tuple[int, int, int]:
        panel = trial.panel
        return names.index(panel.name), panel.variants.index(trial.variant), panel.places().index((trial.x, trial.y))

    return sorted(trials, key=key)


def write_map(trials: Sequence[Trial], text: str, out: Path) -> None:
    """Write the three files, all or none.

    Raises
    ------
    RunError
        If they cannot be written.
    """
    with replace_files(out, FILES) as folder:
        with (folder / "stress.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS, extrasaction="ignore")
            writer.writeheader()
            writer.writerows(map(_as_row, trials))
        (folder / "stress.md").write_text(text, encoding="utf-8")
        draw_map(trials, folder / "stress.png")


def _as_row(trial: Trial) -> dict[str, Any]:
    diagnostics = {} if trial.diagnostics is None else asdict(trial.diagnostics)
    return {
        **diagnostics,
        "panel": trial.panel.name,
        "x_name": trial.panel.x.name,
        "x": trial.x,
        "y_name": trial.panel.y.name,
        "y": trial.y,
        "method": trial.variant.name,
        "outcome": trial.outcome,
        "message": trial.message,
        "broken": "; ".join(f"{rule}: {figure}" for rule, figure in broken_rules(trial).items()),
        "violation": bool(violations(trial)),
        "tolerance": TOLERANCE,
        "warnings": " ".join(diagnostics.get("warnings", ())),
    }
