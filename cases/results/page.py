"""``index.html`` of a batch: its table, thumbnails, and a plot, in one file that asks nothing of any server."""

import base64
import io
import json
import math
import os
from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from tetlux.cases.results.rows import FIGURES, READING, SECONDS, Row, swept_keys
from tetlux.cases.results.table_file import replace_file
from tetlux.meshing.errors import InputError

# Height of a thumbnail in pixels, and how many there are: 200 take about 2 MB.
HEIGHT, MOST_THUMBNAILS = 96, 200
# The first picture of a run, or one with a name of its own.
PICTURES = ("picture.png", "picture-*.png", "picture*.gif")
# Units of swept keys, by the last part of their names.
SWEPT_UNITS = {
    **dict.fromkeys(("sigma_a", "sigma_s", "sigma_s_prime"), "1/unit"),
    **dict.fromkeys(("radius", "depth", "width", "height", "position", "origin", "center"), "unit"),
    "power": "W",
    "irradiance": "W/unit²",
    "density": "W/unit³",
}
# By which a page is known to be one.
TITLE = "<title>tetlux results</title>"


def check_page(path: Path) -> None:
    """Refuse to replace a file that is no page of a batch.

    Raises
    ------
    InputError
    """
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            first = file.read(4096)
    except OSError:
        return
    if first.strip() and TITLE not in first:
        raise InputError(f"{path} is no page of tetlux; move it, or choose another folder with --out.")


def write_page(path: Path, rows: Sequence[Row], columns: Sequence[str]) -> None:
    """Write the page of a batch.

    Parameters
    ----------
    path : Path
        The file to write, in the folder that the runs are in.
    rows : sequence of dict
    columns : sequence of str

    Raises
    ------
    OSError, RunError
        If it cannot be written.
    """
    shown = [name for name in columns if any(row.get(name) is not None for row in rows)]
    data = {
        "columns": shown,
        "units": {name: _unit(name) for name in shown},
        "swept": swept_keys(shown),
        "rows": [[_plain(row.get(name)) for name in shown] for row in rows],
        "pictures": _thumbnails(path.parent, rows),
    }
    # In a script of HTML, "<" could begin its end.
    text = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    page = Path(__file__).with_name("page.html").read_text(encoding="utf-8")
    replace_file(path, page.replace("DATA", text, 1))


def _unit(column: str) -> str:
    if column.startswith(SECONDS):
        return "s"
    if column.startswith(READING):
        return "1" if column.endswith(".relative_error") else "W, or W/unit² at a point"
    unit = FIGURES.get(column) or SWEPT_UNITS.get(column.rstrip(".0123456789").rpartition(".")[2], "")
    return "" if unit in ("1", "unit of length") else unit


def _plain(value: Any) -> Any:
    """A value as the page shows it: numbers, text or nothing."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return json.dumps(value) if isinstance(value, list | dict) else value


def _thumbnails(folder: Path, rows: Sequence[Row]) -> dict[str, tuple[str, str]]:
    """Names of the pictures of the first runs that have one, and small ones as data addresses, by the run's name."""
    from PIL import Image  # noqa: PLC0415 - only needed where there are pictures

    found: dict[str, tuple[str, str]] = {}
    for run in dict.fromkeys(row["run"] for row in rows):
        if len(found) == MOST_THUMBNAILS:
            break
        picture = _first_picture(folder / run)
        if picture is None:
            continue
        try:
            with Image.open(picture) as image:
                small = image.convert("RGB")
                small.thumbnail((4 * HEIGHT, HEIGHT))
        except (OSError, ValueError, SyntaxError):
            continue
        target = io.BytesIO()
        small.save(target, "JPEG", quality=80)
        found[run] = picture.name, "data:image/jpeg;base64," + base64.b64encode(target.getvalue()).decode()
    return found


def _first_picture(folder: Path) -> Path | None:
    """The picture of a run by which it is shown."""
    try:
        names = sorted(os.listdir(folder))  # noqa: PTH208 - quick, and most runs of large batches have none
    except OSError:
        return None
    return next((folder / name for pattern in PICTURES for name in names if fnmatchcase(name, pattern)), None)
