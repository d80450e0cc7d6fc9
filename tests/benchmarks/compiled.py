"""`compile_modules`: what is measured begins with compiled modules, as an installed package does."""

import atexit
import os
import shutil
import subprocess
import sys
import tempfile


def compile_modules() -> None:
    """Have commands that are started from now on find compiled modules, in a folder that this process removes.

    Where ``PYTHONDONTWRITEBYTECODE`` is set, as in containers, a working copy is compiled anew by each command, which
    takes half a second.
    """
    folder = tempfile.mkdtemp()
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    os.environ["PYTHONPYCACHEPREFIX"] = folder
    with tempfile.TemporaryDirectory() as out:
        subprocess.run(
            [sys.executable, "-m", "tetlux", "run", "sphere", "--out", out, "--quiet"],
            check=True,
            stdout=subprocess.DEVNULL,
        )
