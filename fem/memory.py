"""How much memory a solution needs, and how much there is."""

import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from tetlux.meshing.errors import RunError

# Bytes, by the peak memory of processes over what they had before, with the error estimated. Beside what is imported on
# the way, each tetrahedron needed so many kB:
#
#   of a given mesh, by its tetrahedra     48k    413k  1,296k   here
#   a point source                         .43     .92     .77   1.02
#   eight                                          .97           1.16
#   eight, and diffuse light                               .82   1.18
#   a beam on the whole body                       .97           1.02
#   the same in three channels                    1.14    1.07   1.30
#   eight scenes, each of another medium (384k)   1.41           2.00
#
#   of the finest mesh, after refinement
#   a beam on the whole body, 154k                1.58           1.62
#   the same in three channels, 291k              1.37           1.90
#   and with diffuse light, 197k                  1.78           1.96
#   a pencil beam, 191k                           1.46           1.62
#   eight point sources, 238k                     1.54           1.76
#
# Refinement holds two meshes at a time, and makes another one that may turn out to be too large.
IMPORTED = 80e6
GIVEN, REFINED = 1000.0, 1600.0
# For each further medium, a matrix and its solver; for each light of each scene, its fluence and its patch.
MATRIX, LIGHT = 120.0, 20.0
# Quadratic elements, where detectors are read, on 74,000 tetrahedra.
READING = 3750.0


def need(tetrahedra: int, matrices: int = 1, lights: int = 1, *, refined: bool = False, reading: bool = False) -> float:
    """Memory that it takes to solve on a mesh and to estimate the error, bytes.

    Parameters
    ----------
    tetrahedra : int
    matrices : int
        How many different media, or sets of media, are solved for.
    lights : int
        Those of all scenes.
    refined : bool
        Whether the mesh is one of several, each finer than the one before.
    reading : bool
        Whether detectors are read.
    """
    return IMPORTED + tetrahedra * _each(matrices, lights, refined=refined, reading=reading)


def _each(matrices: int, lights: int, *, refined: bool, reading: bool) -> float:
    of_readings = READING if reading else 0.0
    return (REFINED if refined else GIVEN) + MATRIX * (matrices - 1) + LIGHT * lights + of_readings


def check_memory(tetrahedra: int, matrices: int = 1, lights: int = 1, *, reading: bool = False) -> None:
    """Refuse a mesh that there is not enough memory for; see `need`.

    Raises
    ------
    RunError
    """
    needed, there = need(tetrahedra, matrices, lights, reading=reading), available()
    if needed > there:
        raise RunError(
            f"{tetrahedra:,} tetrahedra need about {gigabytes(needed)} GB of memory, and {gigabytes(there)} GB are "
            "available; give a coarser mesh or fewer channels, or run it where there is more."
        )


def limited_by_memory(most: int, matrices: int = 1, lights: int = 1, *, reading: bool = False) -> tuple[int, str]:
    """How many tetrahedra a mesh may be refined to, `most` at the most, and in words what the limit is."""
    there = available()
    affordable = max(0.0, there - IMPORTED) / _each(matrices, lights, refined=True, reading=reading)
    if affordable >= most:
        return most, f"at the limit of {most:,} tetrahedra"
    return int(affordable), f"at the {affordable:,.0f} tetrahedra that {gigabytes(there)} GB of memory suffice for"


def gigabytes(memory: float) -> str:
    """Bytes in units of 1e9, as people read them."""
    return f"{memory / 1e9:.3g}" if memory < 1e11 else f"{memory / 1e9:.0f}"


def available(root: Path = Path("/")) -> float:
    """Memory that this process may still use, bytes: as the system, its control group and its own limit have it.

    Elsewhere than on Linux it is all that the machine has, or infinite where that is not known. `root` is the folder
    that holds ``proc`` and ``sys``.
    """
    found = [*_of_system(root), *_of_groups(root), *_of_limit(root)]
    if not found and hasattr(os, "sysconf"):
        with suppress(OSError, ValueError):
            found = [float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")]
    return max(0.0, min(found, default=float("inf")))


def _of_system(root: Path) -> Iterator[float]:
    with suppress(OSError, ValueError):
        for line in (root / "proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                yield 1024.0 * int(line.split()[1])


def _of_groups(root: Path) -> Iterator[float]:
    """What the control groups leave that this process is in, of version 2 and of version 1."""
    with suppress(OSError):
        for line in (root / "proc/self/cgroup").read_text().splitlines():
            _, controllers, path = line.split(":", 2)
            if controllers == "":
                base, limit, usage = root / "sys/fs/cgroup", "memory.max", "memory.current"
            elif "memory" in controllers.split(","):
                base, limit, usage = root / "sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes"
            else:
                continue
            # The group and those that it is part of; in a container the first ones are not to be seen.
            group = base / path.lstrip("/")
            for folder in (group, *group.parents):
                with suppress(OSError, ValueError):
                    left = int((folder / limit).read_text()) - int((folder / usage).read_text())
                    yield float(left + _cached(folder))
                if folder == base:
                    break


def _cached(folder: Path) -> int:
    """Of a control group's memory, what files were read into and the system takes back when it is needed."""
    lines = (folder / "memory.stat").read_text().splitlines()
    return next((int(line.split()[1]) for line in lines if line.startswith("inactive_file ")), 0)


def _of_limit(root: Path) -> Iterator[float]:
    """What ``ulimit -v`` leaves."""
    if sys.platform == "linux":
        import resource  # noqa: PLC0415

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        if limit != resource.RLIM_INFINITY:
            with suppress(OSError, ValueError):
                pages = int((root / "proc/self/statm").read_text().split()[0])
                yield float(limit - pages * resource.getpagesize())
