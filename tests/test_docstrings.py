"""Examples in docstrings run and say what they promise."""

import doctest
import importlib
from pathlib import Path

import pytest

from tetlux import cases, fem, meshing

FOLDERS = {"tetlux.cases": cases, "tetlux.fem": fem, "tetlux.meshing": meshing}


def modules_with_examples() -> list[str]:
    found = []
    for name, package in FOLDERS.items():
        assert package.__file__ is not None
        root = Path(package.__file__).parent
        for path in sorted(root.rglob("*.py")):
            lines = path.read_text(encoding="utf-8").splitlines()
            # An example of a file that is not here is only read.
            if any(">>> " in line and "+SKIP" not in line for line in lines):
                found.append(".".join([name, *path.relative_to(root).with_suffix("").parts]))
    return found


def test_there_are_examples() -> None:
    assert {"tetlux.fem.exact.registry", "tetlux.fem.exact.sphere", "tetlux.meshing.notes"} <= set(
        modules_with_examples()
    )


@pytest.mark.parametrize("name", modules_with_examples())
def test_examples_run(name: str) -> None:
    failed, tried = doctest.testmod(importlib.import_module(name))
    assert tried > 0
    assert failed == 0
