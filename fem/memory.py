"""How much memory a solution takes, and how much is available."""

import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from tetlux.meshing.errors import RunError

# Measured: growth of the peak memory of a process while it solves and estimates the error, less BYTES_OF_IMPORTS, in kB
# for each tetrahedron; the last column is what `estimate_memory` gives:
#
#   a given mesh, by its tetrahedra               413k  1,296k  estimate
#   a point source                                 .54     .79    .80
#   eight                                          .62     .71    .94
#   eight, and diffuse light                               .71    .96
#   a beam on the whole body                       .66            .80
#   the same in three channels                     .84     .89   1.04
#   eight scenes, each of another medium (384k)   1.10           1.64
#
#   the finest mesh, after refinement (with threads started anew for each piece of work, which take a third more)
#   a beam on the whole body, 154k                1.58           1.62
#   the same in three channels, 291k              1.37           1.86
#   and with diffuse light, 197k                  1.78           1.92
#   a pencil beam, 191k                           1.46           1.62
#   eight point sources, 238k                     1.54           1.76
#
# Refinement holds two meshes at a time, and makes a third one that may turn out to be too large.
BYTES_OF_IMPORTS = 80e6
BYTES_PER_TETRAHEDRON_GIVEN, BYTES_PER_TETRAHEDRON_REFINED = 780.0, 1600.0
# For each tetrahedron: of a further medium (its matrix and solver), of a light (its fluence and patch), and of
# quadratic elements, where detectors are read (measured on 74,000 tetrahedra).
BYTES_PER_MATRIX, BYTES_PER_LIGHT, BYTES_OF_READINGS = 100.0, 20.0, 3750.0
# What the first version of control groups calls no limit is a little less than 2^63 bytes.
NO_LIMIT = 2**62


def estimate_memory(
    tetrahedra: int, matrices: int = 1, lights: int = 1, *, refined: bool = False, reading: bool = False
) -> float:
    """Estimate the memory that it takes to solve on a mesh and to estimate the error, bytes.

    Parameters
    ----------
    tetrahedra : int
    matrices : int
        How many different media, or sets of media, are solved for.
    lights : int
        How many lights all scenes have together.
    refined : bool
        Whether the mesh is made by refinement, which holds two meshes at a time.
    reading : bool
        Whether detectors are read.

    Returns
    -------
    float
    """
    return BYTES_OF_IMPORTS + tetrahedra * _bytes_per_tetrahedron(matrices, lights, refined=refined, reading=reading)


def _bytes_per_tetrahedron(matrices: int, lights: int, *, refined: bool, reading: bool) -> float:
    """Bytes that each tetrahedron takes."""
    of_mesh = BYTES_PER_TETRAHEDRON_REFINED if refined else BYTES_PER_TETRAHEDRON_GIVEN
    of_readings = BYTES_OF_READINGS if reading else 0.0
    return of_mesh + BYTES_PER_MATRIX * (matrices - 1) + BYTES_PER_LIGHT * lights + of_readings


def check_memory(tetrahedra: int, matrices: int = 1, lights: int = 1, *, reading: bool = False) -> None:
    """Refuse a mesh that takes more memory than is available; see `estimate_memory`.

    Raises
    ------
    RunError
    """
    needed, free = estimate_memory(tetrahedra, matrices, lights, reading=reading), available()
    if needed > free:
        raise RunError(
            f"{tetrahedra:,} tetrahedra need about {gigabytes(needed)} GB of memory, and {gigabytes(free)} GB are "
            "available; give a coarser mesh or fewer channels, or run it where there is more."
        )


@dataclass(frozen=True)
class MeshLimit:
    """How many tetrahedra a mesh may be refined to.

    Attributes
    ----------
    tetrahedra : int
    memory : float or None
        Available memory, bytes, if that sets the limit.
    """

    tetrahedra: int
    memory: float | None = None


def limit_by_memory(most: int, matrices: int = 1, lights: int = 1, *, reading: bool = False) -> MeshLimit:
    """The number of tetrahedra that memory suffices for, at most `most`; see `estimate_memory`."""
    free = available()
    each = _bytes_per_tetrahedron(matrices, lights, refined=True, reading=reading)
    affordable = max(0.0, free - BYTES_OF_IMPORTS) / each
    return MeshLimit(most) if affordable >= most else MeshLimit(round(affordable), free)


def gigabytes(memory: float) -> str:
    """Format a number of bytes in GB (1e9 bytes), with three digits."""
    return f"{memory / 1e9:.3g}" if memory < 1e11 else f"{memory / 1e9:.0f}"


def share_memory(processes: int) -> None:
    """Say that so many processes share the memory that is available, so that each takes its part only."""
    global _processes  # noqa: PLW0603
    _processes = processes


_processes = 1


def available(root: Path = Path("/")) -> float:
    """Memory that this process may still use, bytes: the least that system, control groups and ``ulimit`` leave.

    It is divided by the number of processes that `share_memory` was told of.

    On other systems than Linux it is all memory of the machine, or infinite where that is not known. `root` is the
    folder that holds ``proc`` and ``sys``.
    """
    found = [*_left_by_system(root), *_left_by_groups(root), *_left_by_ulimit(root)]
    if not found and hasattr(os, "sysconf"):
        with suppress(OSError, ValueError):
            found = [float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")]
    return max(0.0, min(found, default=float("inf"))) / _processes


def _left_by_system(root: Path) -> Iterator[float]:
    with suppress(OSError, ValueError):
        for line in (root / "proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                yield 1024.0 * int(line.split()[1])


def _left_by_groups(root: Path) -> Iterator[float]:
    """What each control group of this process leaves, in version 1 and version 2."""
    with suppress(OSError):
        for line in (root / "proc/self/cgroup").read_text().splitlines():
            _, controllers, path = line.split(":", 2)
            if controllers == "":
                base, limit, usage = root / "sys/fs/cgroup", "memory.max", "memory.current"
            elif "memory" in controllers.split(","):
                base, limit, usage = root / "sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes"
            else:
                continue
            # The limits of parent groups count too. A container does not see its own group under its full path.
            group = base / path.lstrip("/")
            for folder in (group, *group.parents):
                with suppress(OSError, ValueError):
                    # The second version calls no limit "max", which is no number.
                    if (allowed := int((folder / limit).read_text())) < NO_LIMIT:
                        left = allowed - int((folder / usage).read_text())
                        yield float(left + _reclaimable_cache(folder))
                if folder == base:
                    break


def _reclaimable_cache(folder: Path) -> int:
    """File cache that counts as used by a control group, which the system reclaims when memory is needed."""
    lines = (folder / "memory.stat").read_text().splitlines()
    return next((int(line.split()[1]) for line in lines if line.startswith("inactive_file ")), 0)


def _left_by_ulimit(root: Path) -> Iterator[float]:
    """What ``ulimit -v`` leaves."""
    if sys.platform == "linux":
        import resource  # noqa: PLC0415

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        if limit != resource.RLIM_INFINITY:
            with suppress(OSError, ValueError):
                pages = int((root / "proc/self/statm").read_text().split()[0])
                yield float(limit - pages * resource.getpagesize())
