"""Rows of the tables of a batch, made of the summaries of its runs."""

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import PurePosixPath
from typing import Any

Row = dict[str, Any]
# What a row is about.
HEAD = {
    "run": "folder of the run",
    "case": "name of the case",
    "channel": "",
    "status": "finished or failed",
    "reason": "why it failed",
}
# Figures of a channel of a run, with their units; "unit" is the unit of length that the column `unit` gives.
FIGURES = {
    "unit": "unit of length",
    "model": "",
    "tolerance": "1",
    "frequency": "Hz",
    "incident": "W",
    "specular": "W",
    "absorbed": "W",
    "exited": "W",
    "ballistic": "W",
    "stored": "W",
    "balance_error": "1",
    "exitance_min": "W/unit²",
    "exitance_max": "W/unit²",
    "exitance_mean": "W/unit²",
    "fluence_min": "W/unit²",
    "fluence_max": "W/unit²",
    "error_estimate": "1",
    "sigma_tr": "1/unit",
    "albedo": "1",
    "nodes": "",
    "tetrahedra": "",
    "charges": "",
}
READING_HEAD = {
    "run": HEAD["run"],
    "case": HEAD["case"],
    "channel": "",
    "light": "all, or one light",
    "detector": "its name",
    "kind": "",
}
READING_FIGURES = {
    "unit": "unit of length",
    "x": "unit",
    "y": "unit",
    "z": "unit",
    "exitance": "W/unit²",
    "power": "W",
    "phase": "degrees",
    "relative_error": "1",
    "model_error": "1",
}
# Columns of what detectors read (W, or W/unit² at a point), of fitted values and their errors, of seconds by stage, and
# of codes of warnings.
READING, FIT, SECONDS, WARNINGS = "reading.", "found.", "seconds_", "warnings"
# The light that stands for all of them.
ALL = "all"


def result_rows(summary: Mapping[str, Any]) -> list[Row]:
    """The rows of a finished run, one for each channel.

    Parameters
    ----------
    summary : mapping
        The content of its ``summary.json``.

    Returns
    -------
    list of dict
        Plain values by column; see `FIGURES` for units.
    """
    mesh = summary.get("mesh", {})
    rows = []
    for channel in summary.get("channels", ()):
        row: Row = {**_head(summary), "channel": channel["name"], "status": "finished"}
        row |= {"unit": summary["unit"], "model": summary["model"], "tolerance": summary.get("tolerance")}
        row |= {"frequency": channel.get("frequency")} | channel["power"]
        row |= {f"exitance_{name}": value for name, value in channel["exitance"].items()}
        row |= {f"fluence_{name}": value for name, value in channel.get("fluence", {}).items()}
        row |= {name: channel[name] for name in ("error_estimate", "sigma_tr", "albedo")}
        row |= {name: mesh.get(name) for name in ("nodes", "tetrahedra")}
        row["charges"] = channel.get("charges", {}).get("count")
        for reading in summary.get("detectors", ()):
            if reading["channel"] == channel["name"] and reading["light"] == ALL:
                value = reading["exitance"] if reading["power"] is None else reading["power"]
                row[f"{READING}{reading['name']}"] = value
                row[f"{READING}{reading['name']}.phase"] = reading.get("phase")
                row[f"{READING}{reading['name']}.relative_error"] = reading["relative_error"]
        for name, found in summary.get("fit", {}).get("values", {}).items():
            row |= {f"{FIT}{name}": found["value"], f"{FIT}{name}.error": found["error"]}
        row |= {f"{SECONDS}{stage}": value for stage, value in summary["seconds"].items()}
        row[WARNINGS] = " ".join(summary.get("warning_codes", ()))
        rows.append({name: value for name, value in (row | summary["as_ran"]["sweep"]).items() if value is not None})
    return rows


def failure_row(run: str, reason: str, sweep: Mapping[str, Any]) -> Row:
    """The row of a run that failed."""
    return {"run": run, "case": case_of(run), "status": "failed", "reason": reason, **sweep}


def reading_rows(summary: Mapping[str, Any]) -> list[Row]:
    """The rows of what the detectors of a finished run read, one for each detector, channel and light."""
    rows = []
    for reading in summary.get("detectors", ()):
        row = {**_head(summary), "detector": reading["name"], "unit": summary["unit"]}
        row |= {name: reading[name] for name in ("channel", "light", "kind", "exitance", "power")}
        row |= dict(zip("xyz", reading["position"], strict=True)) | {"phase": reading.get("phase")}
        row |= {name: reading[name] for name in ("relative_error", "model_error")}
        rows.append({name: value for name, value in (summary["as_ran"]["sweep"] | row).items() if value is not None})
    return rows


def case_of(run: str) -> str:
    """The name of the case of a run: the first folder of its name."""
    return PurePosixPath(run).parts[0]


def _head(summary: Mapping[str, Any]) -> Row:
    return {"run": summary["case"], "case": case_of(summary["case"])}


def swept_keys(columns: Iterable[str]) -> list[str]:
    """The columns of the results that hold swept values under the key of the case."""
    fixed = {*HEAD, *FIGURES, WARNINGS}
    return [name for name in columns if name not in fixed and not name.startswith((READING, FIT, SECONDS))]


def order_columns(columns: Iterable[str], head: Sequence[str], figures: Sequence[str]) -> list[str]:
    """Put columns in order: what a row is about, swept keys, figures, readings, fitted values, seconds, warnings.

    All of the first and of the figures are there, whether or not a row has them.
    """
    found = list(dict.fromkeys([*head, *columns]))
    fixed = {*head, *figures, WARNINGS}
    readings = [name for kind in (READING, FIT) for name in found if name.startswith(kind)]
    seconds = [name for name in found if name.startswith(SECONDS)]
    swept = [name for name in found if name not in {*fixed, *readings, *seconds}]
    return [*head, *swept, *figures, *readings, *seconds, *(name for name in found if name == WARNINGS)]


def cell(value: Any) -> str:
    """A value as text that does not depend on the language of the machine, with all its digits."""
    if value is None:
        return ""
    if isinstance(value, str):
        return value
    # `True` is no number here.
    return repr(value) if type(value) in (float, int) else json.dumps(value, ensure_ascii=False)
