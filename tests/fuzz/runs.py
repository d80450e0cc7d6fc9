"""All malformed inputs, each put through the command line."""

import contextlib
import os
import tempfile
import time
from collections.abc import Callable, Collection, Iterator
from pathlib import Path

import yaml
from hypothesis import HealthCheck, Phase, given, seed, settings

from tests.elsewhere import start_elsewhere
from tests.fuzz.case_files import case_files, companions, traps
from tests.fuzz.outcome import Outcome, complaint, outcome_of
from tests.fuzz.surfaces import Malformed, surfaces
from tests.fuzz.volumes import MESH, case_of, volumes
from tetlux.cases.file.load import load_cases

# What file systems hold.
LONGEST_NAME = 255


def check_case_files(folder: Path, count: int) -> Iterator[Outcome]:
    """Check the traps, and so many case files that hypothesis makes."""
    companions(folder)
    path = folder / "case.yaml"
    for name, content in traps():
        path.write_bytes(content)
        yield _within_the_folder(outcome_of(f"trap: {name}", ["check", str(path)]), path)
    yield from check_made(folder, count)


def check_made(folder: Path, count: int, number: int = 0) -> Iterator[Outcome]:
    """Check so many case files that hypothesis makes from a seed, no content twice."""
    path = folder / "case.yaml"
    for content in made(count, number):
        path.write_bytes(content)
        yield _within_the_folder(outcome_of(f"made: {content!r}", ["check", str(path)]), path)


class EnoughError(Exception):
    """So many inputs are made as were asked for."""


def made(count: int, number: int = 0) -> list[bytes]:
    """So many different case files, the same for a seed."""
    found: dict[bytes, None] = {}

    @seed(number)
    # About a quarter of what it makes is the same again.
    @settings(
        max_examples=2 * count,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(case_files())
    def collect(content: bytes) -> None:
        found[content] = None
        if len(found) >= count:
            raise EnoughError

    with contextlib.suppress(EnoughError):
        collect()
    return list(found)[:count]


def _within_the_folder(outcome: Outcome, path: Path) -> Outcome:
    """Whether the results of a case that is right would all be below the folder that is asked for."""
    if outcome.code != 0 or outcome.violation:
        return outcome
    for case in load_cases(path):
        parts = Path(case.name).parts
        wrong = Path(case.name).is_absolute() or {".", ".."} & set(parts) or not case.name.isprintable()
        if wrong or not parts or max(len(part.encode()) for part in parts) > LONGEST_NAME:
            return Outcome(outcome.name, 0, outcome.words, f"results would be written to {case.name!r}")
    return outcome


def write_surface(folder: Path, malformed: Malformed, tolerance: float = 0.02) -> Path:
    """A case file that is right but for its surface, which is written beside it."""
    file = folder / f"body.{malformed.suffix}"
    file.write_bytes(malformed.content)
    # Twenty mean free paths, if it is of the size that it should be.
    across = 20.0 / malformed.size
    case = {
        "surface": {"file": file.name, "holes": malformed.holes},
        "medium": {"sigma_a": 0.01 * across, "sigma_s_prime": across, "eta": 1.4},
        "lights": [{"diffuse": {"irradiance": 1.0}}],
        "tolerance": tolerance,
        "outputs": ["surface"],
    }
    path = folder / "case.yaml"
    path.write_text(yaml.safe_dump(case), encoding="utf-8")
    return path


def check_surfaces(folder: Path, number: int = 0) -> Iterator[Outcome]:
    """Read, mend and check each of the surfaces of a seed."""
    for malformed in surfaces(number):
        path = write_surface(folder, malformed)
        yield outcome_of(f"surface: {malformed.name}", ["check", str(path)])


def run_surfaces(folder: Path, limit: float, names: Collection[str] = ()) -> Iterator[Outcome]:
    """Solve what a check lets pass, each in a process of its own, so that signals and hangs are seen.

    Parameters
    ----------
    folder : Path
    limit : float
        Seconds that one may take.
    names : collection of str
        Of those that are run; all if none are given.
    """
    for malformed in surfaces():
        if names and malformed.name not in names:
            continue
        path = write_surface(folder, malformed, tolerance=0.5)
        if outcome_of("", ["check", str(path)]).code != 0:
            continue
        name = f"run: {malformed.name}"
        started = time.perf_counter()
        process = start_elsewhere(["run", str(path), "--out", str(folder / "out"), "--no-cache"], folder)
        process.join(limit)
        if process.is_alive():
            process.kill()
            yield Outcome(name, None, "", f"took more than {limit:g} s", limit)
            continue
        printed, complaints = ((folder / stream).read_text(encoding="utf-8") for stream in ("stdout", "stderr"))
        violation = complaint(process.exitcode, printed, complaints, (0, 1))
        words = complaints if process.exitcode else printed
        yield Outcome(name, process.exitcode, words.strip(), violation, time.perf_counter() - started)


def check_volumes(folder: Path, number: int = 0) -> Iterator[Outcome]:
    """Read each file of coefficients, each image and each mesh, and solve on the meshes that are let pass."""
    for malformed in volumes(number):
        file = folder / f"data.{malformed.suffix}"
        file.write_bytes(malformed.content)
        path = folder / "case.yaml"
        path.write_text(yaml.safe_dump(case_of(malformed.kind, file.name)), encoding="utf-8")
        for suffix, content in malformed.beside.items():
            (folder / f"data.{suffix}").write_bytes(content)
        found = outcome_of(f"{malformed.kind}: {malformed.name}", ["check", str(path)])
        yield found
        if malformed.kind == MESH and found.code == 0 and "wrong" not in malformed.name:
            run = ["run", str(path), "--out", str(folder / "out")]
            yield outcome_of(f"run: {malformed.name}", run, allowed=(0, 1))
        for suffix in malformed.beside:
            (folder / f"data.{suffix}").unlink()


def in_a_folder(outcomes: Callable[[Path], Iterator[Outcome]]) -> list[Outcome]:
    """What comes of inputs in a folder of their own, which holds nothing else afterwards but them."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as name:
        folder, elsewhere = Path(name, "inputs"), Path(name, "elsewhere")
        folder.mkdir()
        elsewhere.mkdir()
        os.chdir(elsewhere)
        try:
            found = list(outcomes(folder))
            # Something in a file was taken for an instruction.
            left = [path.name for path in elsewhere.iterdir()]
        finally:
            os.chdir(before)
    if left:
        found.append(Outcome("afterwards", None, "", f"left behind: {', '.join(left)}"))
    return found
