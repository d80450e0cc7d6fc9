"""`read_table`: a CSV file of readings, in the form of ``detectors.csv``."""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.host.filesystem import is_file

# Far more than readings take.
MOST_BYTES = 10_000_000
# Rows of all lights together, which a table has beside those of each light.
ALL = "all"
NAME, CHANNEL, LIGHT, EXITANCE, PHASE, NOISE = "name", "channel", "light", "exitance", "phase", "noise"


@dataclass(frozen=True)
class Names:
    """Names in a case, in its order.

    Attributes
    ----------
    channels, lights, detectors : tuple of str
    """

    channels: tuple[str, ...]
    lights: tuple[str, ...]
    detectors: tuple[str, ...]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Of arrays of readings."""
        return len(self.channels), len(self.lights), len(self.detectors)


def read_table(path: Path, names: Names, unit: str, *, modulated: bool) -> tuple[NumberArray, FloatArray | None]:
    """Read exitances, and their noise where there is a column of it.

    Parameters
    ----------
    path : Path
    names : Names
    unit : str
        Of length.
    modulated : bool
        Whether there is a column of phases.

    Returns
    -------
    readings : (c, l, d) ndarray
        W/unit², complex of modulated light; nan where the table has none.
    noise : (c, l, d) ndarray or None
        Relative standard deviations.

    Raises
    ------
    InputError
        With the file, and the line.
    """
    rows = list(csv.reader(_lines(path)))
    if len(rows) < 2:
        raise InputError(f"{path} has no rows; give a heading, and a row for each reading.")
    columns = _columns(path, rows[0], unit)
    needed = [NAME, EXITANCE, *([PHASE] if modulated else [])]
    needed += [name for name, known in ((CHANNEL, names.channels), (LIGHT, names.lights)) if len(known) > 1]
    missing = [name for name in needed if name not in columns]
    if missing:
        raise InputError(f"{path} has no column {missing[0]}; its heading needs {', '.join(needed)}.")
    values: dict[tuple[int, int, int], NumberArray] = {}
    for number, row in enumerate(rows[1:], 2):
        cells = {name: row[column].strip() if column < len(row) else "" for name, column in columns.items()}
        place = None if not any(cells.values()) else _place(f"{path}, line {number}", cells, names)
        if place is None:
            continue
        if place in values:
            raise InputError(f"{path}, line {number}: this reading is given twice; give it once.")
        figures = [_figure(f"{path}, line {number}", name, cells.get(name, "")) for name in (EXITANCE, PHASE, NOISE)]
        values[place] = np.array(figures)
    return _arrays(values, names, modulated=modulated, has_noise=NOISE in columns)


def _arrays(
    values: dict[tuple[int, int, int], NumberArray], names: Names, *, modulated: bool, has_noise: bool
) -> tuple[NumberArray, FloatArray | None]:
    """Readings and noise as arrays (c, l, d), from exitance, phase and noise by place."""
    table = np.full((3, *names.shape), np.nan)
    for place, figures in values.items():
        table[(slice(None), *place)] = figures
    exitance, phase, noise = table
    return exitance * np.exp(-1j * np.radians(phase)) if modulated else exitance, noise if has_noise else None


def _lines(path: Path) -> list[str]:
    if not is_file(path):
        raise InputError(f"{path} is not a file; give a CSV file of readings.")
    try:
        if path.stat().st_size > MOST_BYTES:
            raise InputError(f"{path} is too large for readings; give a CSV file with a row for each.")
        return path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 text; give a CSV file of readings.") from error


def _columns(path: Path, heading: Sequence[str], unit: str) -> dict[str, int]:
    """Numbers of the columns, by their names without units."""
    columns: dict[str, int] = {}
    for number, text in enumerate(heading):
        name, _, of_unit = text.strip().partition("[")
        columns.setdefault(name.strip().lower(), number)
        found = re.search(r"W/([A-Za-z]+)", of_unit)
        if name.strip().lower() == EXITANCE and found and found[1] != unit:
            raise InputError(f"{path}: its exitance is in W/{found[1]}², and the case in {unit}; give W/{unit}².")
    return columns


def _place(where: str, cells: dict[str, str], names: Names) -> tuple[int, int, int] | None:
    """Numbers of channel, light and detector of a row; None of one of all lights together."""
    numbers = []
    for column, known in ((CHANNEL, names.channels), (LIGHT, names.lights), (NAME, names.detectors)):
        given = cells.get(column, "")
        if column == LIGHT and given == ALL and len(known) > 1:
            return None
        if len(known) == 1 and column != NAME and given in ("", ALL, *known):
            numbers.append(0)
        elif given in known:
            numbers.append(known.index(given))
        else:
            kind = "detector" if column == NAME else column
            raise InputError(f'{where}: "{given}" is no {kind} of the case, which has {", ".join(known)}.')
    channel, light, detector = numbers
    return channel, light, detector


def _figure(where: str, column: str, text: str) -> float:
    """A number, or nan of an empty cell."""
    try:
        return float(text) if text else float("nan")
    except ValueError:
        raise InputError(f'{where}: "{text[:40]}" is no number; give the {column} as one.') from None
