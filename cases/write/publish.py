"""Atomic results: a run writes into a locked folder beside its target, and moves the files when all are complete."""

import errno
import os
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from hashlib import blake2b
from pathlib import Path

from tetlux.meshing.errors import InputError, RunError

# Errors of file systems that do not support locks.
WITHOUT_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS, errno.EINVAL, errno.EBADF)
# Errors of disks without room.
FULL = (errno.ENOSPC, errno.EDQUOT)


@contextmanager
def claim_folder(out: Path, name: str) -> Iterator[Path]:
    """Create and lock a temporary folder for the results of a run, and remove it afterwards.

    A second process that asks for the same name is refused while the lock is held. Since a lock ends with its
    process, what a killed process left is recognized and removed. On Windows, and on file systems without locks,
    simultaneous runs are not kept apart.

    Parameters
    ----------
    out : Path
        Folder of all results.
    name : str
        The final folder of this run, relative to `out`.

    Yields
    ------
    Path
        The temporary folder.

    Raises
    ------
    RunError
        If another process holds the lock, or the folder cannot be written to.
    """
    target = out / name
    # A hash, since names may have subfolders and be too long for a prefix.
    folder = out / f".partial-{blake2b(os.fsencode(name), digest_size=6).hexdigest()}"
    try:
        lock = _lock(folder)
    except BlockingIOError as error:
        raise RunError(
            f"another run is at work on {target}; wait for its end, or choose another folder with --out."
        ) from error
    except OSError as error:
        raise write_error(out, name, error) from error
    try:
        try:
            _remove_content(folder)
            # Fail now, not after an hour of work, if a file or a read-only folder is in the way.
            if target.exists():
                next(target.iterdir(), None)
                if not os.access(target, os.W_OK):
                    raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        except OSError as error:
            raise write_error(out, name, error) from error
        yield folder
    finally:
        # Unless it has become the final folder, and another process has begun one of the same name.
        with suppress(OSError):
            if _is_of(lock, folder):
                # Results that were moved leave it empty, which takes a tenth of the time to remove.
                try:
                    folder.rmdir()
                except OSError:
                    shutil.rmtree(folder, ignore_errors=True)
        # Unlock last: otherwise another process would take the folder for that of a killed one.
        os.close(lock)


def _lock(folder: Path) -> int:
    """Create and lock a folder, and return the descriptor that holds the lock; BlockingIOError if it is locked."""
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
            # The process that held the lock before may have removed the folder.
            if _is_of(lock, folder):
                return lock
        except OSError as error:
            if error.errno in WITHOUT_LOCKS:
                return lock
            os.close(lock)
            raise
        os.close(lock)


def _is_of(lock: int, folder: Path) -> bool:
    """Whether a lock is of the folder that is there; without locks it always is."""
    if sys.platform == "win32":
        return True
    try:
        return folder.stat().st_ino == os.fstat(lock).st_ino
    except FileNotFoundError:
        return False


def _remove_content(folder: Path) -> None:
    """Remove what a killed process left in a folder."""
    for path in folder.iterdir():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()


def publish(folder: Path, target: Path, names: Sequence[str]) -> None:
    """Replace the files of an earlier run by new ones, so that files of two runs are never mixed.

    Parameters
    ----------
    folder : Path
        The folder of the new files, from `claim_folder`.
    target : Path
        The final folder; other files in it stay.
    names : sequence of str
        All files that a run may write. The last one marks a finished run: it is removed first and moved last.

    Raises
    ------
    OSError
        If a file cannot be removed or moved.
    """
    if target.exists():
        for name in reversed(names):
            (target / name).unlink(missing_ok=True)
    else:
        target.parent.mkdir(parents=True, exist_ok=True)
    try:
        # In one step, unless the target exists and is not empty.
        folder.rename(target)
    except OSError:
        if not target.is_dir():
            raise
        for name in names:
            if (folder / name).exists():
                (folder / name).replace(target / name)


@contextmanager
def replace_files(out: Path, names: Sequence[str]) -> Iterator[Path]:
    """Replace files of a folder, all or none, by those that the block writes into a temporary folder.

    Parameters
    ----------
    out : Path
        Folder of the files.
    names : sequence of str
        All files that the block writes.

    Yields
    ------
    Path
        The temporary folder.

    Raises
    ------
    RunError
        If they cannot be written.
    """
    with claim_folder(out, ".") as folder:
        try:
            yield folder
            publish(folder, out, names)
        except OSError as error:
            raise write_error(out, ".", error) from error


def check_writable(out: Path) -> None:
    """Refuse a folder that results cannot be written to, before anything is solved.

    Raises
    ------
    InputError
        If it cannot be written to.
    """
    try:
        with claim_folder(out, "."):
            pass
    except RunError as error:
        # If another run holds the lock, that run can write here.
        if not isinstance(error.__cause__, BlockingIOError):
            raise InputError(str(error)) from error


def disk_is_full(error: BaseException) -> bool:
    """Whether results cannot be written because there is no room."""
    return isinstance(error.__cause__, OSError) and error.__cause__.errno in FULL


def write_error(out: Path, name: str, error: OSError) -> RunError:
    """The error to raise when the results of a run cannot be written into the folder of all results."""
    # A full disk is full for all runs.
    place, room = (out, "make room, or ") if error.errno in FULL else (out / name, "")
    return RunError(
        f"results cannot be written to {place}: {error.strerror or error}; {room}choose another folder with --out."
    )
