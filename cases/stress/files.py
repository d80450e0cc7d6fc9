"""The files of the stress map: a table, the map as text, and a picture."""

import csv
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tetlux.cases.stress.picture import draw_map
from tetlux.cases.stress.rules import broken_rules, violations
from tetlux.cases.stress.scenarios import TOLERANCE
from tetlux.cases.stress.trials import Trial
from tetlux.cases.write.publish import replace_files

FILES = ("stress.csv", "stress.md", "stress.png")
COLUMNS = (
    *("panel", "x_name", "x", "y_name", "y", "method", "outcome", "message", "broken", "violation"),
    *("lowest", "overshoot", "ledger", "residual", "iterations", "estimate", "tolerance", "error", "bound", "scaling"),
    *("nodes", "seconds", "warnings"),
)


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
