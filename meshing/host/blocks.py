"""Process long arrays in cache-sized blocks on all cores."""

import os
import threading
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import cache
from typing import TypeVar, cast

import numpy as np
import numpy.typing as npt

from tetlux.meshing.arrays import IntArray

# Rows per block. Fresh memory costs more than the arithmetic on it, and blocks of this size reuse memory.
BLOCK = 8192
# Keys sorted at once, and the largest number of parts that keys are divided into, since each part scans all keys.
KEYS_AT_ONCE = 1 << 20
MOST_KEY_PARTS = 8

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")

# Cores that this process may use, and threads that it does use: workers beside each other use one each.
CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)
THREADS_VARIABLE = "TETLUX_THREADS"
THREADS = int(os.environ.get(THREADS_VARIABLE, CORES))


def map_in_threads(work: Callable[[_Item], _Result], items: Sequence[_Item]) -> list[_Result]:
    """Compute ``[work(item) for item in items]`` on all cores: in this thread, and in others that are kept for it.

    Within such work all cores are busy, and more of it is done by one thread.
    """
    if len(items) < 2 or THREADS < 2 or getattr(_here, "is_busy", False):
        return [work(item) for item in items]
    results: list[_Result | None] = [None] * len(items)
    # Each item is taken once, by whichever thread comes first: taking from a deque is atomic.
    left = deque(range(len(items)))

    def take() -> None:
        _here.is_busy = True
        try:
            while left:
                try:
                    number = left.popleft()
                except IndexError:  # another thread took the last one
                    return
                results[number] = work(items[number])
        finally:
            # An error or an interrupt ends the others too.
            left.clear()
            _here.is_busy = False

    others: list[Future[None]] = []
    try:
        others += [_pool(THREADS - 1).submit(take) for _ in range(min(THREADS, len(items)) - 1)]
        take()
    finally:
        left.clear()
        # One that still waits for a thread has nothing to do.
        begun = [other for other in others if not other.cancel()]
        wait(begun)
    for other in begun:
        other.result()
    return cast("list[_Result]", results)


_here = threading.local()


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """Threads that are kept, since starting them takes as long as small work."""
    return ThreadPoolExecutor(threads)


if hasattr(os, "register_at_fork"):
    # A forked process has none of the threads.
    os.register_at_fork(after_in_child=_pool.cache_clear)


def run_in_blocks(work: Callable[[slice], object], count: int, size: int = BLOCK) -> None:
    """Call ``work(slice)`` for slices of `size` that together cover ``range(count)``, in threads on all cores."""
    map_in_threads(work, [slice(start, min(start + size, count)) for start in range(0, count, size)])


def group_keys(keys: npt.NDArray[np.uint64]) -> tuple[npt.NDArray[np.uint64], npt.NDArray[np.int32]]:
    """Compute ``numpy.unique(keys, return_inverse=True)``, about ten times faster for many keys.

    NumPy's `sort` is several times faster than its `argsort`, so each key is sorted with its index as low digits.

    Parameters
    ----------
    keys : (k,) ndarray of uint64

    Returns
    -------
    unique : (u,) ndarray
        Ascending.
    inverse : (k,) ndarray of int32
    """
    parts = min(max(1, -(-len(keys) // KEYS_AT_ONCE)), MOST_KEY_PARTS)
    sample = np.sort(keys[:: max(1, len(keys) // (64 * parts))])
    limits = [np.uint64(0), *sample[(np.arange(1, parts) * len(sample)) // parts]]
    groups: list[tuple[npt.NDArray[np.uint64], IntArray, npt.NDArray[np.int32]]] = [_NO_KEYS] * parts

    def sort_part(block: slice) -> None:
        part = block.start
        inside = keys >= limits[part]
        if part + 1 < parts:
            inside &= keys < limits[part + 1]
        groups[part] = _group_part(keys, np.flatnonzero(inside), limits[part])

    run_in_blocks(sort_part, parts, 1)
    first = np.concatenate([[0], np.cumsum([len(unique) for unique, _, _ in groups])])
    inverse = np.empty(len(keys), dtype=np.int32)

    def place_part(block: slice) -> None:
        _, indices, rank = groups[block.start]
        inverse[indices] = rank + np.int32(first[block.start])

    run_in_blocks(place_part, parts, 1)
    return np.concatenate([unique for unique, _, _ in groups]), inverse


_NO_KEYS = (np.zeros(0, np.uint64), np.zeros(0, np.int64), np.zeros(0, np.int32))


def _group_part(
    keys: npt.NDArray[np.uint64], indices: IntArray, least: np.uint64
) -> tuple[npt.NDArray[np.uint64], IntArray, npt.NDArray[np.int32]]:
    """The unique keys at `indices`, the indices in ascending order of keys, and the rank of each key."""
    if len(indices) == 0:
        return _NO_KEYS
    key = keys[indices] - least
    count = np.uint64(len(indices))
    if int(key.max()) < (2**64 - len(indices)) // len(indices):
        key *= count
        key += np.arange(len(indices), dtype=np.uint64)
        key.sort()
        sorted_key = key // count
        key -= sorted_key * count
        order = key.view(np.int64)
    else:
        order = np.argsort(key, kind="stable")
        sorted_key = key[order]
    new = np.empty(len(indices), dtype=bool)
    new[0] = True
    np.not_equal(sorted_key[1:], sorted_key[:-1], out=new[1:])
    rank = np.cumsum(new, dtype=np.int32)
    rank -= 1
    return sorted_key[new] + least, indices[order], rank


def find_single_keys(keys: npt.NDArray[np.uint64]) -> IntArray:
    """Indices (o,), ascending, of the keys (k,) that occur once."""
    ordered = np.sort(keys)
    differs = ordered[1:] != ordered[:-1]
    is_single = np.ones(len(keys), dtype=bool)
    is_single[1:] &= differs
    is_single[:-1] &= differs
    single = ordered[is_single]
    # Few keys occur once, so a table of their hashes excludes most indices before the binary search.
    table = np.zeros(1 << _HASH_BITS, dtype=bool)
    table[_hash(single)] = True
    candidate = np.empty(len(keys), dtype=bool)

    def mark(block: slice) -> None:
        candidate[block] = table[_hash(keys[block])]

    run_in_blocks(mark, len(keys), 16 * BLOCK)
    indices = np.flatnonzero(candidate)
    position = np.searchsorted(single, keys[indices])
    present = position < len(single)
    present[present] = single[position[present]] == keys[indices[present]]
    return indices[present]


_HASH_BITS = 20


def _hash(keys: npt.NDArray[np.uint64]) -> IntArray:
    # Fibonacci hashing (Knuth, The Art of Computer Programming, vol. 3, 6.4).
    return (keys * np.uint64(0x9E3779B97F4A7C15) >> np.uint64(64 - _HASH_BITS)).view(np.int64)
