"""The case files that ship with the package, and the look-up of case files by path or shipped name.

Modules that need numpy are not imported here, so that ``tetlux list`` and ``tetlux show`` answer at once.
"""

import json
import os
import re
from pathlib import Path

from tetlux.cases.hints import did_you_mean

# Suffixes of case files; JSON is a subset of YAML.
SUFFIXES = (".yaml", ".yml", ".json")


def library_folder() -> Path:
    """The folder of the case files that ship with the package."""
    return Path(__file__).with_name("library")


def shipped_cases() -> dict[str, str]:
    """Names of the shipped case files, each with the sentence in its first line."""
    files = sorted(library_folder().glob("*.yaml"))
    return {path.stem: path.read_text(encoding="utf-8").splitlines()[0].lstrip("# ") for path in files}


def find_case_file(request: str) -> Path:
    """Find a case file by its path or, if no such path exists, by the name of a shipped one.

    Parameters
    ----------
    request : str
        Path of a case file, or name of a shipped one.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If it is neither, or is a surface file.

    Examples
    --------
    >>> find_case_file("hare").name
    'hare.yaml'
    """
    path = Path(request)
    # Path.exists raises where a name is too long for the file system.
    known = os.path.exists(path)  # noqa: PTH110
    if not known and path.name == request:
        if (library_folder() / f"{request}.yaml").is_file():
            return library_folder() / f"{request}.yaml"
        if not path.suffix:
            names = sorted(path.stem for path in library_folder().glob("*.yaml"))
            hint = did_you_mean(request, names)
            raise _input_error(
                f"{request}{': ' + hint + 'it' if hint else ''} is neither a file nor one of the shipped cases: "
                f"{', '.join(names)}."
            )
    if path.suffix.lower() not in ("", *SUFFIXES):
        _refuse_surface(path)
    return path


def _refuse_surface(path: Path) -> None:
    from tetlux.meshing.files.surfaces import SUFFIXES  # noqa: PLC0415

    if path.suffix.lower() in SUFFIXES:
        raise _input_error(f"{path} is a surface file; name it in a case file, as surface: {{file: {path.name}}}.")


def case_text(request: str) -> str:
    """Read the text of a case file; in a shipped one the path of its surface is made absolute, so that a copy runs.

    Parameters
    ----------
    request : str
        Path of a case file, or name of a shipped one.

    Returns
    -------
    str

    Raises
    ------
    InputError
        If there is no such file, or it is no text.
    """
    path = find_case_file(request)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (UnicodeDecodeError, ValueError) as error:
        raise _input_error(f"{path} is not UTF-8 text; give a YAML case file.") from error
    except OSError as error:
        raise _input_error(f"{path} cannot be read: {error.strerror}; give a YAML case file.") from error
    if path.parent != library_folder():
        return text
    # JSON quotes the path as YAML needs it, whatever characters it has.
    return re.sub(r"(?<=file: )[\w.-]+", lambda name: json.dumps(str(library_folder() / name[0])), text)


def _input_error(sentence: str) -> Exception:
    from tetlux.meshing.errors import InputError  # noqa: PLC0415 - takes half a second

    return InputError(sentence)
