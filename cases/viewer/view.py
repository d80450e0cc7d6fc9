"""`open_viewer`: open the viewer of a run in the browser."""

import webbrowser
from pathlib import Path

from tetlux.cases.viewer import PAGE
from tetlux.meshing.errors import InputError


def open_viewer(result: Path) -> Path:
    """Open ``viewer.html`` of a run in the web browser.

    Parameters
    ----------
    result : Path
        The folder of the run, or the page itself.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    InputError
        If there is no page, or no browser.
    """
    page = result if result.is_file() and result.suffix == ".html" else result / PAGE
    if not page.is_file():
        if not result.exists():
            raise InputError(f"there is no folder {result}; give the folder of a finished run.")
        raise InputError(f"{result} has no {PAGE}; add viewer to outputs in the case file, and run it again.")
    if not webbrowser.open(page.resolve().as_uri()):
        raise InputError(f"no web browser was found; open {page.resolve()} in one.")
    return page
