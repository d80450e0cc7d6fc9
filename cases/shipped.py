"""The case files that ship with the package, and the look-up of case files by path or shipped name.

Modules that need numpy are not imported here, so that ``tetlux list`` and ``tetlux show`` answer at once.
"""

import glob
import json
import os
import re
from pathlib import Path

from tetlux.cases.hints import did_you_mean

# Suffixes of case files; JSON is a subset of YAML.
SUFFIXES = (".yaml", ".yml", ".json")
# In the library: what tetlux schema prints. Shipped cases name it in a comment.
SCHEMA = "case.schema.json"


def library_folder() -> Path:
    """The folder of the case files that ship with the package."""
    return Path(__file__).with_name("library")


def shipped_cases() -> dict[str, str]:
    """Names of the shipped case files, each with the sentence in its first line."""
    files = sorted(library_folder().glob("*.yaml"), key=lambda path: path.stem)
    return {path.stem: path.read_text(encoding="utf-8").splitlines()[0].lstrip("# ") for path in files}


def schema_line() -> str:
    """The comment by which editors find the JSON Schema of case files, and complete and check their keys."""
    return f"# yaml-language-server: $schema={(library_folder() / SCHEMA).as_uri()}"


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


def find_case_files(request: str) -> list[Path]:
    """Find the case files of a request: of a pattern with ``*``, ``?`` or ``[...]`` all that it matches, else one.

    ``**`` stands for any folders. Shells expand patterns themselves, but not quoted ones, and not on Windows.

    Parameters
    ----------
    request : str
        Path of a case file, name of a shipped one, or a pattern.

    Returns
    -------
    list of Path
        In the order of their paths.

    Raises
    ------
    InputError
        If there is none.

    Examples
    --------
    >>> [path.name for path in find_case_files("torus")]
    ['torus.yaml']
    """
    if not glob.has_magic(request) or os.path.exists(request):  # noqa: PTH110
        return [find_case_file(request)]
    try:
        matches = sorted(map(Path, glob.glob(request, recursive=True)))  # noqa: PTH207 - Path.glob takes no full paths
    except (OSError, ValueError, re.error):
        matches = []
    paths = [path for path in matches if path.suffix.lower() in SUFFIXES and path.is_file()]
    if not paths:
        raise _input_error(f"{request} matches no case file; check the pattern, and the folder that it starts from.")
    return paths


def _refuse_surface(path: Path) -> None:
    from tetlux.meshing.files.surfaces import SUFFIXES  # noqa: PLC0415

    if path.suffix.lower() in SUFFIXES:
        raise _input_error(f"{path} is a surface file; name it in a case file, as surface: {{file: {path.name}}}.")


def case_text(request: str) -> str:
    """Read the text of a case file; in a shipped one paths are made absolute, so that a copy runs.

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
    text = text.replace(f"# yaml-language-server: $schema={SCHEMA}", schema_line())
    # JSON quotes the path as YAML needs it, whatever characters it has.
    return re.sub(r"(?<=file: )[\w.-]+", lambda name: json.dumps(str(library_folder() / name[0])), text)


def _input_error(sentence: str) -> Exception:
    from tetlux.meshing.errors import InputError  # noqa: PLC0415 - takes half a second

    return InputError(sentence)
