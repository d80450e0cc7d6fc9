"""The case files that ship with the package, and which file a name on the command line stands for.

Nothing heavy is imported here: ``tetlux list`` and ``tetlux show`` have to answer at once.
"""

import json
import os
import re
from pathlib import Path

from tetlux.cases.hints import did_you_mean

# Of case files; JSON is YAML.
SUFFIXES = (".yaml", ".yml", ".json")


def library_folder() -> Path:
    """The folder of the case files that ship with the package."""
    return Path(__file__).with_name("library")


def shipped_cases() -> dict[str, str]:
    """Names of the case files that ship, and the sentence at the top of each."""
    files = sorted(library_folder().glob("*.yaml"))
    return {path.stem: path.read_text(encoding="utf-8").splitlines()[0].lstrip("# ") for path in files}


def find_case_file(request: str) -> Path:
    """A path as given, or the shipped case file of that name where there is no such path.

    Raises
    ------
    InputError
        If it is neither, or a surface file.
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
                f"{request}{': ' + hint + 'it' if hint else ''} is neither a file nor one of the cases that ship: "
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
    """The text of a case file, or of one that ships: with the full path of its surface, so that a copy of it runs.

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
    # A string of JSON is one of YAML, whatever is in the path.
    return re.sub(r"(?<=file: )[\w.-]+", lambda name: json.dumps(str(library_folder() / name[0])), text)


def _input_error(sentence: str) -> Exception:
    from tetlux.meshing.errors import InputError  # noqa: PLC0415 - takes half a second

    return InputError(sentence)
