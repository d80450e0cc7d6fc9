"""Spectra read from text files of two columns."""

import re
from pathlib import Path

from tetlux.fem.media.spectra import Spectrum, SpectrumKind
from tetlux.meshing.errors import InputError
from tetlux.meshing.host.filesystem import is_file

# Far more rows than a spectrum has.
MOST_BYTES = 10_000_000


def read_spectrum(path: str | Path, kind: SpectrumKind) -> Spectrum:
    """Read a spectrum from a text file.

    Each line has a wavelength, nm, and a value, separated by spaces, a tab, a comma or a semicolon. Empty lines, lines
    that begin with #, and headings above the first row are passed over.

    Parameters
    ----------
    path : str or Path
    kind : {"extinction", "absorption"}
        Whether values are molar extinction coefficients, 1/(cm mol/l), base 10, or absorption coefficients of the pure
        substance, 1/mm, base e.

    Returns
    -------
    Spectrum

    Raises
    ------
    InputError
        If the file is missing or unreadable, a line does not hold two numbers, or the values are no spectrum.
    """
    path = Path(path)
    rows: list[tuple[float, float]] = []
    for number, line in enumerate(_read_text(path).splitlines(), 1):
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        row = _row(text)
        if row is not None:
            rows.append(row)
        elif rows or re.match(r"[-+.\d]", text):
            raise InputError(f'{path}, line {number}: "{text[:40]}" is not a wavelength and a value; give two numbers.')
    if len(rows) < 2:
        raise InputError(f"{path} holds {len(rows)} rows; give a wavelength, nm, and a value in each, at least two.")
    try:
        wavelengths, values = zip(*sorted(rows), strict=True)
        return Spectrum(wavelengths, values, kind)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _read_text(path: Path) -> str:
    if not is_file(path):
        raise InputError(f"{path} is not a file; give a text file of wavelengths and values.")
    try:
        if path.stat().st_size > MOST_BYTES:
            raise InputError(f"{path} is too large for a spectrum; give a text file of two columns.")
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 text; give a text file of two columns.") from error


def _row(text: str) -> tuple[float, float] | None:
    """The two numbers of a line; None if it holds anything else."""
    parts = re.split(r"\s*[,;]\s*|\s+", text)
    try:
        wavelength, value = map(float, parts)
    except ValueError:
        return None
    return wavelength, value
