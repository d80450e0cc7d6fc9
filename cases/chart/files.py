"""The files of a chart: a table, the same as JSON, and a picture."""

import csv
import json
import os
import platform
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from tetlux.cases.chart.peers import PEERS
from tetlux.cases.chart.picture import draw_chart
from tetlux.cases.chart.runs import MeasuredBenchmark, Measurement, exponents
from tetlux.cases.write.publish import replace_files
from tetlux.cases.write.summary import LIBRARIES
from tetlux.meshing.host.libraries import installed_versions


def chart_files(name: str) -> tuple[str, str, str]:
    """The files of a chart."""
    return f"{name}.csv", f"{name}.png", f"{name}.json"


def write_chart(measured: Sequence[MeasuredBenchmark], out: Path, name: str) -> None:
    """Write the three files, all or none.

    Parameters
    ----------
    measured : sequence of MeasuredBenchmark
    out : Path
        Their folder.
    name : str
        Of the files, without their suffix.

    Raises
    ------
    RunError
        If they cannot be written.
    """
    table, picture, data = chart_files(name)
    with replace_files(out, (table, picture, data)) as folder:
        _write_table([run for entry in measured for run in entry.runs], folder / table)
        draw_chart(measured, folder / picture)
        text = json.dumps(as_data(measured), indent=2, allow_nan=False)
        (folder / data).write_text(text + "\n", encoding="utf-8")


def _write_table(runs: Sequence[Measurement], path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Measurement)])
        writer.writeheader()
        writer.writerows(asdict(run) for run in runs)


def as_data(measured: Sequence[MeasuredBenchmark]) -> dict[str, Any]:
    """Convert a chart to plain data."""
    return {
        "cases": {entry.benchmark.case.name: _case_as_data(entry) for entry in measured},
        "runs": [asdict(run) for entry in measured for run in entry.runs],
        "seconds": "from the surface in memory to the exitance at the surface, without imports and mesh cache",
        "error": f"{measured[0].benchmark.quantity}; for Monte Carlo, which solves radiative transfer, the difference "
        "between the two models",
        "machine": {"cores": os.cpu_count(), "processor": platform.machine()},
        "versions": {"python": platform.python_version()}
        | installed_versions((*LIBRARIES, *(peer.package for peer in PEERS))),
    }


def _case_as_data(measured: MeasuredBenchmark) -> dict[str, Any]:
    benchmark = measured.benchmark
    surface, reference = benchmark.case.surface, benchmark.reference
    return {
        "unit": surface.unit,
        "triangles": len(surface.faces),
        "samples": len(benchmark.samples.points),
        "reference": {"kind": reference.kind, "is": reference.description, "error": reference.error},
        "exponents": exponents(measured.runs),
    }
