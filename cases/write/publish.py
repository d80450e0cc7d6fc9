"""Results appear whole or not at all: they are made in a folder beside, which one process has to itself."""

import errno
import os
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from hashlib import blake2b
from pathlib import Path

from tetlux.meshing.errors import InputError, RunError

# How file systems say that they have no locks.
WITHOUT_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS, errno.EINVAL, errno.EBADF)


@contextmanager
def claimed(out: Path, name: str) -> Iterator[Path]:
    """A new folder for the results of that name, gone afterwards.

    While the block runs no other process is given the same one, and what a killed process left of it is removed. A
    lock tells the two apart, since it ends with its process, however that ends; on Windows, and where a file system
    has no locks, runs at the same time are not kept apart.

    Parameters
    ----------
    out : Path
        Folder of all results.
    name : str
        Where in it they are to go.

    Yields
    ------
    Path

    Raises
    ------
    RunError
        If another process is at work on the same, or nothing can be written there.
    """
    target = out / name
    # Names may be too long for a prefix, and lie in subfolders.
    place = out / f".partial-{blake2b(os.fsencode(name), digest_size=6).hexdigest()}"
    folder = place / "results"
    try:
        lock = _lock(place)
    except BlockingIOError as error:
        raise RunError(
            f"another run is at work on {target}; wait for its end, or choose another folder with --out."
        ) from error
    except OSError as error:
        raise cannot_write(target, error) from error
    try:
        try:
            if folder.exists():
                shutil.rmtree(folder)
            folder.mkdir()
            # Now, and not after an hour's work: a file may be in the way, or a folder that is read only.
            if target.exists():
                next(target.iterdir(), None)
                if not os.access(target, os.W_OK):
                    raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        except OSError as error:
            raise cannot_write(target, error) from error
        yield folder
    finally:
        shutil.rmtree(place, ignore_errors=True)
        # Not before: another process would take what is there for a killed one's.
        os.close(lock)


def _lock(folder: Path) -> int:
    """A descriptor that holds the lock on a folder, which is made if need be; BlockingIOError if another one does."""
    while True:
        folder.mkdir(parents=True, exist_ok=True)
        if sys.platform == "win32":
            return os.open(os.devnull, os.O_RDONLY)
        import fcntl  # noqa: PLC0415

        try:
            lock = os.open(folder, os.O_RDONLY)
        except FileNotFoundError:
            continue
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # Whoever had it before may have removed the folder.
            if folder.stat().st_ino == os.fstat(lock).st_ino:
                return lock
        except FileNotFoundError:
            pass
        except OSError as error:
            if error.errno in WITHOUT_LOCKS:
                return lock
            os.close(lock)
            raise
        os.close(lock)


def publish(folder: Path, target: Path, names: Sequence[str]) -> None:
    """Put files in place of those of an earlier run, which are removed first: a killed run leaves no mixture.

    Parameters
    ----------
    folder : Path
        What `claimed` gave.
    target : Path
        Whatever else is there stays.
    names : sequence of str
        All files that a run may write. The last one is what makes a run a finished one: it is the first to go and the
        last to come.

    Raises
    ------
    OSError
    """
    for name in reversed(names):
        (target / name).unlink(missing_ok=True)
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        # All at once, unless something else is there.
        folder.rename(target)
    except OSError:
        for name in names:
            if (folder / name).exists():
                (folder / name).replace(target / name)


def check_writable(out: Path) -> None:
    """Refuse a folder that results cannot be written to, before anything is solved for it.

    Raises
    ------
    InputError
    """
    try:
        with claimed(out, "."):
            pass
    except RunError as error:
        # Another run that is looking at the same time finds the same.
        if not isinstance(error.__cause__, BlockingIOError):
            raise InputError(str(error)) from error


def cannot_write(target: Path, error: OSError) -> RunError:
    """What to say of an error of the file system."""
    return RunError(
        f"results cannot be written to {target}: {error.strerror or error}; choose another folder with --out."
    )
