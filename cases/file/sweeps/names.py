"""Names of the folders of a sweep's runs: short, portable and different from each other."""

from collections import Counter
from collections.abc import Mapping, Sequence
from hashlib import blake2b
from typing import Any

# The longest name of a folder that file systems allow, bytes.
LONGEST_NAME = 255
# Longer names of runs are cut, so that whole paths stay below the 260 characters that Windows allows.
LONGEST_LABEL, LONGEST_VALUE = 120, 40
# What Windows does not allow in names.
RESERVED = '<>:"/\\|?*'


def folder_names(points: Sequence[Mapping[str, Any]]) -> list[str]:
    """Name the folder of each run: ``key=value,...``.

    Lists are written as ``1_2_3``, mappings by their keys and a hash; characters that file systems refuse become
    ``_``. What is too long is cut and ends in a hash, and so do names that would be the same, where upper and lower
    case count as the same.

    Parameters
    ----------
    points : sequence of mapping
        The values of each run, by key.

    Returns
    -------
    list of str

    Examples
    --------
    >>> folder_names([{"medium.eta": 1.4, "lights.0.pencil.origin": [0, 0, 20]}])
    ['medium.eta=1.4,lights.0.pencil.origin=0_0_20']
    """
    names = [_shorten(",".join(f"{key}={_text(value)}" for key, value in point.items()), point) for point in points]
    counts = Counter(name.casefold() for name in names)
    return [
        name if counts[name.casefold()] == 1 else f"{name[:LONGEST_LABEL]}-{_hash(point)}"
        for name, point in zip(names, points, strict=True)
    ]


def identity(value: Any) -> str:
    """A text that is the same for equal values, and for 1 and 1.0."""
    if isinstance(value, dict):
        return "{" + ",".join(f"{key!r}:{identity(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ",".join(map(identity, value)) + "]"
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) < 2**53:
        return repr(float(value))
    return repr(value)


def _text(value: Any) -> str:
    """A value as part of a name."""
    if isinstance(value, list) and not any(isinstance(each, list | dict) for each in value):
        text = "_".join(map(str, value))
        return text if len(text) <= LONGEST_VALUE else f"{text[:16]}-{_hash(value)}"
    if isinstance(value, list | dict):
        return f"{_first_key(value)}-{_hash(value)}"
    return str(value)


def _first_key(value: Any) -> str:
    """A word that describes nested values: the first key, and its value if that is a word."""
    if isinstance(value, list):
        return _first_key(value[0]) if value else "none"
    if isinstance(value, dict):
        key = next(iter(value), "none")
        inner = value.get(key)
        return f"{key}_{inner}"[:24] if isinstance(inner, str) else str(key)[:24]
    return str(value)[:24]


def _shorten(label: str, point: Mapping[str, Any]) -> str:
    """A label without characters that file systems refuse, and not too long."""
    clean = "".join("_" if c in RESERVED or not c.isprintable() else c for c in label)
    clean = clean[:-1] + "_" if clean.endswith((" ", ".")) else clean
    if len(clean.encode()) <= LONGEST_LABEL:
        return clean
    return f"{clean.encode()[: LONGEST_LABEL - 13].decode(errors='ignore')}-{_hash(point)}"


def _hash(value: Any) -> str:
    text = identity(dict(value) if isinstance(value, Mapping) else value)
    return blake2b(text.encode(errors="surrogatepass"), digest_size=6).hexdigest()
