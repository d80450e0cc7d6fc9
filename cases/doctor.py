"""`describe_machine`: what a report of an error should say of the machine and of what is installed."""

import os
import platform
import subprocess
import sys
import webbrowser
from collections.abc import Iterator
from pathlib import Path

from tetlux.fem.memory import available, gigabytes
from tetlux.meshing.host.blocks import CORES
from tetlux.meshing.host.libraries import installed_versions
from tetlux.meshing.mesher.cache import LARGEST_CACHE, cache_directory

# What is used where it is installed, and what is done without it.
LIBRARIES = {
    "numpy": "nothing works",
    "scipy": "nothing works",
    "pytetwild": "surfaces cannot be meshed; give tetrahedra of your own",
    "pyamg": "large meshes are solved more slowly",
    "embreex": "rays are followed more slowly",
    "matplotlib": "comparisons and charts are not drawn",
    "pyvista": "solution.plot() and to_pyvista() are missing",
    "distributed": 'no clusters; pip install "tetlux[cluster]"',
    "pandas": 'no load_results; pip install "tetlux[tables]"',
    "pyarrow": 'no results.parquet; pip install "tetlux[tables]"',
}
# Prints what draws windows of PyVista, or why none is drawn.
ASK_OPENGL = """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(64, 64))
plotter.add_mesh(pyvista.Sphere())
plotter.screenshot(return_img=True)
words = dict(line.split(":", 1) for line in plotter.render_window.ReportCapabilities().splitlines() if ":" in line)
print(words["OpenGL renderer string"].strip() + ", OpenGL " + words["OpenGL version string"].strip())
"""
SECONDS_FOR_OPENGL = 60


def describe_machine() -> Iterator[tuple[str, str]]:
    """Describe this machine, a name and a sentence each.

    Yields
    ------
    (str, str)
        Version, system, cores, memory, mesh cache, libraries with what is done without missing ones, OpenGL, browser.

    Examples
    --------
    >>> next(describe_machine())[0]
    'tetlux'
    """
    versions = installed_versions(("tetlux", *LIBRARIES))
    yield "tetlux", f"{versions.get('tetlux', 'not installed')}, Python {platform.python_version()} in {sys.prefix}"
    yield "system", f"{platform.platform()}, {platform.machine()}"
    yield "cores", f"{CORES} of {os.cpu_count()} may be used"
    memory = available()
    yield "memory", f"{gigabytes(memory)} GB are available" if memory < float("inf") else "not known"
    yield "mesh cache", _describe_cache(cache_directory())
    for name, without in LIBRARIES.items():
        yield name, versions.get(name) or f"missing: {without}"
    yield "OpenGL", _describe_opengl() if "pyvista" in versions else "not asked: pyvista is missing"
    yield "browser", _describe_browser()


def _describe_cache(folder: Path | None) -> str:
    if folder is None:
        return "none: there is no home folder; set TETLUX_CACHE_DIR"
    if not folder.exists():
        return f"{folder}, empty"
    sizes = [path.stat().st_size for path in folder.rglob("*") if path.is_file()]
    written = "" if os.access(folder, os.W_OK) else ", which cannot be written to"
    return f"{folder}{written}: {len(sizes):,} files, {sum(sizes) / 1e6:,.0f} of {LARGEST_CACHE / 1e6:,.0f} MB"


def _describe_opengl() -> str:
    """What draws PyVista's windows, asked in a process of its own, which a bad driver may end."""
    try:
        asked = subprocess.run(
            [sys.executable, "-c", ASK_OPENGL], capture_output=True, text=True, timeout=SECONDS_FOR_OPENGL, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return "does not answer; pictures and the viewer do not need it, only solution.plot() does"
    if asked.returncode:
        return "missing; pictures and the viewer do not need it, only solution.plot() does"
    return asked.stdout.strip().splitlines()[-1]


def _describe_browser() -> str:
    try:
        return f"{webbrowser.get().name} opens tetlux view"
    except webbrowser.Error:
        return "none found: open viewer.html by hand"
